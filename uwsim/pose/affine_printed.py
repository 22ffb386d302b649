"""The para-perspective pose by the dissertation's own way, 5.18-5.21, for comparison with `uwsim.pose.affine`.

Two of the three constraints on I = (i - u0 k) / z and J = (j - v0 k) / z give the depth, the cross product gives k, and
what results is no rotation until it is made one.
"""

import numpy as np

from uwsim.pose.affine import affine_rows, placed_at
from uwsim.pose.batches import Centred, Poses
from uwsim.pose.control_points import nearest_rotation


def two_constraints_start(centred: Centred, *, misprint: bool) -> Poses:
    """Return para-perspective poses of solid targets from the lengths of I and J; `misprint`: |I| twice, as in 5.19.

    Source: dissertation 5.17-5.21 about the centroid, rows of 5.18 for the text's 5.27, and the nearest rotation.
    """
    middle = centred.image.mean(axis=1)
    first, second = np.moveaxis(affine_rows(centred, middle), 1, 0)
    depth = mean_depth(first, second, middle, misprint=misprint)
    third = third_row(first, second, depth, middle)
    rows = [depth[:, None] * row + place[:, None] * third for row, place in zip((first, second), middle.T, strict=True)]
    return Poses(nearest_rotation(np.stack([*rows, third], axis=1)), placed_at(depth, middle))


def mean_depth(first: np.ndarray, second: np.ndarray, middle: np.ndarray, *, misprint: bool = False) -> np.ndarray:
    """Return the mean of the depths (B,) by the lengths of I and J (B, 3) for the reference point's image (B, 2).

    Source: dissertation 5.19.
    Errata: prints |I| in both terms, which puts exact para-perspective images of the printed box 1.3 % (median)
    off in depth, at most 11 %; `misprint=True` does too.
    """
    lengths = [np.linalg.norm(row, axis=1) for row in (first, first if misprint else second)]
    return np.mean([np.sqrt(1 + place**2) / length for place, length in zip(middle.T, lengths, strict=True)], axis=0)


def third_row(first: np.ndarray, second: np.ndarray, depth: np.ndarray, middle: np.ndarray) -> np.ndarray:
    """Return k (B, 3) from (E - z v0 [I]x + z u0 [J]x) k = z^2 I x J; of length 1 for exact images only.

    The matrix E - [a]x is never singular: its determinant is 1 + |a|^2.
    Source: dissertation 5.20, 5.21, whose signs are right.
    """
    u, v = middle.T[..., None]
    axis = depth[:, None] * (v * first - u * second)
    matrix = np.eye(3) - np.cross(axis[:, None], np.eye(3)).swapaxes(1, 2)
    return np.linalg.solve(matrix, (depth[:, None] ** 2 * np.cross(first, second))[..., None])[..., 0]
