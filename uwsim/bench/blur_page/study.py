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
        """Return the bound of a case, length [px] or angle [deg]; NaN for a frame that is sharp."""
        found = self.conditions[case][{"length": "length_bound_px", "angle": "angle_bound_deg"}[quantity]]
        return math.nan if found is None else found
