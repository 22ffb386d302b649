"""What a pose solver returns, and the check of what it is given."""

from enum import IntEnum
from typing import NamedTuple

import numpy as np

from uwsim.pose.reprojection import cost_and_information

LINE_SHARE = 1e-4
"""Spread of points off a line, as a share of their extent, below which they count as on it: no camera sees less."""
# fourth powers of an image point still count, and so do squares of a place
_MOST = 1e75
# an information matrix with a smaller ratio of its eigenvalues leaves part of the pose open
_UNDETERMINED = 1e-14


class Status(IntEnum):
    """Why a problem has a pose or none.

    OK does not say that the pose fits the image: it is what the method found, for most a minimum of its error, with all
    points before the camera. Points with wrong names, an outlier, a method that ended in another minimum are OK as
    well. Whether it fits, `Solution.cost` says: for noise of standard deviation s of each coordinate on the plane z = 1
    (pixels by focal length) cost / s^2 is chi-squared of `Solution.freedom` degrees at the pose of least cost, so a
    cost above s^2 `scipy.stats.chi2.ppf(0.999, freedom)` is not that noise's. Where the noise is not known,
    sqrt(cost / freedom) times the focal length, in pixels, is what it would have to be. Of two poses that both fit,
    `Solution.twin` has the other.
    """

    OK = 0
    """A rotation, and a translation that puts all points before the camera."""
    DEGENERATE = 1
    """Target points on one line, to 1e-4 of their extent, or, for solvers of four and more points, fewer than four
    different; or images in one point: more than one pose fits."""
    WRONG_KIND = 2
    """A flat target for a solver of solid ones, or the other way round."""
    NO_POSE = 3
    """The solver found no rotation and translation, or one whose error is not finite."""
    BEHIND = 4
    """Its pose takes points behind the camera."""


class Twin(NamedTuple):
    """The other pose that the image of a flat or nearly flat target fits: a second minimum of the reprojection error.

    `rotation` (B, 3, 3), `translation_m` (B, 3) [m], `cost_ratio` (B,): its cost by that of the pose returned. All NaN
    where there is none. A ratio near 1 says that the image does not tell the two apart.
    """

    rotation: np.ndarray
    translation_m: np.ndarray
    cost_ratio: np.ndarray


class Solution(NamedTuple):
    """Poses camera_from_target of a batch: p_camera = rotation @ p_target + translation_m.

    `rotation` (B, 3, 3), `translation_m` (B, 3) [m], `ok` (B,) bool. Where `ok` is False there is no pose:
    rotation is the identity and the translation NaN, and `status` (B,) of `Status` says why. `cost` (B,): sum of the
    squared reprojection errors on the plane z = 1. `information` (B, 6, 6): J^T J of those errors, by a turn [rad]
    about the axes of the camera (rotation' = exp[turn]x rotation) and then a shift [m] of `translation_m`.
    `freedom`: residuals less unknowns, 2 n - 6. `twin`: for flat and nearly flat targets, from solvers that look for
    it. What a method does not know is None.

    `ok` is not a fit: compare `cost` with the noise, as `Status` says how.
    """

    rotation: np.ndarray
    translation_m: np.ndarray
    ok: np.ndarray
    status: np.ndarray
    cost: np.ndarray | None = None
    information: np.ndarray | None = None
    freedom: int = 0
    twin: Twin | None = None

    def covariance(self, *, noise: float | np.ndarray | None = None) -> np.ndarray:
        """Return the covariance (B, 6, 6) of turn [rad] and shift [m]: noise^2 information^-1.

        `noise`: standard deviation of each image coordinate on the plane z = 1 (pixels by focal length), a number or
        (B,); None estimates it from the cost, which for few points is uncertain by a factor. NaN without a pose, and
        infinite on the diagonal where the points leave part of the pose open.

        Valid: for the pose of least reprojection error, to first order in the noise; any other solver's scatters more.
        ValueError where the method gave no information, without spare residuals to estimate the noise from, and for a
        noise that is none.
        """
        if self.information is None:
            raise ValueError("covariance: the method gives no information matrix, allowed: one with image points")
        if noise is None and self.freedom <= 0:
            raise ValueError("covariance: 3 points leave no residuals, allowed: a given noise, or 4 points and more")
        variance = self.cost / self.freedom if noise is None else _noise_of_each(noise, len(self.ok)) ** 2
        return variance[:, None, None] * _inverse(self.information, self.translation_m)


def _noise_of_each(noise: float | np.ndarray, count: int) -> np.ndarray:
    """Return standard deviations (count,) of a number or (count,); ValueError for what is none."""
    try:
        given = np.asarray(noise, float)
    except (TypeError, ValueError):
        raise ValueError(f"covariance: noise is {noise!r}, allowed: a number, or one of each problem") from None
    if given.shape not in ((), (count,)):
        raise ValueError(f"covariance: noise has shape {given.shape}, allowed: a number or ({count},)")
    fine = np.isfinite(given) & (given >= 0)
    if not np.all(fine):
        raise ValueError(f"covariance: noise is {given[~fine].flat[0]:g}, allowed: 0 and above, finite")
    return np.broadcast_to(given, count)


