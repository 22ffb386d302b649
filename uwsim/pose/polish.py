"""Least reprojection error from given poses: where their basin of it ends."""

import numpy as np

from uwsim.pose.batches import Centred, Poses
from uwsim.pose.levenberg import STEPS
from uwsim.pose.refined import refined
from uwsim.pose.reprojection import CHUNK


def polished(
    rotation: np.ndarray, translation_m: np.ndarray, points_m: np.ndarray, points: np.ndarray, *, steps: int = STEPS
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return (rotation (B, 3, 3), translation_m (B, 3), cost (B,)) of least reprojection error near given poses.

    Target points (B, n, 3) [m], normalised image points (B, n, 2). NaN and infinite cost where a pose is NaN.
    """
    found = [np.full_like(rotation, np.nan), np.full_like(translation_m, np.nan), np.full(len(points_m), np.inf)]
    known = np.flatnonzero(np.all(np.isfinite(translation_m), axis=1) & np.all(np.isfinite(rotation), axis=(1, 2)))
    for first in range(0, len(known), CHUNK):
        part = known[first : first + CHUNK]
        centre_m = points_m[part].mean(axis=1)
        around_m = points_m[part] - centre_m[:, None]
        size_m = np.sqrt((around_m**2).sum(axis=(1, 2)) / points_m.shape[1])
        target = around_m / size_m[:, None, None]
        middle_m = translation_m[part] + (rotation[part] @ centre_m[..., None])[..., 0]
        centred = Centred(target, points[part], -centre_m / size_m[:, None], False)
        pose, cost = refined(Poses(rotation[part], middle_m / size_m[:, None]), centred, steps=steps)
        back_m = size_m[:, None] * pose.translation - (pose.rotation @ centre_m[..., None])[..., 0]
        for values, new in zip(found, (pose.rotation, back_m, cost), strict=True):
            values[part] = new
    return tuple(found)
