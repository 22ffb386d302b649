"""Poses by least reprojection error through a lens with its distortion and its port."""

import numpy as np

from uwsim.camera.lens import Lens
from uwsim.camera.port import Status
from uwsim.pose.batches import SAME_POSE
from uwsim.pose.checks import check_pixels, whitening_of
from uwsim.pose.solution import Solution, Twin, accept

_TOLERANCE = 1e-14
_UNSEEN_PX = 1e4  # stands for the error of a point that a pose takes out of the lens's sight


def refine(
    start: Solution, points_m: np.ndarray, pixels: np.ndarray, *, lens: Lens, covariance_px2: np.ndarray | None = None
) -> Solution:
    """Return camera_from_target that projects points (B, n, 3) [m] nearest to `pixels` (B, n, 2) [px], from `start`.

    Least squares over rotation vector and translation, of errors in pixels, or with `covariance_px2` (B, n, 2, 2) in
    their standard deviations; where `start` has no pose there is none. Exact for exact pixels. `cost` is the sum of
    these squares, and `information` (6, 6) belongs to them: `covariance(noise=1.0)` of the solution is that of the
    pose, given covariances of the points. ValueError for points, pixels and covariances of other shapes or with NaN,
    and for covariances that are not symmetric and positive definite.

    Source: Levenberg-Marquardt as in `scipy.optimize.least_squares`.
    """
    points_m, pixels, whitening = _checked(start, points_m, pixels, covariance_px2)
    rotation, translation_m = start.rotation.copy(), start.translation_m.copy()
    cost, information = np.full(len(pixels), np.nan), np.full((len(pixels), 6, 6), np.nan)
    for index in np.flatnonzero(start.ok):
        rotation[index], translation_m[index], cost[index], information[index] = _refined(
            rotation[index], translation_m[index], points_m[index], pixels[index], lens, whitening[index]
        )
    rotation[~start.ok] = np.nan
    found = accept(rotation, translation_m, points_m, status=start.status)
    return found._replace(cost=cost, information=information)


def least_refined(
    start: Solution, points_m: np.ndarray, pixels: np.ndarray, *, lens: Lens, covariance_px2: np.ndarray | None = None
) -> Solution:
    """Return `refine` from the pose of `start` and, where it has one, from its twin: the lower; the other as twin."""
    first = refine(start, points_m, pixels, lens=lens, covariance_px2=covariance_px2)
    if start.twin is None:
        return first
    has_twin = start.ok & np.all(np.isfinite(start.twin.translation_m), axis=1)
    rotation = np.where(has_twin[:, None, None], start.twin.rotation, np.eye(3))
    other = start._replace(rotation=rotation, translation_m=start.twin.translation_m.copy(), ok=has_twin)
    second = refine(other, points_m, pixels, lens=lens, covariance_px2=covariance_px2)
    lower = second.ok & ~(first.ok & (first.cost <= second.cost))
    chosen, left = (_chosen(use, second, first) for use in (lower, ~lower))
    apart = np.abs(chosen.rotation - left.rotation).max(axis=(1, 2)) > SAME_POSE
    real = first.ok & second.ok & apart
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(real, left.cost / chosen.cost, np.nan)
    twin = Twin(
        np.where(real[:, None, None], left.rotation, np.nan), np.where(real[:, None], left.translation_m, np.nan), ratio
    )
    return chosen._replace(twin=twin)


def _checked(
    start: Solution, points_m: np.ndarray, pixels: np.ndarray, covariance_px2: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return points and pixels as float64, and what makes errors [px] to uncorrelated ones of unit deviation."""
    points_m = np.asarray(points_m, float)
    if points_m.ndim != 3 or points_m.shape[2] != 3 or len(points_m) != len(start.ok):
        raise ValueError(f"refine: got points {points_m.shape}, allowed: ({len(start.ok)}, n, 3), as many as poses")
    if not np.all(np.isfinite(points_m)):
        raise ValueError(
            f"refine: points_m holds {np.sum(~np.isfinite(points_m))} NaN or infinite values, allowed: none"
        )
    pixels = check_pixels(pixels, (*points_m.shape[:2], 2), where="refine")
    wanted = (*pixels.shape, 2)
    if covariance_px2 is None:
        return points_m, pixels, np.broadcast_to(np.eye(2), wanted)
    return points_m, pixels, whitening_of(covariance_px2, wanted, name="covariance_px2", where="refine")


def _chosen(use: np.ndarray, one: Solution, other: Solution) -> Solution:
    """Return the poses of `one` where `use` (B,), else of `other`."""
    fields = ("rotation", "translation_m", "ok", "status", "cost", "information")
    pairs = {name: (getattr(one, name), getattr(other, name)) for name in fields}
    return other._replace(
        **{name: np.where(use.reshape(-1, *[1] * (a.ndim - 1)), a, b) for name, (a, b) in pairs.items()}
    )


def _refined(
    rotation: np.ndarray, translation_m: np.ndarray, points_m: np.ndarray, pixels: np.ndarray, lens: Lens,
    whitening: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, float, np.ndarray]:  # fmt: skip
    """Return rotation, translation [m], cost and information by turn [rad] and shift [m]."""
    from scipy.optimize import least_squares
    from scipy.spatial.transform import Rotation

    start = Rotation.from_matrix(rotation)
    # all six unknowns of the size of 1: turns about the camera's axes, shifts in shares of the distance
    distance_m = np.linalg.norm(translation_m)

    def pose(unknowns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        turn = Rotation.from_rotvec(unknowns[:3]) * start
        return turn.as_matrix(), translation_m + distance_m * unknowns[3:]

    def errors(unknowns: np.ndarray) -> np.ndarray:
        turn, shift_m = pose(unknowns)
        seen, status = lens.project(points_m @ turn.T + shift_m)
        off = np.where((status == Status.SEEN)[:, None], seen - pixels, _UNSEEN_PX)
        return (whitening @ off[..., None]).ravel()

    found = least_squares(
        errors, np.zeros(6), jac="3-point", method="lm", xtol=_TOLERANCE, ftol=_TOLERANCE, gtol=_TOLERANCE
    )
    slope = found.jac / np.array([1.0, 1.0, 1.0, *[distance_m] * 3])
    # by a turn of the pose found, not by the vector of the turn from the start
    slope[:, :3] = slope[:, :3] @ np.linalg.inv(_turn_by_vector(found.x[:3]))
    return *pose(found.x), float(2 * found.cost), slope.T @ slope


def _turn_by_vector(vector: np.ndarray) -> np.ndarray:
    """Return L (3, 3): exp[v + dv]x = exp[L dv]x exp[v]x for a small dv. Source: the left Jacobian of SO(3)."""
    angle = np.linalg.norm(vector)
    x, y, z = vector
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    if angle < 1e-4:
        return np.eye(3) + cross / 2
    first, second = (1 - np.cos(angle)) / angle**2, (angle - np.sin(angle)) / angle**3
    return np.eye(3) + first * cross + second * cross @ cross
