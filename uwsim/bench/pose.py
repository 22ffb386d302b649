"""Pose: where the camera stands to a body with markers, from the markers or spheres detected in each picture.

What NEEDS may list:
  pixels         the image points themselves, (B, n, 2) [px], pixel centres at integer + 0.5
  covariance_px2 the covariance of each of these, (B, n, 2, 2), as the detection states it
  lens           the camera's `uwsim.camera.lens.Lens`: its distortion, and the port in front of it
  true_points    the true image points of `points_m`, as `points`
  true_pixels    and as `pixels`
  true_pose      the pose itself, (B, 4, 4) camera_from_body

`points` are those of a pinhole (see `bench.task`): exact for a pinhole in the water and for a distorted lens, not so
behind a port, whose rays do not meet in one centre; a method for ports asks for `lens` and `pixels`.

A case is a body with at least one marker whose corners are all visible, or with four visible spheres ("000003/board"
where a frame shows several such bodies, else "000003"). A solver gets the corners of the detected markers or the
centres of the spheres, in the picture as it is or, in a variant, deblurred or restored, and told apart as
`uwsim.bench.pose_views` says; a solver that is given true places gets the visible ones of all instead, so what it
scores does not depend on detection. `detected_percent` counts the cases with a pose; the errors are over those.
"""

import math
from types import ModuleType

import numpy as np

from uwsim.bench import pose_strata, runner
from uwsim.bench.markers import whole_markers
from uwsim.bench.pose_views import LEAST_SPHERES, How, Points, View
from uwsim.bench.task import Case, Task, camera_notes, frame_of_case, lens_of
from uwsim.dataset.info import FrameInfo
from uwsim.dataset.store import Dataset
from uwsim.metrics import pose as pose_metrics
from uwsim.pose import solvers

STATISTICS = {
    "detected_percent": "mean", "rotation_error_deg": "median", "translation_error_percent": "median",
    "corner_error_px": "median", "points_found_percent": "mean", "points_right_percent": "mean",
    "points_covered_percent": "mean", "milliseconds": "median",
}  # fmt: skip
FURTHER = ("points_found_percent", "points_right_percent", "points_covered_percent")
_COVERED = 4.605
"""Square of the distance, in standard deviations, within which 90 % of errors in two dimensions lie."""


def bodies_in_view(info: FrameInfo) -> list[str]:
    """Return the bodies of which a marker is visible with all its corners, or four spheres are."""
    shown = [point.body for point in info.points if point.kind == "sphere" and point.visible]
    with_spheres = {body for body in shown if shown.count(body) >= LEAST_SPHERES}
    return sorted({marker.body for marker in whole_markers(info)} | with_spheres)


def case_names(dataset: Dataset) -> list[str]:
    """Return the cases of the dataset; ValueError if there are none."""
    names = []
    for frame in dataset.frames:
        bodies = bodies_in_view(frame.info)
        names += [frame.name] if len(bodies) == 1 else [f"{frame.name}/{body}" for body in bodies]
    if not names:
        raise ValueError(
            f"{dataset.folder}: pose needs a frame with a visible marker or four spheres, the dataset has none"
        )
    return names


def case(dataset: Dataset, name: str) -> Case:
    frame = dataset.frame(frame_of_case(name))
    body = name.partition("/")[2] or bodies_in_view(frame.info)[0]
    view = View(frame=frame, body=body)
    return Case(name=name, image=frame.image, makers={}, truth=view)


def how_of(module: ModuleType) -> How:
    """Return what pictures pass before detection in this variant."""
    return How(
        restored_by=getattr(module, "RESTORED_BY", None), deblurred_by=getattr(module, "DEBLURRED_BY", None),
        blur_from=getattr(module, "BLUR_FROM", None), labels=getattr(module, "LABELS", "truth"),
    )  # fmt: skip


def points_for(given: tuple[str, ...], view: View, how: How = How()) -> Points:  # noqa: B008 (a tuple)
    """Return the points that a solver works on."""
    return view.visible if set(given) & {"true_points", "true_pixels"} else view.found(how)


def makers(points: Points, view: View) -> runner.Makers:
    """Return what a solver may ask for beside the points that it works on."""
    return {
        "pixels": lambda: points.image_px[None],
        "covariance_px2": lambda: points.covariance_px2[None],
        "lens": lambda: lens_of(view.frame),
        "true_points": lambda: view.normalised(points.true_px)[None],
        "true_pixels": lambda: points.true_px[None],
        "true_pose": lambda: view.camera_from_body[None],
    }


def solved(module: ModuleType, name: str, given: tuple[str, ...], case: Case) -> tuple[np.ndarray | None, float]:
    """Return (camera_from_body (4, 4), None where no pose could be estimated; milliseconds of the call)."""
    where = f"pose: {name}: case {case.name}"
    points = points_for(given, case.truth, how_of(module))
    if len(points.body_m) < getattr(module, "MINIMUM_POINTS", 4):
        return None, math.nan
    solution, elapsed_ms = runner.timed(
        runner.entry(module, name, "solve"), points.body_m[None].copy(),
        case.truth.normalised(points.image_px)[None], where=where,
        **runner.permitted(given, makers(points, case.truth)),
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
    points = points_for(given, case.truth, how_of(module))
    scores = dict.fromkeys(STATISTICS, math.nan)
    scores |= {"detected_percent": 0.0 if pose is None else 100.0, "milliseconds": elapsed_ms}
    scores |= point_scores(points, case.truth)
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


def point_scores(points: Points, view: View) -> dict[str, float]:
    """Return how near the points are to their places, how many are found, and are in their 90 % ellipses."""
    known = np.all(np.isfinite(points.true_px), axis=1)
    found = 100.0 * min(len(points.body_m) / max(len(view.visible.body_m), 1), 1.0)
    if points is view.visible or not known.any():
        scores = {"points_found_percent": math.nan if points is view.visible else found}
        return scores | ({"corner_error_px": 0.0} if points is view.visible and known.any() else {})
    errors_px = pose_metrics.corner_error_px(points.image_px[known], points.true_px[known])
    return {
        "corner_error_px": float(np.mean(errors_px)),
        "points_found_percent": found,
        "points_right_percent": points.right,
        "points_covered_percent": 100.0 * float(np.mean(points.squares[known] <= _COVERED)),
    }


TASK = Task(
    name="pose",
    package=solvers,
    function="solve",
    inputs=("pixels", "covariance_px2", "lens", "true_points", "true_pixels", "true_pose"),
    statistics=STATISTICS,
    case_names=case_names,
    case=case,
    score=score,
    notes=camera_notes,
    conditions=pose_strata.conditions,
    further=FURTHER,
    findings=pose_strata.findings,
)
