"""What a pose solver returns, and the check of what it is given."""

from typing import NamedTuple

import numpy as np

# spread of points off a line below this share of their extent counts as none
_COLLINEAR_SHARE = 1e-6


class Solution(NamedTuple):
    """Poses camera_from_target of a batch: p_camera = rotation @ p_target + translation_m.

    `rotation` (B, 3, 3), `translation_m` (B, 3) [m], `ok` (B,) bool. Where `ok` is False there is no pose:
    rotation is the identity and the translation NaN.
    """

    rotation: np.ndarray
    translation_m: np.ndarray
    ok: np.ndarray


def check_points(
    points_m: np.ndarray, points: np.ndarray, *, minimum: int, where: str
) -> tuple[np.ndarray, np.ndarray]:
    """Return target points (B, n, 3) [m] and normalised image points (B, n, 2) as float64.

    Raises ValueError on other shapes, fewer than `minimum` points, and NaN or infinity.
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
    return points_m, points


def spread_out(points_m: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return where points (B, n, 3) do not lie on one line nor their images (B, n, 2) in one point."""
    target = np.linalg.svd(points_m - points_m.mean(axis=1, keepdims=True), compute_uv=False)
    image = np.abs(points - points.mean(axis=1, keepdims=True)).max(axis=(1, 2))
    return (target[:, 1] > _COLLINEAR_SHARE * target[:, 0]) & (image > 1e-12)


def accept(rotation: np.ndarray, translation_m: np.ndarray, points_m: np.ndarray) -> Solution:
    """Return poses as a Solution; `ok`: finite, a proper rotation, and all points before the camera."""
    finite = np.all(np.isfinite(rotation), axis=(1, 2)) & np.all(np.isfinite(translation_m), axis=1)
    safe_rotation = np.where(finite[:, None, None], rotation, np.eye(3))
    safe_translation = np.where(finite[:, None], translation_m, 0.0)
    depth_m = np.einsum("bj,bnj->bn", safe_rotation[:, 2], points_m) + safe_translation[:, None, 2]
    off = np.abs(np.swapaxes(safe_rotation, 1, 2) @ safe_rotation - np.eye(3)).max(axis=(1, 2))
    ok = finite & (off < 1e-6) & (np.linalg.det(safe_rotation) > 0) & np.all(depth_m > 0, axis=1)
    return Solution(
        np.where(ok[:, None, None], safe_rotation, np.eye(3)),
        np.where(ok[:, None], safe_translation, np.nan),
        ok,
    )