def _inverse(information: np.ndarray, translation_m: np.ndarray) -> np.ndarray:
    """Return inverses (B, 6, 6); NaN where it is NaN, infinite on the diagonal where it is singular."""
    inverse = np.full_like(information, np.nan)
    known = np.all(np.isfinite(information), axis=(1, 2))
    # shifts as shares of the distance: all unknowns of one size
    scale = np.ones((np.count_nonzero(known), 6))
    scale[:, 3:] = np.linalg.norm(translation_m[known], axis=1)[:, None]
    values, vectors = np.linalg.eigh(information[known] * scale[:, :, None] * scale[:, None])
    open_ = values[:, 0] <= _UNDETERMINED * values[:, -1]
    values[open_] = 1.0
    found = (vectors / values[:, None]) @ np.swapaxes(vectors, 1, 2) * scale[:, :, None] * scale[:, None]
    found[open_] = np.diag(np.full(6, np.inf))
    inverse[known] = found
    return inverse


def check_points(
    points_m: np.ndarray, points: np.ndarray, *, minimum: int, where: str
) -> tuple[np.ndarray, np.ndarray]:
    """Return target points (B, n, 3) [m] and normalised image points (B, n, 2) as float64.

    Raises ValueError on other shapes, fewer than `minimum` points, NaN, infinity and magnitudes above 1e75.
    """
    points_m, points = np.asarray(points_m, dtype=float), np.asarray(points, dtype=float)
    agree = points_m.ndim == 3 and points_m.shape[2] == 3 and points.shape == (*points_m.shape[:2], 2)
    if not agree:
        raise ValueError(f"{where}: got shapes {points_m.shape} and {points.shape}, allowed: (B, n, 3) and (B, n, 2)")
    if points_m.shape[1] < minimum:
        raise ValueError(f"{where}: got {points_m.shape[1]} points, allowed: at least {minimum}")
    for name, values in (("points_m", points_m), ("points", points)):
        if not np.all(np.isfinite(values)):
            raise ValueError(
                f"{where}: {name} holds {np.sum(~np.isfinite(values))} NaN or infinite values, allowed: none"
            )
        huge = np.abs(values) > _MOST
        if np.any(huge):
            raise ValueError(
                f"{where}: {name} holds {np.sum(huge)} values of magnitude above {_MOST:g}, the first in problem "
                f"{np.argwhere(huge)[0, 0]}, allowed: up to that"
            )
    return points_m, points


def spread_out(points_m: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return where points (B, n, 3) do not lie on one line nor their images (B, n, 2) in one point."""
    target = np.linalg.svd(points_m - points_m.mean(axis=1, keepdims=True), compute_uv=False)
    image = np.abs(points - points.mean(axis=1, keepdims=True)).max(axis=(1, 2))
    return (target[:, 1] > LINE_SHARE * target[:, 0]) & (image > 1e-12)


def accept(
    rotation: np.ndarray, translation_m: np.ndarray, points_m: np.ndarray, points: np.ndarray | None = None,
    *, status: np.ndarray | None = None,
) -> Solution:  # fmt: skip
    """Return poses as a Solution; `ok`: finite, a proper rotation, and all points before the camera.

    With the image points (B, n, 2) that the poses were found from it has cost and information, and a cost that is not
    finite is no pose's. `status` (B,): what is known to be wrong already; there no pose is accepted.
    """
    finite = np.all(np.isfinite(rotation), axis=(1, 2)) & np.all(np.isfinite(translation_m), axis=1)
    safe_rotation = np.where(finite[:, None, None], rotation, np.eye(3))
    safe_translation = np.where(finite[:, None], translation_m, 0.0)
    depth_m = (points_m @ safe_rotation[:, 2, :, None])[..., 0] + safe_translation[:, 2, None]
    off = np.abs(np.swapaxes(safe_rotation, 1, 2) @ safe_rotation - np.eye(3)).max(axis=(1, 2))
    proper = finite & (off < 1e-6) & (np.linalg.det(safe_rotation) > 0)
    before = np.all(depth_m > 0, axis=1)
    found = np.where(proper, np.where(before, Status.OK, Status.BEHIND), Status.NO_POSE).astype(np.int8)
    if status is not None:
        found = np.where(status == Status.OK, found, status).astype(np.int8)
    rotation, translation_m, ok = _kept(found, safe_rotation, safe_translation)
    cost = information = None
    if points is not None:
        cost, information = cost_and_information(rotation, translation_m, points_m, points)
        endless = ok & ~np.isfinite(cost)
        if np.any(endless):
            found[endless] = Status.NO_POSE
            rotation, translation_m, ok = _kept(found, rotation, translation_m)
            cost[endless], information[endless] = np.nan, np.nan
    return Solution(rotation, translation_m, ok, found, cost, information, max(2 * points_m.shape[1] - 6, 0))


def _kept(found: np.ndarray, rotation: np.ndarray, translation_m: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return (rotation, translation_m, ok): identity and NaN where the status `found` (B,) is not OK."""
    ok = found == Status.OK
    return np.where(ok[:, None, None], rotation, np.eye(3)), np.where(ok[:, None], translation_m, np.nan), ok
