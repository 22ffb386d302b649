"""What the benchmarks share: the description of a task and of one of its cases, and the camera as methods get it.

A method that does not know of lenses and ports is given the pinhole that a user would take the camera for: undistorted,
and behind a port with the effective focal length in water, next to the axis and far away. `camera_notes` says so.
"""

from collections.abc import Callable
from dataclasses import dataclass
from types import ModuleType

import numpy as np

from uwsim.bench.kept import Scores
from uwsim.bench.runner import Makers
from uwsim.camera import distortion, sensor_record
from uwsim.camera.lens import Lens, lens_from_record
from uwsim.camera.port import effective_focal_px
from uwsim.camera.sensor import expose_without_noise, linear_from_radiance
from uwsim.dataset.frame import Frame
from uwsim.dataset.store import Dataset

_NAMED_FRAMES = 3
"""Of more, the first so many are named."""


@dataclass(frozen=True)
class Case:
    """One thing to score: `makers` make the inputs that NEEDS may list, `truth` stays with the benchmark."""

    name: str
    image: np.ndarray
    makers: Makers
    truth: object


@dataclass(frozen=True)
class Task:
    """A kind of algorithm and how it is scored.

    `package`: folder of the algorithms; `function`: what a file in it defines; `inputs`: what NEEDS may list;
    `statistics`: metric -> "median" or "mean" over the cases, in table order;
    `case_names(dataset)`: usable cases (ValueError if none); `case(dataset, name)`: one of them;
    `score(module, algorithm, given, case)` -> {metric: value}: NaN for no estimate, inf for identical images; and
    `note`, a text, where there is something to know beside the numbers;
    `notes(dataset, cases)`: what to know about the cases beside the numbers, in sentences;
    `details`: metrics that only the cases have, no summary; `conditions(dataset, cases)` -> {case: what it was like};
    `summaries(dataset, cases)` -> {summary: its cases}, "all" first;
    `further`: metrics of `statistics` that stand in a second table, so that the first stays readable;
    `relate(scores, do_nothing, oracle)` -> the scores of a case by algorithm with the metrics `relative` added, which
    compare algorithms with each other: where the benchmark has an oracle, else there are none of these;
    `findings(dataset, scores)` -> {name: {"caption", "head", "rows"}}: small tables over all cases, {case: scores by
    algorithm}, that go into the provenance and below the tables; a cell is a text, a number or None;
    `frames(protocol, quick)` -> what stands for the dataset in a task that makes its own cases; it has `name`, `seed`
    and `sha256`, as a dataset has.
    """

    name: str
    package: ModuleType
    function: str
    inputs: tuple[str, ...]
    statistics: dict[str, str]
    case_names: Callable[[Dataset], list[str]]
    case: Callable[[Dataset, str], Case]
    score: Callable[[ModuleType, str, tuple[str, ...], Case], dict[str, float]]
    notes: Callable[[Dataset, list[str]], list[str]] = lambda dataset, cases: []
    details: tuple[str, ...] = ()
    conditions: Callable[[Dataset, list[str]], dict[str, dict]] = lambda dataset, cases: {}
    summaries: Callable[[Dataset, list[str]], dict[str, list[str]]] = lambda dataset, cases: {"all": cases}
    further: tuple[str, ...] = ()
    relate: Callable[[Scores, str, str], Scores] = lambda scores, do_nothing, oracle: scores
    relative: tuple[str, ...] = ()
    findings: Callable[[Dataset, dict[str, Scores]], dict[str, dict]] = lambda dataset, scores: {}
    frames: Callable[..., object] | None = None


def sensor_keywords(frame: Frame) -> dict:
    """Return the keywords of `camera.sensor`: of `linear_from_radiance`, `expose_without_noise` and the others."""
    camera = frame.info.camera
    return sensor_record.constants(
        frame.info.sensor.model_dump(), K=frame.K, width_px=camera.width_px, height_px=camera.height_px
    )


def linear_buffer(frame: Frame, name: str) -> np.ndarray:
    """Return a radiance buffer in the units of the decoded picture (1 = white), noise-free, not clipped."""
    return linear_from_radiance(frame.buffer(name), **sensor_keywords(frame))


def through_camera(frame: Frame, name: str) -> np.ndarray:
    """Return a radiance buffer as the frame's camera would store it without noise, (H, W, 3) uint8."""
    return expose_without_noise(np.maximum(frame.buffer(name), 0), **sensor_keywords(frame))


def lens_of(frame: Frame) -> Lens:
    """Return the frame's lens: its distortion, and the port in front of it."""
    return lens_from_record(frame.info.camera.model_dump())


def pinhole_scale(lens: Lens) -> float:
    """Return the focal length of the pinhole in water that a lens is taken for, over its own in air."""
    return 1.0 if lens.port is None else float(effective_focal_px(np.inf, port=lens.port, focal_px=1.0))


def pinhole_K(lens: Lens) -> np.ndarray:
    """Return K (3, 3) of the pinhole in water that a lens is taken for. [px]"""
    return lens.K @ np.diag([pinhole_scale(lens), pinhole_scale(lens), 1.0])


def pinhole_points(points_px: np.ndarray, lens: Lens) -> np.ndarray:
    """Return pixels (n, 2) as points on the plane z = 1 of that pinhole, undistorted; NaN where the lens has no ray."""
    directions = distortion.directions(points_px, lens.K, coefficients=lens.coefficients)
    return directions[..., :2] / directions[..., 2:] / pinhole_scale(lens)


def camera_notes(dataset: Dataset, cases: list[str]) -> list[str]:
    """Return in sentences what methods were given instead of the cameras that are no plain pinholes."""
    frames: dict[str, list[str]] = {}
    for name in dict.fromkeys(frame_of_case(case) for case in cases):
        for text in _camera_texts(dataset.frame(name)):
            frames.setdefault(text, []).append(name)
    return [f"{text} ({_frames(names)})" for text, names in frames.items()]


def _frames(names: list[str]) -> str:
    named = ", ".join(names[:_NAMED_FRAMES])
    return f"frames {named}" if len(names) <= _NAMED_FRAMES else f"{len(names)} frames: {named} ..."


def _camera_texts(frame: Frame) -> list[str]:
    camera, lens, found = frame.info.camera, lens_of(frame), []
    if lens.port is not None:
        water_px, air_px = pinhole_K(lens)[0, 0], lens.K[0, 0]
        found.append(
            f"camera behind a {camera.port.kind} port: methods that are not given the lens get the pinhole in water of "
            f"its effective focal length, {water_px:.1f} px (in air {air_px:.1f} px), which is not quite its geometry"
        )
    if lens.is_distorted:
        found.append("lens distortion: methods that are not given the lens get undistorted points, but no such picture")
    if camera.readout_s > 0:
        found.append(f"rolling shutter of {camera.readout_s:g} s: methods get points as seen, each in its row's time")
    return found


def frame_of_case(case: str) -> str:
    """Return the frame's name of a case ("000003" or "000003/board")."""
    return case.partition("/")[0]


def spread(names: list[str], count: int) -> list[str]:
    """Return `count` of the names, evenly spread, in order."""
    if count >= len(names):
        return names
    return [names[index] for index in np.linspace(0, len(names) - 1, count).round().astype(int)]
