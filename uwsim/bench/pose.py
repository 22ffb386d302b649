"""Pose: where the camera stands to a body with markers, from the markers detected in each picture.

What NEEDS may list:
  pixels         the image points themselves, (B, n, 2) [px], pixel centres at integer + 0.5
  lens           the camera's `uwsim.camera.lens.Lens`: its distortion, and the port in front of it
  true_points    the true image points of `points_m`, as `points`
  true_pixels    and as `pixels`
  true_pose      the pose itself, (B, 4, 4) camera_from_body

`points` are those of a pinhole (see `bench.task`): exact for a pinhole in the water and for a distorted lens, not so
behind a port, whose rays do not meet in one centre; a method for ports asks for `lens` and `pixels`.

A case is a body with at least one marker whose corners are all visible ("000003/board" where a frame shows
several such bodies, else "000003"). A solver gets the corners of the detected markers; a solver that is given true
places gets the visible corners of all markers instead, so what it scores does not depend on detection.
`detected_percent` counts the cases with a pose; the errors are over those.
"""

import math
from dataclasses import dataclass
from functools import cached_property
from types import ModuleType

import numpy as np

from uwsim.bench import runner
from uwsim.bench.markers import camera_from_body, found_markers, whole_markers
from uwsim.bench.task import Case, Task, camera_notes, frame_of_case, lens_of, pinhole_points
from uwsim.camera.lens import Lens
from uwsim.dataset.frame import Frame
from uwsim.dataset.info import FrameInfo
from uwsim.dataset.store import Dataset
from uwsim.metrics import pose as pose_metrics
from uwsim.pose import solvers

STATISTICS = {
    "detected_percent": "mean", "rotation_error_deg": "median", "translation_error_percent": "median",
    "corner_error_px": "median", "milliseconds": "median",
}  # fmt: skip


@dataclass(frozen=True)
class Points:
    """Corners of markers: in the body's frame (n, 3) [m], in the image and their true places (n, 2) [px]."""

    body_m: np.ndarray
    image_px: np.ndarray
    true_px: np.ndarray


@dataclass(frozen=True)
class View:
    """A body with markers in one frame, with its true pose; markers are detected when first asked for."""

    frame: Frame
    body: str

    @cached_property
    def lens(self) -> Lens:
        return lens_of(self.frame)

    @cached_property
    def camera_from_body(self) -> np.ndarray:
        """Return the true pose at mid-exposure, (4, 4) [m]."""
        return camera_from_body(self.frame, self.body)

    @cached_property
    def detected(self) -> Points:
        """Corners of the detected markers; `true_px` is NaN where a marker has a corner behind the camera."""
        markers = self._markers()
        found = found_markers(self.frame.image, markers)
        seen = [marker for marker in markers if (marker.dictionary, marker.id) in found]
        found_px = [found[marker.dictionary, marker.id] for marker in seen]
        has_rays = [bool(np.all(np.isfinite(self.normalised(corners)))) for corners in found_px]
        seen = [marker for marker, has_ray in zip(seen, has_rays, strict=True) if has_ray]
        return _points(
            [marker.corners_body_m for marker in seen],
            [found[marker.dictionary, marker.id] for marker in seen],
            [marker.corners_px or np.full((4, 2), np.nan) for marker in seen],
        )

    @cached_property
    def visible(self) -> Points:
        """The visible corners of all markers, at their true places."""
        markers = [marker for marker in self._markers() if any(marker.visible)]
        shown = [np.array(marker.visible) for marker in markers]
        body = [np.array(marker.corners_body_m)[keep] for marker, keep in zip(markers, shown, strict=True)]
        true = [np.array(marker.corners_px)[keep] for marker, keep in zip(markers, shown, strict=True)]
        return _points(body, true, true)

    def normalised(self, points_px: np.ndarray) -> np.ndarray:
        """Return pixels (n, 2) as points on the plane z = 1 of the pinhole that the camera is taken for."""
        return pinhole_points(points_px, self.lens)

    def _markers(self) -> list:
        return [marker for marker in self.frame.info.markers if marker.body == self.body]


def _points(body_m: list, image_px: list, true_px: list) -> Points:
    def stack(parts: list, columns: int) -> np.ndarray:
        return np.concatenate([np.asarray(part, float).reshape(-1, columns) for part in [*parts, []]])

    return Points(body_m=stack(body_m, 3), image_px=stack(image_px, 2), true_px=stack(true_px, 2))


