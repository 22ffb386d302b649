"""Expected errors of a marker layout seen by a camera, over distance, way off the axis and angle: to design layouts."""

from typing import NamedTuple

import numpy as np

from uwsim.pose import error_model, plane_errors
from uwsim.pose.bound import bound
from uwsim.pose.geometry import project, transform

STEPS = 41
_TURNS, _DIRECTIONS = 12, 8
_FARTHEST = 4.0  # the sweep of distances: from a quarter to four times the working distance
_FLAT_SHARE = 1e-6


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
    tilts_rad: np.ndarray
    rotation: np.ndarray
    translation_m: np.ndarray


class Curves(NamedTuple):
    """Errors (p,), root mean square over the orientations; NaN where in one of them the target leaves the picture.

    `bound`: the least possible. `segments`, `segments_printed`: of the segments from the target's origin (5.28, 5.29),
    each taken for an independent measurement of one angle, or of the distance, with the origin seen as a point is.
    `plane_printed`: 5.11-5.13, of the whole rotation of flat targets; `plane_corrected`: of those with four points.
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
    if not (np.isfinite(distance_m) and distance_m > 0):
        raise ValueError(f"distance: got {distance_m} m, allowed: above 0 m")
    if not 0 <= tilt_deg <= 90:
        raise ValueError(f"tilt: got {tilt_deg} deg, allowed: 0 to 90 deg")
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
    return Sweep(quantity, values, tilts_rad, rotation, np.stack([aside_m, np.zeros_like(aside_m), depth_m], axis=1))


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
        kept = sweep._replace(
            values=sweep.values[seen], tilts_rad=sweep.tilts_rad[seen], rotation=sweep.rotation[seen],
            translation_m=sweep.translation_m[seen],
        )  # fmt: skip
        for name, values in (_bounds(points_m, kept, view) | _formulas(points_m, kept, view)).items():
            found[name][seen] = values
    return Curves(**found)


def _bounds(points_m: np.ndarray, sweep: Sweep, view: View) -> dict[str, np.ndarray]:
    least = bound(points_m, *flattened(sweep), K=view.K, noise_px=view.noise_px)
    both = (part.reshape(len(sweep.values), -1) for part in (least.rotation_deg, least.translation_percent))
    rotation_deg, translation_percent = (np.sqrt(np.mean(part**2, axis=1)) for part in both)
    return {"rotation_bound_deg": rotation_deg, "translation_bound_percent": translation_percent}


def _formulas(points_m: np.ndarray, sweep: Sweep, view: View) -> dict[str, np.ndarray]:
    focal_px = np.sqrt(view.K[0, 0] * view.K[1, 1])
    found = {}
    apart_m = points_m[np.linalg.norm(points_m, axis=1) > 0]
    segments = error_model.segments(apart_m, *flattened(sweep))
    for form, end in (("corrected", ""), ("as_printed", "_printed")):
        length_m, angle_rad = error_model.errors(segments, noise=view.noise_px / focal_px, form=form)
        combined = [
            _combined(part, len(sweep.values)) for part in (np.degrees(angle_rad), length_m / segments.length_m)
        ]
        found |= {f"rotation_segments{end}_deg": combined[0], f"translation_segments{end}_percent": 100 * combined[1]}
    return found | _plane_formulas(points_m, sweep, noise_px=view.noise_px, focal_px=focal_px)


def _plane_formulas(points_m: np.ndarray, sweep: Sweep, *, noise_px: float, focal_px: float) -> dict[str, np.ndarray]:
    """Return what 5.11-5.13 say of a flat target; nothing of a solid one."""
    around_m = points_m - points_m.mean(axis=0)
    if np.linalg.matrix_rank(around_m, tol=_FLAT_SHARE * np.linalg.norm(around_m)) == 3:
        return {}
    # half the edge of the square that spreads as these points do
    arm_m = np.sqrt(np.sum(around_m**2) / (2 * len(points_m)))
    given = {"tilt_rad": sweep.tilts_rad, "distance_m": sweep.translation_m[:, 2], "arm_m": arm_m}
    given |= {"noise_px": noise_px, "focal_px": focal_px}
    printed = plane_errors.angle_errors(**given, form="as_printed")
    found = {"rotation_plane_printed_deg": np.degrees(printed.rotation_rad)}
    if len(points_m) == 4:
        found["rotation_plane_corrected_deg"] = np.degrees(plane_errors.angle_errors(**given).rotation_rad)
    return found


def _combined(deviation: np.ndarray, places: int) -> np.ndarray:
    """Return deviations (p,) of the weighted means over segments (p k, n), root mean square over the orientations."""
    with np.errstate(divide="ignore"):
        information = np.sum(deviation**-2.0, axis=1).reshape(places, -1)
        return np.sqrt(np.mean(1 / information, axis=1))
