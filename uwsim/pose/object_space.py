"""Distances of points from their lines of sight, as a quadratic form of the rotation alone.

With the projection V = f f^T / |f|^2 on the line of sight f = (u, v, 1) and Q = 1 - V, the sum of the squared distances
is sum (R p + t)^T Q (R p + t). It is quadratic in t, whose best value t = -(sum Q)^-1 sum Q R p leaves r^T Omega r, r
the nine entries of R row by row: R p = A r with A = 1 (x) p^T.

Source: Lu, Hager and Mjolsness, IEEE PAMI 22(6), 2000, for the error; Hesch and Roumeliotis, ICCV 2011, for the form
(whose distances are along the unit lines of sight: the same).
"""

from typing import NamedTuple

import numpy as np

from uwsim.pose.batches import Centred, Poses
from uwsim.pose.levenberg import exponential, product
from uwsim.pose.multistart import STARTS, from_starts, gathered, tetrahedral_rotations
from uwsim.pose.reprojection import Errors

_FLOOR = 1e-15


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
    # sights that are one and the same tell no distance, and are no reason to end
    whole = across.sum(axis=1) + _FLOOR * sight.shape[1] * np.eye(3)
    translation = -np.linalg.solve(whole, once)
    return Form(twice + np.swapaxes(once, 1, 2) @ translation, np.swapaxes(points, 1, 2) @ points, translation)


def translation_of(form: Form, rotation: np.ndarray) -> np.ndarray:
    """Return the best translations (..., B, 3) for rotations (..., B, 3, 3)."""
    return (form.translation @ rotation.reshape(*rotation.shape[:-2], 9, 1))[..., 0]


def object_space_pose(centred: Centred) -> Poses:
    """Return the rotations of least object-space error of 12 starts with all points before the camera."""
    form = form_of(centred)
    omega_of = gathered(form.omega, STARTS)

    def evaluate(state, index):
        (rotation,) = state
        omega, entries = omega_of(index), rotation.reshape(9, -1)
        pull = np.einsum("ijb,jb->ib", omega, entries)
        # of e_k x rotation for each axis
        first, second, third = rotation
        none = np.zeros_like(first)
        slope = np.array([[none, -third, second], [third, none, -first], [-second, first, none]]).reshape(3, 9, -1)
        bent = np.einsum("ijb,kjb->kib", omega, slope)
        return Errors(
            np.einsum("ib,ib->b", entries, pull),
            np.einsum("kib,ib->kb", slope, pull),
            np.einsum("kib,lib->klb", slope, bent),
        )

    def poses(state):
        rotation = np.moveaxis(state[0], -1, 0).reshape(len(centred.target), STARTS, 3, 3)
        places = translation_of(form, np.swapaxes(rotation, 0, 1))
        return Poses(rotation, np.swapaxes(places, 0, 1))

    starts = np.tile(np.moveaxis(tetrahedral_rotations(), 0, -1), len(centred.target))
    return from_starts(
        (starts,), evaluate, lambda state, step: (product(exponential(step), state[0]),), poses, centred
    )  # fmt: skip
