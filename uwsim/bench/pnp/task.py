"""Pose from points, on problems made here: every solver on the same ones, all problems of a setting in one call.

What NEEDS may list:
  true_pose   (B, 4, 4) camera_from_target

A case is a setting: a layout, a place, and one value of what is swept. Scores are held against ML* (`reference`). A
problem without a pose has infinite errors in medians and counts as failed, so that no solver gains by refusing;
means are over the poses that there are. Without noise ML* has no error: there only `exact_percent` is scored.
"""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from types import ModuleType

import numpy as np

from uwsim.bench import runner
from uwsim.bench.pnp.reference import STEPS, Errors, Reference, errors_of, reference_of
from uwsim.bench.pnp.settings import Batch, Problems, Setting
from uwsim.bench.pnp.statistics import finite, median_ratio, ratio_interval, rms
from uwsim.bench.task import Case, Task
from uwsim.pose import solvers
from uwsim.pose.polish import polished

STATISTICS = {
    "rotation_ratio_to_ml": "median", "translation_ratio_to_ml": "median", "fail_percent": "mean",
    "missed_minimum_percent": "mean", "no_pose_percent": "mean", "exact_percent": "mean",
    "microseconds_per_problem": "median",
}  # fmt: skip
DETAILS = (
    "rotation_error_deg", "translation_error_percent", "mean_rotation_error_deg", "mean_translation_error_percent",
    "rotation_ratio_low", "rotation_ratio_high", "translation_ratio_low", "translation_ratio_high",
    "rotation_error_to_bound_ratio", "translation_error_to_bound_ratio", "rotation_rms_to_bound_ratio",
    "translation_rms_to_bound_ratio", "fail_above_best_known_percent", "below_best_known_percent",
)  # fmt: skip
_DIGITS = 5
EXACT_RAD, EXACT_PERCENT = 1e-6, 1e-4
"""Errors that count as exact, the standard of PoseLib's benchmark."""
_SAME_COST, _NO_COST = 1e-4, 1e-16
"""Costs this close, as a share and on the plane z = 1, are those of one minimum."""


@dataclass(frozen=True)
class Truth:
    """The problems of a setting, and what its noise leaves: made when first asked for."""

    setting: Setting
    batch: Batch
    stream: Callable[[str], np.random.Generator]
    resamples: int

    @cached_property
    def reference(self) -> Reference:
        return reference_of(self.batch, noise=self.setting.noise, rng=self.stream("bound"))


def case_names(problems: Problems) -> list[str]:
    return list(problems.settings)


def case(problems: Problems, name: str) -> Case:
    batch = problems.batch(name)
    setting = problems.settings[name]

    def true_pose() -> np.ndarray:
        pose = np.tile(np.eye(4), (setting.trials, 1, 1))
        pose[:, :3, :3], pose[:, :3, 3] = batch.placed.rotation, batch.placed.translation_m
        return pose

    def stream(purpose: str) -> np.random.Generator:
        return problems.stream(setting, purpose)

    truth = Truth(setting, batch, stream, problems.protocol.resamples)
    return Case(name=name, image=np.empty((0, 0, 3)), makers={"true_pose": true_pose}, truth=truth)


def unsuited(module: ModuleType, setting: Setting) -> str:
    """Return why a solver is not made for a setting's targets; "" if it is."""
    minimum = getattr(module, "MINIMUM_POINTS", 4)
    if setting.points < minimum:
        return f"needs {minimum} points"
    if setting.flat and not getattr(module, "PLANAR_OK", True):
        return "not for flat targets"
    if not setting.flat and not getattr(module, "SOLID_OK", True):
        return "for flat targets alone"
    return ""


def score(module: ModuleType, name: str, given: tuple[str, ...], case: Case) -> dict[str, float | str]:
    scores: dict[str, float | str] = dict.fromkeys((*STATISTICS, *DETAILS), math.nan)
    if reason := unsuited(module, case.truth.setting):
        return scores | {"note": reason}
    pose, microseconds = solved(module, name, given, case)
    scores |= scored(*pose, case.truth) | {"microseconds_per_problem": microseconds}
    # hundreds of settings, a score of solvers: the digits that say nothing would be most of the file
    return {key: float(f"{value:.{_DIGITS}g}") for key, value in scores.items()}


def solved(
    module: ModuleType, name: str, given: tuple[str, ...], case: Case
) -> tuple[tuple[np.ndarray, np.ndarray], float]:
    """Return ((rotation (B, 3, 3), translation_m (B, 3), NaN without a pose), CPU time by problem [us])."""
    batch, where, times = case.truth.batch, f"pnp: {name}: case {case.name}", []
    for _ in range(case.truth.setting.part.timed_calls):
        inputs = runner.permitted(given, case.makers)
        points_m, points = batch.placed.points_m.copy(), batch.points.copy()
        before = time.process_time()
        solution, _ = runner.timed(runner.entry(module, name, "solve"), points_m, points, where=where, **inputs)
        times.append(time.process_time() - before)
    return poses_of(solution, len(batch.points), where), 1e6 * min(times) / len(batch.points)


