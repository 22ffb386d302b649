"""Expected errors of a marker layout seen by a camera, over distance, way off the axis and angle: to design layouts."""

from typing import NamedTuple

import numpy as np

from uwsim.pose import error_model, limits, plane_errors
from uwsim.pose.bound import bound
from uwsim.pose.geometry import project, transform

STEPS = 41
_TURNS, _DIRECTIONS = 12, 8
_FARTHEST = 4.0  # the sweep of distances: from a quarter to four times the working distance
_SAME_SHARE = 1e-6


class View(NamedTuple):
    """What looks at the target: `K` (3, 3) [px] of the pinhole in the water, its picture, and the noise of points."""

    K: np.ndarray
    width_px: int
    height_px: int
    noise_px: float


class Sweep(NamedTuple):
    """Poses along one quantity: `values` (p,), rotation (p, k, 3, 3), translation_m (p, 3); k orientations each."""

    quantity: str
    values: np.ndarray
    rotation: np.ndarray
    translation_m: np.ndarray


class Curves(NamedTuple):
    """Errors (p,), root mean square over the orientations; NaN where in one of them the target leaves the picture.

    `bound`: the least possible. `segments`, `segments_printed`: of the segments from the points' centroid (5.28, 5.29),
    each taken for an independent measurement of one angle, or of the centroid's distance, with the centroid seen as a
    point is. The target's origin might be anywhere, and its image is no measurement.
    `plane_corrected`, `plane_printed`: 5.11-5.13, of the whole rotation of a square; NaN for the layouts of `left_out`.
    """

    rotation_bound_deg: np.ndarray
    rotation_segments_deg: np.ndarray
    rotation_segments_printed_deg: np.ndarray
    rotation_plane_corrected_deg: np.ndarray
    rotation_plane_printed_deg: np.ndarray
    translation_bound_percent: np.ndarray
    translation_segments_percent: np.ndarray
    translation_segments_printed_percent: np.ndarray


def sweeps(view: View, *, distance_m: float, tilt_deg: float, steps: int = STEPS) -> list[Sweep]:
    """Return the sweeps: depth of the origin on the axis, its way off the axis, and tilt of the target's z-axis.

    Each leaves the other two at `distance_m`, 0 and `tilt_deg`. Orientations: the target turned about its own z, then
    tilted towards directions all around. ValueError for a distance or a tilt out of range.
    """
    limits.DISTANCE_M.check(distance_m, name="distance_m")
    limits.TILT_DEG.check(tilt_deg, name="tilt_deg")
    depth_m = np.geomspace(distance_m / _FARTHEST, distance_m * _FARTHEST, steps)
    aside_m = np.linspace(0, (view.width_px - view.K[0, 2]) / view.K[0, 0] * distance_m, steps)
    tilts = np.linspace(0, np.pi / 2, steps)
    fixed, none, here = np.full(steps, np.radians(tilt_deg)), np.zeros(steps), np.full(steps, float(distance_m))
    return [
        _sweep("distance_m", depth_m, fixed, none, depth_m),
        _sweep("off_axis_m", aside_m, fixed, aside_m, here),
        _sweep("tilt_deg", np.degrees(tilts), tilts, none, here),
    ]


def _sweep(quantity: str, values: np.ndarray, tilts_rad: np.ndarray, aside_m: np.ndarray, depth_m: np.ndarray) -> Sweep:
    from scipy.spatial.transform import Rotation

    turns = 2 * np.pi * np.arange(_TURNS) / _TURNS
    directions = 2 * np.pi * np.arange(_DIRECTIONS) / _DIRECTIONS
    angles = np.array([(d, t, turn) for t in tilts_rad for d in directions for turn in turns])
    rotation = Rotation.from_euler("ZYZ", angles).as_matrix().reshape(len(values), -1, 3, 3)
    return Sweep(quantity, values, rotation, np.stack([aside_m, np.zeros_like(aside_m), depth_m], axis=1))


