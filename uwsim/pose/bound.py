"""The Cramer-Rao bound of a pose: what no unbiased method can do better, for any layout, pose, camera and noise."""

from typing import NamedTuple

import numpy as np

from uwsim.pose.checks import whitening_of
from uwsim.pose.solution import Solution, Status

_NO_ROTATION = 1e-6


class Bound(NamedTuple):
    """Least errors of poses (B,). `covariance` (B, 6, 6): of a turn [rad] about the camera's axes, then a shift [m].

    `rotation_deg`, `translation_percent` (B,): root mean square of the rotation's angle, and of the shift's length by
    the length of the translation. Infinite where the points leave part of the pose open.
    """

    covariance: np.ndarray
    rotation_deg: np.ndarray
    translation_percent: np.ndarray


def bound(
    points_m: np.ndarray, rotation: np.ndarray, translation_m: np.ndarray, *, K: np.ndarray,
    noise_px: float | np.ndarray,
) -> Bound:  # fmt: skip
    """Return the bound for points (B, n, 3) or (n, 3) [m] at poses camera_from_target (B, 3, 3), (B, 3).

    `K` (3, 3) [px]. `noise_px`: standard deviation of each image coordinate [px], or covariances of the points (n, 2,
    2) or (B, n, 2, 2) [px^2]. ValueError for other shapes, NaN, matrices that are no rotations, points behind the
    camera, noise that is none and covariances that are not symmetric and positive definite.

    Valid: Gaussian noise, small enough that the image is linear in the pose over the error: not where the bound
    itself is tens of degrees, as for a flat target at right angles to the axis; and it knows of one minimum only, not
    of the other pose of a flat target that the image fits too.
    """
    points_m, rotation, translation_m = _checked(points_m, rotation, translation_m)
    count = len(translation_m)
    slope = _whitened(image_slope(points_m, rotation, translation_m, K=K), noise_px)
    slope = slope.reshape(count, -1, 6)
    information = np.swapaxes(slope, 1, 2) @ slope
    status = np.full(count, Status.OK, np.int8)
    known = Solution(rotation, translation_m, status == Status.OK, status, information=information)
    covariance = known.covariance(noise=1.0)
    spread = np.diagonal(covariance, axis1=1, axis2=2)
    turn_rad, shift_m = np.sqrt(spread[:, :3].sum(axis=1)), np.sqrt(spread[:, 3:].sum(axis=1))
    return Bound(covariance, np.degrees(turn_rad), 100 * shift_m / np.linalg.norm(translation_m, axis=1))


def _checked(
    points_m: np.ndarray, rotation: np.ndarray, translation_m: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return points and poses as float64; ValueError for what is none."""
    points_m, rotation, translation_m = (np.asarray(part, float) for part in (points_m, rotation, translation_m))
    count = len(translation_m) if translation_m.ndim else 0
    if rotation.shape != (count, 3, 3) or translation_m.shape != (count, 3):
        raise ValueError(f"bound: got poses {rotation.shape}, {translation_m.shape}, allowed: (B, 3, 3) and (B, 3)")
    if points_m.ndim not in (2, 3) or points_m.shape[-1] != 3 or (points_m.ndim == 3 and len(points_m) != count):
        raise ValueError(f"bound: got points {points_m.shape}, allowed: (n, 3) or ({count}, n, 3)")
    for name, values in (("points_m", points_m), ("rotation", rotation), ("translation_m", translation_m)):
        if wrong := np.sum(~np.isfinite(values)):
            raise ValueError(f"bound: {name} holds {wrong} NaN or infinite values, allowed: none")
    off = np.abs(np.swapaxes(rotation, 1, 2) @ rotation - np.eye(3)).max(axis=(1, 2), initial=0)
    wrong = (off > _NO_ROTATION) | (np.linalg.det(rotation) < 0)
    if np.any(wrong):
        first = int(np.argmax(wrong))
        raise ValueError(f"bound: rotation {first} is {rotation[first].tolist()}, allowed: rotation matrices")
    return points_m, rotation, translation_m


def image_slope(points_m: np.ndarray, rotation: np.ndarray, translation_m: np.ndarray, *, K: np.ndarray) -> np.ndarray:
    """Return derivatives (B, n, 2, 6) of pixels by a turn [rad] about the camera's axes and a shift [m].

    ValueError for points at or behind the camera, and for a K that is no camera matrix.
    """
    K = np.asarray(K, float)
    usual = K.shape == (3, 3) and np.array_equal(K[2], [0, 0, 1]) and np.all(np.isfinite(K))
    if not (usual and K[0, 0] > 0 and K[1, 1] > 0):
        raise ValueError(f"K: got {K.tolist()}, allowed: 3 x 3, finite, focal lengths above 0, last row 0, 0, 1")
    arm = points_m @ np.swapaxes(rotation, 1, 2)
    camera = arm + translation_m[:, None]
    depth = camera[..., 2]
    if not np.all(depth > 0):
        raise ValueError(f"bound: {np.sum(~(depth > 0))} points at or behind the camera, allowed: none")
    # d(K X / Z) = K2 [I | -X_xy / Z] dX / Z
    flat = np.zeros((*depth.shape, 2, 3))
    flat[..., :2] = np.eye(2)
    flat[..., 2] = -camera[..., :2] / depth[..., None]
    by_place = K[:2, :2] @ flat / depth[..., None, None]
    # dX = turn x arm + shift, and row . (turn x arm) = turn . (arm x row)
    return np.concatenate([np.cross(arm[..., None, :], by_place), by_place], axis=-1)


def _whitened(slope: np.ndarray, noise_px: float | np.ndarray) -> np.ndarray:
    """Return slopes (B, n, 2, 6) in units of the noise."""
    noise_px = np.asarray(noise_px, float)
    if noise_px.ndim == 0:
        if not (np.isfinite(noise_px) and noise_px > 0):
            raise ValueError(f"bound: noise_px is {noise_px}, allowed: above 0 px")
        return slope / noise_px
    wanted = slope.shape[1], 2, 2
    if noise_px.shape not in (wanted, (len(slope), *wanted)):
        raise ValueError(f"bound: noise_px of shape {noise_px.shape}, allowed: a number, {wanted} or (B, n, 2, 2)")
    return whitening_of(noise_px, noise_px.shape, name="noise_px", where="bound") @ slope