def poses_of(solution: object, count: int, where: str) -> tuple[np.ndarray, np.ndarray]:
    """Return what a solver returned as rotation (B, 3, 3) and translation_m (B, 3), NaN without a pose.

    ValueError, beginning with `where`, for what is no Solution of `count` problems.
    """
    try:
        ok = np.asarray(solution.ok, bool).reshape(count)
        rotation = np.array(solution.rotation, float).reshape(count, 3, 3)
        translation_m = np.array(solution.translation_m, float).reshape(count, 3)
    except (AttributeError, TypeError, ValueError) as error:
        raise ValueError(
            f"{where}: returned no Solution of rotation (B, 3, 3), translation_m (B, 3), ok (B,): {error}"
        ) from None
    ok = ok & np.all(np.isfinite(translation_m), axis=1) & np.all(np.isfinite(rotation), axis=(1, 2))
    rotation[~ok], translation_m[~ok] = np.nan, np.nan
    return rotation, translation_m


def scored(rotation: np.ndarray, translation_m: np.ndarray, truth: Truth) -> dict[str, float]:
    """Return the scores of poses (B, 3, 3), (B, 3) [m], NaN without a pose; ValueError for what is no rotation."""
    try:
        errors = errors_of(rotation, translation_m, truth.batch.placed)
    except ValueError as error:
        raise ValueError(f"pnp: case {truth.setting.name}: {error}") from None
    there = np.isfinite(errors.turn_deg)
    found = {
        "no_pose_percent": _percent(~there),
        "rotation_error_deg": finite(np.median(errors.turn_deg)),
        "translation_error_percent": finite(np.median(errors.shift_percent)),
        "mean_rotation_error_deg": float(errors.turn_deg[there].mean()) if there.any() else math.nan,
        "mean_translation_error_percent": float(errors.shift_percent[there].mean()) if there.any() else math.nan,
    }
    if truth.setting.noise == 0:
        exact = (np.radians(errors.turn_deg) < EXACT_RAD) & (errors.shift_percent < EXACT_PERCENT)
        return found | {"exact_percent": _percent(exact)}
    return found | _against_reference(errors, truth) | _minima(rotation, translation_m, truth)


def _against_reference(errors: Errors, truth: Truth) -> dict[str, float]:
    reference, found = truth.reference, {}
    failed = errors.turn_deg > reference.fail_deg
    found["fail_percent"] = _percent(failed)
    found["fail_above_best_known_percent"] = _percent(failed) - _percent(reference.best.turn_deg > reference.fail_deg)
    for number, (words, key) in enumerate((("rotation", "turn_deg"), ("translation", "shift_percent"))):
        own, ml = getattr(errors, key), getattr(reference.ml, key)
        # the same draws for every solver
        low, high = ratio_interval(own, ml, resamples=truth.resamples, rng=truth.stream("bootstrap"))
        found |= {
            f"{words}_ratio_to_ml": median_ratio(own, ml),
            f"{words}_ratio_low": low, f"{words}_ratio_high": finite(high),
            f"{words}_error_to_bound_ratio": finite(np.median(own) / reference.bound[number]),
            f"{words}_rms_to_bound_ratio": rms(own) / reference.bound_rms[number],
        }  # fmt: skip
    return found


def _minima(rotation: np.ndarray, translation_m: np.ndarray, truth: Truth) -> dict[str, float]:
    """Return how often the minimum that the poses' basin ends in is above, and below, the best known."""
    batch, known = truth.batch, truth.reference.cost
    cost = polished(rotation, translation_m, batch.placed.points_m, batch.points, steps=STEPS)[2]
    return {
        "missed_minimum_percent": _percent(cost > (1 + _SAME_COST) * known + _NO_COST),
        "below_best_known_percent": _percent(cost < (1 - _SAME_COST) * known - _NO_COST),
    }


def _percent(flags: np.ndarray) -> float:
    return 100.0 * float(np.mean(flags))


def conditions(problems: Problems, cases: list[str]) -> dict[str, dict]:
    """Return what each setting is, as the page groups them."""
    found = {}
    for name in cases:
        setting = problems.settings[name]
        part = setting.part
        found[name] = {
            "part": setting.part_name, "figure": part.figure, "use": part.use, "layout": part.layout,
            "edge_m": part.edge_m, "placed": part.placed, "sweep": part.sweep, "value": setting.value,
            "points": setting.points, "flat": setting.flat, "near": setting.near, "depth_ratio": setting.depth_ratio,
            "focal_px": part.focal_px, "trials": setting.trials,
            **{key: setting.of(key) for key in ("noise_px", "depth_m", "off_axis_m", "angle_deg")},
        }  # fmt: skip
    return found


def summaries(problems: Problems, cases: list[str]) -> dict[str, list[str]]:
    """Return the cases of "all", and of some kinds of settings."""
    settings = {name: problems.settings[name] for name in cases}
    kinds = {
        "solid": [name for name, one in settings.items() if not one.flat and one.part.use == "protocol"],
        "flat": [name for name, one in settings.items() if one.flat and one.part.use == "protocol"],
        "near": [name for name, one in settings.items() if one.near],
        "hold-out": [name for name, one in settings.items() if one.part.use == "hold_out"],
    }
    return {"all": cases} | {name: some for name, some in kinds.items() if some}


def notes(problems: Problems, cases: list[str]) -> list[str]:
    """Return how many problems there are of each setting, in a sentence."""
    trials = sorted({problems.settings[name].trials for name in cases})
    words = " or ".join(f"{count:,}" for count in trials)
    return [f"{len(cases)} settings of {words} problems each"]


TASK = Task(
    name="pnp",
    package=solvers,
    function="solve",
    inputs=("true_pose",),
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
