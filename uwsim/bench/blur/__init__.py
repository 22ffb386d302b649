"""Motion blur of rendered frames: length and angle of each frame in motion, and its blur from pixel to pixel.

What NEEDS may list:
  sharp    (H, W, 3) the momentary exposure at mid-exposure, in the linear units of the image, without noise

Truth is the median displacement of the picture during the exposure; the summary "uniform" is over the frames
in which all of the picture moves alike. A failure is an error above 2 px or 10 degrees, or no estimate, whatever the
verdict; `refused_percent` are the frames called other than blurred uniformly, `kept_failure_percent` the failures
among the rest. Beside it: errors over the Cramer-Rao bound (`uwsim.motion_blur.bound`), the error of the field over the
pixels (`field`), and tables by stratum.
"""

import math
from dataclasses import dataclass
from functools import cached_property, partial
from types import ModuleType

import numpy as np

from uwsim.bench.blur import estimates, field, strata
from uwsim.bench.blur.estimates import Truth, estimated
from uwsim.bench.restoration.inputs import makers as restoration_makers
from uwsim.bench.task import Case, Task, linear_buffer
from uwsim.dataset.frame import Frame
from uwsim.dataset.store import Dataset
from uwsim.motion_blur import estimators
from uwsim.motion_blur.bound import bound

__all__ = ["TASK", "case", "case_names", "estimated", "score"]

STATISTICS = estimates.STATISTICS | field.STATISTICS | {"milliseconds": "median"}


@dataclass(frozen=True)
class FrameTruth(Truth):
    """Blur of a rendered frame: its label, and the displacement of every pixel."""

    frame: Frame

    @cached_property
    def displacement_px(self) -> np.ndarray:
        """From start to end of the exposure, (H, W, 2), right and **up**."""
        flow = self.frame.buffer("flow_end") - self.frame.buffer("flow_start")
        return flow * np.array([1.0, -1.0])

    @cached_property
    def seen(self) -> np.ndarray:
        """Where a body is seen, (H, W) bool."""
        return self.frame.buffer("instance") > 0


def case_names(dataset: Dataset) -> list[str]:
    """Return the frames in motion; ValueError if there are none."""
    names = [frame.name for frame in dataset.frames if frame.info.blur is not None]
    if not names:
        raise ValueError(f"{dataset.folder}: blur needs a frame in motion, the dataset has none")
    return names


def case(dataset: Dataset, name: str) -> Case:
    frame = dataset.frame(name)
    blur = frame.info.blur
    truth = FrameTruth(blur.length_px, blur.angle_deg, partial(_bound, frame), frame)
    return Case(
        name=name, image=frame.image, makers={"sharp": partial(linear_buffer, frame, "sharp")}, truth=truth
    )  # fmt: skip


def _bound(frame: Frame) -> np.ndarray:
    """Return the bound of a frame as if its blur were the same everywhere; grey is the mean of three bands."""
    sharp, blur = linear_buffer(frame, "sharp"), frame.info.blur
    variance = np.square(restoration_makers(frame)["noise_std"](), dtype=float).mean(axis=(0, 1)).sum() / 9
    return bound(sharp, noise_std=math.sqrt(variance), length_px=blur.length_px, angle_deg=blur.angle_deg)


def score(module: ModuleType, name: str, given: tuple[str, ...], case: Case) -> dict[str, float | str]:
    estimate, elapsed_ms = estimated(module, name, given, case)
    found = estimates.scores(estimate, case.truth) | field.scores(module, name, case, estimate)
    return found | {"milliseconds": elapsed_ms}


def summaries(dataset: Dataset, cases: list[str]) -> dict[str, list[str]]:
    """Return the cases of "all", and of "uniform" where there are any."""
    uniform = [name for name in cases if dataset.frame(name).info.blur.uniform]
    return {"all": cases} | ({"uniform": uniform} if uniform else {})


def conditions(dataset: Dataset, cases: list[str]) -> dict[str, dict]:
    """Return what each case was like, and the bound on its length and angle."""
    return estimates.with_bounds(strata.conditions(dataset, cases), lambda name: case(dataset, name).truth)


TASK = Task(
    name="blur",
    package=estimators,
    function="estimate",
    inputs=("sharp",),
    statistics=STATISTICS,
    case_names=case_names,
    case=case,
    score=score,
    summaries=summaries,
    details=estimates.DETAILS,
    conditions=conditions,
    findings=strata.findings,
)