def flattened(sweep: Sweep) -> tuple[np.ndarray, np.ndarray]:
    """Return all poses of a sweep: rotations (p k, 3, 3) and translations (p k, 3) [m]."""
    each = sweep.rotation.shape[1]
    return sweep.rotation.reshape(-1, 3, 3), np.repeat(sweep.translation_m, each, axis=0)


def in_picture(points_m: np.ndarray, sweep: Sweep, view: View) -> np.ndarray:
    """Return at which places (p,) all points (n, 3) [m] are seen in all orientations; no point hides another."""
    pixels = project(transform(*flattened(sweep), points_m), view.K)
    with np.errstate(invalid="ignore"):
        inside = np.all((pixels >= 0) & (pixels <= [view.width_px, view.height_px]), axis=(1, 2))
    return np.all(inside.reshape(len(sweep.values), -1), axis=1)


def curves(points_m: np.ndarray, sweep: Sweep, view: View) -> Curves:
    """Return the expected errors of points (n, 3) [m] along a sweep."""
    seen = in_picture(points_m, sweep, view)
    found = {name: np.full(len(seen), np.nan) for name in Curves._fields}
    if seen.any():
        kept = Sweep(sweep.quantity, sweep.values[seen], sweep.rotation[seen], sweep.translation_m[seen])
        for name, values in (_bounds(points_m, kept, view) | _formulas(points_m, kept, view)).items():
            found[name][seen] = values
    return Curves(**found)


def left_out(points_m: np.ndarray) -> dict[str, str]:
    """Return the curves that do not hold for points (n, 3) [m], and why."""
    if plane_errors.square_of(points_m) is not None:
        return {}
    why = "the layout is no square of four points"
    return dict.fromkeys(("rotation_plane_corrected_deg", "rotation_plane_printed_deg"), why)


def _bounds(points_m: np.ndarray, sweep: Sweep, view: View) -> dict[str, np.ndarray]:
    least = bound(points_m, *flattened(sweep), K=view.K, noise_px=view.noise_px)
    both = (part.reshape(len(sweep.values), -1) for part in (least.rotation_deg, least.translation_percent))
    rotation_deg, translation_percent = (np.sqrt(np.mean(part**2, axis=1)) for part in both)
    return {"rotation_bound_deg": rotation_deg, "translation_bound_percent": translation_percent}


def _formulas(points_m: np.ndarray, sweep: Sweep, view: View) -> dict[str, np.ndarray]:
    focal_px, places = np.sqrt(view.K[0, 0] * view.K[1, 1]), len(sweep.values)
    rotation, translation_m = flattened(sweep)
    centre_m = points_m.mean(axis=0)
    around_m = points_m - centre_m
    away_m = np.linalg.norm(around_m, axis=1)
    apart_m = around_m[away_m > _SAME_SHARE * away_m.max()]
    segments = error_model.segments(apart_m, rotation, rotation @ centre_m + translation_m)
    square = plane_errors.square_of(points_m)
    found = {}
    for form, end in (("corrected", ""), ("as_printed", "_printed")):
        length_m, angle_rad = error_model.errors(segments, noise=view.noise_px / focal_px, form=form)
        found[f"rotation_segments{end}_deg"] = _combined(np.degrees(angle_rad), places)
        found[f"translation_segments{end}_percent"] = _combined(100 * length_m / segments.length_m, places)
        if square is not None:
            given = {"noise_px": view.noise_px, "focal_px": focal_px, "form": form}
            turn_rad = plane_errors.square_errors(square, rotation, translation_m, **given).rotation_rad
            name = f"rotation_plane{end or '_corrected'}_deg"
            found[name] = np.degrees(np.sqrt(np.mean(turn_rad.reshape(places, -1) ** 2, axis=1)))
    return found


def _combined(deviation: np.ndarray, places: int) -> np.ndarray:
    """Return deviations (p,) of the weighted means over segments (p k, n), root mean square over the orientations."""
    with np.errstate(divide="ignore"):
        information = np.sum(deviation**-2.0, axis=1).reshape(places, -1)
        return np.sqrt(np.mean(1 / information, axis=1))