def bodies_in_view(info: FrameInfo) -> list[str]:
    """Return the bodies of which at least one marker is visible with all its corners."""
    return sorted({marker.body for marker in whole_markers(info)})


def case_names(dataset: Dataset) -> list[str]:
    """Return the cases of the dataset; ValueError if there are none."""
    names = []
    for frame in dataset.frames:
        bodies = bodies_in_view(frame.info)
        names += [frame.name] if len(bodies) == 1 else [f"{frame.name}/{body}" for body in bodies]
    if not names:
        raise ValueError(f"{dataset.folder}: pose needs a frame with a visible marker, the dataset has none")
    return names


def case(dataset: Dataset, name: str) -> Case:
    frame = dataset.frame(frame_of_case(name))
    body = name.partition("/")[2] or bodies_in_view(frame.info)[0]
    view = View(frame=frame, body=body)
    return Case(name=name, image=frame.image, makers={}, truth=view)


def points_for(given: tuple[str, ...], view: View) -> Points:
    """Return the corners that a solver works on."""
    return view.visible if set(given) & {"true_points", "true_pixels"} else view.detected


def makers(given: tuple[str, ...], view: View) -> runner.Makers:
    """Return what a solver may ask for beside the points that it works on."""
    points = points_for(given, view)
    return {
        "pixels": lambda: points.image_px[None],
        "lens": lambda: lens_of(view.frame),
        "true_points": lambda: view.normalised(points.true_px)[None],
        "true_pixels": lambda: points.true_px[None],
        "true_pose": lambda: view.camera_from_body[None],
    }


def solved(module: ModuleType, name: str, given: tuple[str, ...], case: Case) -> tuple[np.ndarray | None, float]:
    """Return (camera_from_body (4, 4), None where no pose could be estimated; milliseconds of the call)."""
    where = f"pose: {name}: case {case.name}"
    points = points_for(given, case.truth)
    if len(points.body_m) < getattr(module, "MINIMUM_POINTS", 4):
        return None, math.nan
    solution, elapsed_ms = runner.timed(
        runner.entry(module, name, "solve"), points.body_m[None].copy(),
        case.truth.normalised(points.image_px)[None], where=where,
        **runner.permitted(given, makers(given, case.truth)),
    )  # fmt: skip
    return _pose(solution, where), elapsed_ms


def _pose(solution: object, where: str) -> np.ndarray | None:
    try:
        ok = bool(np.asarray(solution.ok).reshape(1)[0])
        rotation = np.asarray(solution.rotation, float).reshape(3, 3)
        translation = np.asarray(solution.translation_m, float).reshape(3)
    except (AttributeError, TypeError, ValueError) as error:
        raise ValueError(
            f"{where}: returned no Solution of rotation (1, 3, 3), translation_m (1, 3), ok (1,): {error}"
        ) from None
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation, translation
    return pose if ok and np.all(np.isfinite(pose)) else None


def score(module: ModuleType, name: str, given: tuple[str, ...], case: Case) -> dict[str, float]:
    pose, elapsed_ms = solved(module, name, given, case)
    points = points_for(given, case.truth)
    scores = dict.fromkeys(STATISTICS, math.nan)
    scores |= {"detected_percent": 0.0 if pose is None else 100.0, "milliseconds": elapsed_ms}
    if len(points.body_m):
        scores["corner_error_px"] = float(np.nanmean(pose_metrics.corner_error_px(points.image_px, points.true_px)))
    if pose is None:
        return scores
    true = case.truth.camera_from_body
    try:
        rotation_error_deg = float(pose_metrics.rotation_error_deg(pose[:3, :3], true[:3, :3]))
    except ValueError as error:
        raise ValueError(f"pose: {name}: case {case.name}: {error}") from None
    translation_error_percent = float(pose_metrics.translation_error_percent(pose[:3, 3], true[:3, 3]))
    return scores | {
        "rotation_error_deg": rotation_error_deg, "translation_error_percent": translation_error_percent
    }  # fmt: skip


TASK = Task(
    name="pose",
    package=solvers,
    function="solve",
    inputs=("pixels", "lens", "true_points", "true_pixels", "true_pose"),
    statistics=STATISTICS,
    case_names=case_names,
    case=case,
    score=score,
    notes=camera_notes,
)
