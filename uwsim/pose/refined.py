"""Starts refined to least reprojection error."""

import numpy as np

from uwsim.pose.affine import paraperspective_start
from uwsim.pose.batches import Centred, Poses, least_of
from uwsim.pose.levenberg import STEPS, least_reprojection
from uwsim.pose.reprojection import cost_of


def refined(start: Poses, centred: Centred, *, steps: int = STEPS) -> tuple[Poses, np.ndarray]:
    """Return poses of least reprojection error near poses (B, 3, 3), (B, 3), and their costs (B,).

    Infinite cost where the start is NaN.
    """
    none = ~(np.all(np.isfinite(start.rotation), axis=(1, 2)) & np.all(np.isfinite(start.translation), axis=1))
    rotation = np.where(none[:, None, None], np.eye(3), start.rotation)
    translation = np.where(none[:, None], [0, 0, -1e6], start.translation)
    rotation, translation, cost = least_reprojection(
        rotation, _in_front(rotation, translation, centred), centred.target, centred.image, steps=steps
    )
    return Poses(rotation, translation), cost


def _in_front(rotation: np.ndarray, translation: np.ndarray, centred: Centred) -> np.ndarray:
    """Return translations (B, 3), moved away along the line of sight where points are behind or near the camera.

    A pose that shows such points better than the moved one stays: it may be the one that is sought.
    """
    depth, nearest = translation[:, 2], (centred.target @ rotation[:, 2, :, None])[..., 0].min(axis=1)
    near = np.flatnonzero((depth > 0) & (depth + nearest < 0.1 * depth))
    given, target, image = translation[near], centred.target[near], centred.image[near]
    away = given * (-nearest / (0.9 * np.where(depth > 0, depth, 1)))[near, None]
    better = cost_of(rotation[near], away, target, image) < cost_of(rotation[near], given, target, image)
    moved = translation.copy()
    moved[near[better]] = away[better]
    return moved


def starts_of(found: Poses) -> list[Poses]:
    """Return the pose and, where it has one, its twin as two starts."""
    first = Poses(found.rotation, found.translation)
    return [first] if found.twin_rotation is None else [first, Poses(found.twin_rotation, found.twin_translation)]


def refined_paraperspective(centred: Centred) -> Poses:
    """Return poses of least reprojection error near the para-perspective ones."""
    found = [refined(start, centred) for start in starts_of(paraperspective_start(centred))]
    rotation, translation = (np.stack([pose[field] for pose, _ in found]) for field in (0, 1))
    return least_of(Poses(rotation, translation), np.stack([cost for _, cost in found]), flat=centred.flat)
