"""Calls of blur estimators, and the scores of one estimate: shared by rendered frames and by those made here."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from types import ModuleType
from typing import NamedTuple

import numpy as np

from uwsim.bench import runner
from uwsim.bench.task import Case
from uwsim.discovery import find
from uwsim.metrics import blur as blur_metrics
from uwsim.motion_blur import estimators
from uwsim.motion_blur.estimate import VERDICTS, Estimate

STATISTICS = {
    "failure_percent": "mean", "length_error_px": "median", "angle_error_deg": "median",
    "length_error_to_bound_ratio": "median", "angle_error_to_bound_ratio": "median", "refused_percent": "mean",
    "kept_failure_percent": "mean",
}  # fmt: skip
DETAILS = ("length_error_to_sd", "angle_error_to_sd")


class Refusal(NamedTuple):
    """In place of an Estimate: the method raised ValueError, one line that says why it has no answer to a picture."""

    reason: str
    length_px: float = math.nan
    angle_deg: float = math.nan


@dataclass(frozen=True)
class Truth:
    """Blur of a frame, and what makes the bound on the covariance of its length [px] and angle [deg], (2, 2)."""

    length_px: float
    angle_deg: float
    bound: Callable[[], np.ndarray]

    @cached_property
    def bound_sd(self) -> tuple[float, float]:
        """The bound on the standard deviations of length [px] and angle [deg]; NaN for a frame that is sharp."""
        return standard_deviations(self.bound()) if self.length_px > 0 else (math.nan, math.nan)


def with_bounds(conditions: dict[str, dict], truth_of: Callable[[str], Truth]) -> dict[str, dict]:
    """Return what each case was like, with the bound on its length and angle, None for a frame that is sharp."""
    found = {}
    for name, one in conditions.items():
        bounds = [float(f"{sd:.5g}") if math.isfinite(sd) else None for sd in truth_of(name).bound_sd]
        found[name] = one | dict(zip(("length_bound_px", "angle_bound_deg"), bounds, strict=True))
    return found


def estimated(module: ModuleType, name: str, given: tuple[str, ...], case: Case) -> tuple[object, float]:
    """Return (the Estimate of a method, or its Refusal; milliseconds of the call, NaN for a refusal)."""
    where = f"blur: {name}: case {case.name}"
    try:
        estimate, elapsed_ms = runner.image_call(
            module, name, "estimate", image=case.image, wanted=given, makers=case.makers, where=where
        )
    except ValueError as error:
        if not isinstance(error.__cause__, ValueError):
            raise
        return Refusal(" ".join(str(error.__cause__).split())), math.nan
    for key in ("length_px", "angle_deg"):
        try:
            float(getattr(estimate, key))
        except (AttributeError, TypeError, ValueError):
            raise ValueError(
                f"{where}: returned {estimate!r:.80}, allowed: an Estimate of numbers length_px, angle_deg"
            ) from None
    if getattr(estimate, "verdict", VERDICTS[0]) not in VERDICTS:
        raise ValueError(f"{where}: verdict {estimate.verdict!r}, allowed: {', '.join(VERDICTS)}")
    return estimate, elapsed_ms


@dataclass(frozen=True, kw_only=True)
class Told(Case):
    """A picture in motion for deconvolvers: its `label`, and what estimators say of it, kept by name."""

    label: Estimate
    estimates: dict[str, Estimate | Refusal] = field(default_factory=dict)

    def blur(self, estimator: str | None) -> Estimate:
        """Return what an estimator says of the picture, NotInFrame where it refuses; None: the label."""
        if estimator is None:
            return self.label
        if estimator not in self.estimates:
            self.estimates[estimator], _ = estimated(find(estimators, estimator), estimator, (), self)
        found = self.estimates[estimator]
        if isinstance(found, Refusal):
            raise runner.NotInFrame(f"{estimator}: {found.reason}")
        return found


def scores(estimate: object, truth: Truth) -> dict[str, float | str]:
    """Return STATISTICS and DETAILS of an estimate of a frame that is blurred.

    Length and angle count as they are, whatever the verdict: most methods have none. Beside them `refused_percent`, the
    share of the frames that are not said to be blurred uniformly, and `kept_failure_percent`, the failures among the
    others. A refusal by ValueError is a failure without errors. Errors over the method's own standard deviations are
    NaN where it gives none.
    """
    errors = (
        float(blur_metrics.length_error_px(estimate.length_px, truth.length_px)),
        float(blur_metrics.angle_error_deg(estimate.angle_deg, truth.angle_deg)),
    )
    to_bound = [float(blur_metrics.error_to_bound_ratio(*pair)) for pair in zip(errors, truth.bound_sd, strict=True)]
    to_sd = [float(blur_metrics.error_to_sd(*pair)) for pair in zip(errors, own_sd(estimate), strict=True)]
    note = {"note": estimate.reason} if isinstance(estimate, Refusal) else {}
    refused = bool(note) or getattr(estimate, "verdict", VERDICTS[0]) != VERDICTS[0]
    failure_percent = 100.0 * float(blur_metrics.blur_failure(*errors))
    return note | {
        "failure_percent": failure_percent,
        "length_error_px": errors[0],
        "angle_error_deg": errors[1],
        "length_error_to_bound_ratio": to_bound[0],
        "angle_error_to_bound_ratio": to_bound[1],
        "refused_percent": 100.0 * refused,
        "kept_failure_percent": math.nan if refused else failure_percent,
        "length_error_to_sd": to_sd[0],
        "angle_error_to_sd": to_sd[1],
    }


def own_sd(estimate: object) -> tuple[float, float]:
    """Return the standard deviations of length [px] and angle [deg] that a method states; NaN where it states none."""
    covariance = getattr(estimate, "covariance", None)
    return (math.nan, math.nan) if covariance is None else standard_deviations(covariance)


def standard_deviations(covariance: np.ndarray) -> tuple[float, float]:
    """Return the roots of the diagonal of a covariance (2, 2); NaN where it is not positive."""
    variances = np.diag(np.asarray(covariance, dtype=float))
    return tuple(math.sqrt(variance) if variance > 0 else math.nan for variance in variances)
