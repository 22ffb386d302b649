"""The numbers of a blur benchmark, ordered for tables and figures: by case, method, and what the case was like."""

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from uwsim.bench import study
from uwsim.metrics.blur import MEDIAN_OVER_SD

OURS = "whittle"
PRINTED = "cepstrum_morphology"
"""The dissertation's estimator, every step as described."""
MENDED = "cepstrum_morphology_mended"
DECONVOLVER = "mmse"
"""The deconvolver whose gains have a goal."""


@dataclass(frozen=True)
class Study(study.StudyByCondition):
    """A result, read by name and by the conditions of its cases."""

    def rms_to_bound(self, method: str, quantity: str, cases: Iterable[str]) -> float:
        """Return the root mean square of a method's errors over the bound; quantity: length or angle."""
        found = self.values(method, f"{quantity}_error_to_bound_ratio", cases)
        return MEDIAN_OVER_SD * float(np.sqrt(np.mean(found**2))) if found.size else math.nan

    def bound(self, case: str, quantity: str) -> float:
        """Return the bound of a case, length [px] or angle [deg]: the largest error among the methods over its ratio.

        NaN where no method has an error.
        """
        metric = {"length": "length_error_px", "angle": "angle_error_deg"}[quantity]
        errors = {name: self.value(case, name, metric) for name in self.methods}
        known = {name: error for name, error in errors.items() if error > 0}
        if not known:
            return math.nan
        worst = max(known, key=known.get)
        return known[worst] / self.value(case, worst, f"{quantity}_error_to_bound_ratio") / MEDIAN_OVER_SD
