"""The numbers of the pose benchmark, ordered for tables and figures: by setting, solver, and group of settings."""

import math
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from uwsim.bench.pnp.statistics import geometric_mean
from uwsim.bench.study import StudyByCondition, title

PARTS = ("rotation", "translation")
ERRORS = {"rotation": "rotation_error_deg", "translation": "translation_error_percent"}
MEANS = {part: f"mean_{error}" for part, error in ERRORS.items()}
PRINTED = "parallel_weighted"
"""The dissertation's solver, called Ours there."""
PARALLEL = "parallel"
BEST = "best"
_TIMED = ("time", "speed")
_HALF_WIDTH = 1.96


class Ratio(NamedTuple):
    """Geometric mean of ratios of medians, its 95 % interval, over how many of how many settings; NaN over none."""

    value: float
    low: float
    high: float
    count: int
    of: int


class PoseStudy(StudyByCondition):
    """A result of the pose benchmark, read by name."""

    def scored(self, **wanted: object) -> list[str]:
        """Return the settings with noise, of the dissertation's protocol unless asked for otherwise, not the timed."""
        found = self.cases(**({"use": "protocol"} | wanted))
        return [case for case in found if self.conditions[case]["noise_px"] > 0
                and self.conditions[case]["part"] not in _TIMED]  # fmt: skip

    def groups(self) -> dict[str, list[str]]:
        """Return {words: settings} that geometric means run over, those with any."""
        by = self.conditions
        off_axis = [case for case in self.scored(placed="off_axis") if by[case]["off_axis_m"] >= 0.2]
        found = {
            "solid": self.scored(flat=False), "noise": self.scored(sweep="noise_px"), "near": self.scored(near=True),
            "off axis": off_axis, "flat": self.scored(flat=True), "hold-out": self.scored(use="hold_out"),
        }  # fmt: skip
        return {words: cases for words, cases in found.items() if cases}

    def far_enough(self, **wanted: object) -> list[str]:
        """Return solid settings at least 1.5 edges away, or without one depth."""
        ratios = {case: self.conditions[case]["depth_ratio"] for case in self.scored(flat=False, **wanted)}
        return [case for case, ratio in ratios.items() if ratio is None or ratio >= 1.5 - 1e-9]

    def part(self, *names: str) -> list[str]:
        """Return the settings of parts of the protocol, in their order."""
        return self.cases(part=names)

    def ratio(self, first: str, second: str, part: str, cases: Iterable[str]) -> Ratio:
        """Return how the median errors of a solver compare with another's; part: rotation or translation.

        The interval is that of the settings' own bootstraps, which are independent of each other; between two solvers
        as if theirs were too, so too wide rather than too narrow.
        """
        cases = list(cases)
        logs, spreads = [], []
        for case in cases:
            errors = [self.value(case, name, ERRORS[part]) for name in (first, second)]
            widths = [self._width(case, name, part) for name in (first, second)]
            if all(error > 0 for error in errors) and not any(map(math.isnan, widths)):
                logs.append(math.log(errors[0] / errors[1]))
                spreads.append(math.hypot(*widths))
        if not logs:
            return Ratio(math.nan, math.nan, math.nan, 0, len(cases))
        value = geometric_mean(np.exp(logs))
        half = _HALF_WIDTH * math.sqrt(sum(spread**2 for spread in spreads)) / len(logs)
        return Ratio(value, value * math.exp(-half), value * math.exp(half), len(logs), len(cases))

    def _width(self, case: str, method: str, part: str) -> float:
        """Return the standard error of the logarithm of a solver's ratio to ML*."""
        low, high = (self.value(case, method, f"{part}_ratio_{end}") for end in ("low", "high"))
        return math.log(high / low) / (2 * _HALF_WIDTH) if low > 0 else math.nan

    def bound(self, case: str, part: str) -> float:
        """Return the median error at the Cramer-Rao bound [deg or %]; NaN where no solver has an error."""
        for name in (self.oracle, *self.methods):
            error, ratio = (self.value(case, name, key) for key in (ERRORS[part], f"{part}_error_to_bound_ratio"))
            if error > 0 and ratio > 0:
                return error / ratio
        return math.nan

    def speed(self, method: str) -> float:
        """Return the CPU time of a solver by problem, of many problems [us]; NaN if it was not timed."""
        return self.median(method, "microseconds_per_problem", self.part("speed"))


def name_of(method: str) -> str:
    """Return a solver's name for people."""
    return "ML*" if method == "oracle_start" else title(method)
