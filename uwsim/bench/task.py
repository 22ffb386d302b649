"""What the three benchmarks share: the description of a task and of one of its cases."""

from collections.abc import Callable
from dataclasses import dataclass
from types import ModuleType

import numpy as np

from uwsim.bench.runner import Makers
from uwsim.camera import sensor_record
from uwsim.camera.sensor import linear_from_radiance
from uwsim.dataset.frame import Frame
from uwsim.dataset.store import Dataset


@dataclass(frozen=True)
class Case:
    """One thing to score: `makers` make the inputs that NEEDS may list, `truth` stays with the benchmark."""

    name: str
    image: np.ndarray
    makers: Makers
    truth: object
    summaries: tuple[str, ...] = ("all",)


@dataclass(frozen=True)
class Task:
    """A kind of algorithm and how it is scored.

    `package`: folder of the algorithms; `function`: what a file in it defines; `inputs`: what NEEDS may list;
    `statistics`: metric -> "median" or "mean" over the cases, in table order;
    `case_names(dataset)`: usable cases (ValueError if none); `case(dataset, name)`: one of them;
    `score(module, algorithm, given, case)` -> {metric: value}: NaN for no estimate, inf for identical images.
    """

    name: str
    package: ModuleType
    function: str
    inputs: tuple[str, ...]
    statistics: dict[str, str]
    case_names: Callable[[Dataset], list[str]]
    case: Callable[[Dataset, str], Case]
    score: Callable[[ModuleType, str, tuple[str, ...], Case], dict[str, float]]


def sensor_keywords(frame: Frame) -> dict:
    """Return the keywords of `camera.sensor`: of `linear_from_radiance`, `expose_without_noise` and the others."""
    camera = frame.info.camera
    return sensor_record.constants(
        frame.info.sensor.model_dump(), K=frame.K, width_px=camera.width_px, height_px=camera.height_px
    )


def linear_buffer(frame: Frame, name: str) -> np.ndarray:
    """Return a radiance buffer in the units of the decoded picture (1 = white), noise-free, not clipped."""
    return linear_from_radiance(frame.buffer(name), **sensor_keywords(frame))


def frame_of_case(case: str) -> str:
    """Return the frame's name of a case ("000003" or "000003/board")."""
    return case.partition("/")[0]


def spread(names: list[str], count: int) -> list[str]:
    """Return `count` of the names, evenly spread, in order."""
    if count >= len(names):
        return names
    return [names[index] for index in np.linspace(0, len(names) - 1, count).round().astype(int)]
