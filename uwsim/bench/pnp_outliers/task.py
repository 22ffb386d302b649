"""Pose from points with outliers among them: every robust solver on the same problems.

What NEEDS may list:
  threshold   distance on the plane z = 1 from which on a point is an outlier, a few standard deviations of the noise
  inliers     (B, n) bool, which points are none

A case is a setting: targets of one kind, and one share of outliers. ML* is the least reprojection error of the good
points reached from the true pose. A pose is right where turn and shift are below five times the 95 % quantiles of
ML*'s; one that is not right is wrong, and a solver may also give none. Those count as infinite errors in medians.
"""

import time
from dataclasses import dataclass
from functools import cached_property
from types import ModuleType

import numpy as np

from uwsim.bench import runner
from uwsim.bench.pnp.reference import Errors, Reference, errors_of, reference_of
from uwsim.bench.pnp.statistics import finite, median_ratio, ratio_interval
from uwsim.bench.pnp.task import poses_of
from uwsim.bench.pnp_outliers.settings import Problems, Setting, Spoilt
from uwsim.bench.task import Case, Task
from uwsim.pose import robust_solvers

STATISTICS = {
    "right_percent": "mean", "wrong_percent": "mean", "no_pose_percent": "mean", "rotation_ratio_to_ml": "median",
    "translation_ratio_to_ml": "median", "microseconds_per_problem": "median",
}  # fmt: skip
DETAILS = (
    "rotation_error_deg", "translation_error_percent", "rotation_ratio_low", "rotation_ratio_high",
    "translation_ratio_low", "translation_ratio_high", "rotation_error_to_bound_ratio",
    "translation_error_to_bound_ratio",
)  # fmt: skip
RIGHT_QUANTILE, RIGHT_FACTOR = 0.95, 5.0
_PARTS = {"rotation": ("turn_deg", "deg"), "translation": ("shift_percent", "percent")}
_DIGITS = 5


@dataclass(frozen=True)
class Truth:
    """The problems of a setting, and what the noise of their good points leaves: made when first asked for."""

    problems: Problems
    setting: Setting
    spoilt: Spoilt

    @cached_property
    def reference(self) -> Reference:
        rng = self.problems.stream(self.setting, "bound")
        return reference_of(self.spoilt.good, noise=self.problems.noise, rng=rng)

    def right(self, errors: Errors) -> np.ndarray:
        """Return which poses are right (B,)."""
        found = np.ones(len(errors.turn_deg), bool)
        for key, _ in _PARTS.values():
            ml = getattr(self.reference.ml, key)
            found &= getattr(errors, key) <= RIGHT_FACTOR * np.quantile(ml, RIGHT_QUANTILE, method="inverted_cdf")
        return found


def case_names(problems: Problems) -> list[str]:
    return list(problems.settings)


def case(problems: Problems, name: str) -> Case:
    spoilt = problems.spoilt(name)
    makers = {"threshold": lambda: problems.threshold, "inliers": lambda: spoilt.inliers}
    truth = Truth(problems, problems.settings[name], spoilt)
    return Case(name=name, image=np.empty((0, 0, 3)), makers=makers, truth=truth)


def score(module: ModuleType, name: str, given: tuple[str, ...], case: Case) -> dict[str, float]:
    batch, where = case.truth.spoilt.batch, f"pnp_outliers: {name}: case {case.name}"
    inputs = runner.permitted(given, case.makers)
    points_m, points = batch.placed.points_m.copy(), batch.points.copy()
    before = time.process_time()
    solution, _ = runner.timed(runner.entry(module, name, "solve"), points_m, points, where=where, **inputs)
    microseconds = 1e6 * (time.process_time() - before) / len(points)
    scores = scored(*poses_of(solution, len(points), where), case.truth)
    return {
        key: float(f"{value:.{_DIGITS}g}")
        for key, value in (scores | {"microseconds_per_problem": microseconds}).items()
    }


def scored(rotation: np.ndarray, translation_m: np.ndarray, truth: Truth) -> dict[str, float]:
    """Return the scores of poses (B, 3, 3), (B, 3) [m], NaN without a pose; ValueError for what is no rotation."""
    try:
        errors = errors_of(rotation, translation_m, truth.spoilt.batch.placed)
    except ValueError as error:
        raise ValueError(f"pnp_outliers: case {truth.setting.name}: {error}") from None
    there, right, reference = np.isfinite(errors.turn_deg), truth.right(errors), truth.reference
    found = {
        "right_percent": 100.0 * float(np.mean(right)),
        "wrong_percent": 100.0 * float(np.mean(there & ~right)),
        "no_pose_percent": 100.0 * float(np.mean(~there)),
    }
    for number, (words, (key, unit)) in enumerate(_PARTS.items()):
        own, ml = getattr(errors, key), getattr(reference.ml, key)
        # the same draws for every solver
        rng = truth.problems.stream(truth.setting, "bootstrap")
        low, high = ratio_interval(own, ml, resamples=truth.problems.protocol.resamples, rng=rng)
        found |= {
            f"{words}_error_{unit}": finite(np.median(own)), f"{words}_ratio_to_ml": median_ratio(own, ml),
            f"{words}_ratio_low": low, f"{words}_ratio_high": finite(high),
            f"{words}_error_to_bound_ratio": finite(np.median(own) / reference.bound[number]),
        }  # fmt: skip
    return found


def conditions(problems: Problems, cases: list[str]) -> dict[str, dict]:
    """Return what each setting is, as the page groups them."""
    found = {}
    for name in cases:
        setting = problems.settings[name]
        found[name] = {
            "part": setting.part_name, "points": setting.part.points, "flat": setting.part.flat,
            "wrong": setting.part.wrong, "outliers_percent": setting.percent, "outliers": setting.outliers,
            "trials": setting.trials,
        }  # fmt: skip
    return found


def summaries(problems: Problems, cases: list[str]) -> dict[str, list[str]]:
    """Return the cases of "all", of few outliers and of many."""
    shares = {name: problems.settings[name].percent for name in cases}
    kinds = {
        "without outliers": [name for name, share in shares.items() if share == 0],
        "up to 30 %": [name for name, share in shares.items() if 0 < share <= 30],
        "above 30 %": [name for name, share in shares.items() if share > 30],
    }
    return {"all": cases} | {name: some for name, some in kinds.items() if some}


def notes(problems: Problems, cases: list[str]) -> list[str]:
    """Return how many problems there are of each setting, in a sentence."""
    trials = sorted({problems.settings[name].trials for name in cases})
    return [f"{len(cases)} settings of {' or '.join(f'{count:,}' for count in trials)} problems each"]


TASK = Task(
    name="pnp_outliers",
    package=robust_solvers,
    function="solve",
    inputs=("threshold", "inliers"),
    statistics=STATISTICS,
    case_names=case_names,
    case=case,
    score=score,
    notes=notes,
    details=DETAILS,
    conditions=conditions,
    summaries=summaries,
    frames=Problems,
)
