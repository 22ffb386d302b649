"""Distances of points from their lines of sight, as a quadratic form of the rotation alone.

With the projection V = f f^T / |f|^2 on the line of sight f = (u, v, 1) and Q = 1 - V, the sum of the squared distances
is sum (R p + t)^T Q (R p + t). It is quadratic in t, whose best value t = -(sum Q)^-1 sum Q R p leaves r^T Omega r, r
the nine entries of R row by row: R p = A r with A = 1 (x) p^T.

Source: Lu, Hager and Mjolsness, IEEE PAMI 22(6), 2000, for the error; Hesch and Roumeliotis, ICCV 2011, for the form
(whose distances are along the unit lines of sight: the same).
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from uwsim.pose.batches import Centred, Poses, least_of
from uwsim.pose.levenberg import State, minimise
from uwsim.pose.reprojection import Errors, batch_first, batch_last


class Form(NamedTuple):
    """Omega (B, 9, 9), scatter sum p p^T (B, 3, 3) and the matrix (B, 3, 9) that gives t of r."""

    omega: np.ndarray
    scatter: np.ndarray
    translation: np.ndarray


def form_of(centred: Centred) -> Form:
    """Return the quadratic form of centred problems."""
    sight = np.concatenate([centred.image, np.ones((*centred.image.shape[:2], 1))], axis=2)
    sight = sight / np.linalg.norm(sight, axis=2, keepdims=True)
    count, points = len(sight), centred.target
    across = np.eye(3) - sight[..., :, None] * sight[..., None, :]
    flat = np.swapaxes(across.reshape(*sight.shape[:2], 9), 1, 2)
    squares = (points[..., :, None] * points[..., None, :]).reshape(*sight.shape[:2], 9)
    # sum of Q_ac p_i and of Q_ac p_i p_j
    once = (flat @ points).reshape(count, 3, 9)
    twice = (flat @ squares).reshape(count, 3, 3, 3, 3).transpose(0, 1, 3, 2, 4).reshape(count, 9, 9)
    translation = -np.linalg.solve(across.sum(axis=1), once)
    return Form(twice + np.swapaxes(once, 1, 2) @ translation, np.swapaxes(points, 1, 2) @ points, translation)


def translation_of(form: Form, rotation: np.ndarray) -> np.ndarray:
    """Return the best translations (..., B, 3) for rotations (..., B, 3, 3)."""
    return (form.translation @ rotation.reshape(*rotation.shape[:-2], 9, 1))[..., 0]


def gathered(matrices: np.ndarray, each: int) -> Callable[[np.ndarray], np.ndarray]:
    """Return a function index -> matrices (..., index) of their problems, for `each` starts of every problem (B, ...)."""
    last = batch_last(matrices)
    kept: dict[str, np.ndarray] = {}

    def of(index: np.ndarray) -> np.ndarray:
        if kept.get("index") is not index:
            kept.update(index=index, values=last[..., index // each])
        return kept["values"]

    return of


def from_starts(
    state: State, evaluate: Callable[[State, np.ndarray], Errors], move: Callable[[State, np.ndarray], State],
    poses: Callable[[State], Poses], centred: Centred,
) -> Poses:  # fmt: skip
    """Return of the minima that starts run into the one of least cost with all points before the camera.

    `state`: starts of a problem side by side, the batch last; `poses` makes Poses (B, starts, ...) of it, batch first.
    """
    found, costs = minimise(state, evaluate, move)
    candidates = poses(found)
    rotation, translation = np.swapaxes(candidates.rotation, 0, 1), np.swapaxes(candidates.translation, 0, 1)
    depth = centred.target @ rotation[..., 2, :, None] + translation[:, :, None, 2:]
    costs = costs.reshape(len(centred.target), -1).T
    before = np.all(depth[..., 0] > 0, axis=2)
    return least_of(Poses(rotation, translation), np.where(before, costs, np.inf), flat=centred.flat)


def tetrahedral_rotations() -> np.ndarray:
    """Return the 12 turns (12, 3, 3) of a tetrahedron: no rotation is farther than 90 deg from the nearest."""
    found = []
    for shift in range(3):
        cycle = np.roll(np.eye(3), shift, axis=0)
        found += [cycle * signs for signs in ([1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1])]
    return np.array(found)


