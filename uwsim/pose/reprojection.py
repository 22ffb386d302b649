"""Reprojection error on the plane z = 1 and its derivative by a pose, for many problems at once.

The batch is the **last** axis here: sums over the few points of a problem then run over long rows of memory.
"""

from typing import NamedTuple

import numpy as np

CHUNK = 1024
"""Problems worked on at once: what belongs to them stays in the cache."""


class Errors(NamedTuple):
    """Cost (B,), gradient J^T e (6, B) and J^T J (6, 6, B) of poses; unknowns: turn [rad], shift."""

    cost: np.ndarray
    gradient: np.ndarray
    information: np.ndarray


def batch_last(values: np.ndarray) -> np.ndarray:
    """Return (B, ...) as a contiguous (..., B)."""
    return np.ascontiguousarray(np.moveaxis(values, 0, -1))


def batch_first(values: np.ndarray) -> np.ndarray:
    """Return (..., B) as a contiguous (B, ...)."""
    return np.ascontiguousarray(np.moveaxis(values, -1, 0))


def turned(rotation: np.ndarray, target: np.ndarray) -> np.ndarray:
    """Return rotations (3, 3, B) times points (3, n, B)."""
    rows = rotation[:, :, None]
    return rows[:, 0] * target[0] + rows[:, 1] * target[1] + rows[:, 2] * target[2]


def residuals(arm: np.ndarray, translation: np.ndarray, image: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return (errors (2, n, B), images (2, n, B), 1 / depth (n, B)) of points `arm` = R p (3, n, B) and shifts (3, B).

    1 / depth is NaN behind the camera.
    """
    depth = arm[2] + translation[2]
    with np.errstate(divide="ignore"):
        inverse = np.where(depth > 0, 1 / depth, np.nan)
    seen = (arm[:2] + translation[:2, None]) * inverse
    return seen - image, seen, inverse


def errors(
    rotation: np.ndarray, translation: np.ndarray, target: np.ndarray, image: np.ndarray, unit: np.ndarray
) -> Errors:
    """Return cost and derivatives of poses (3, 3, B), (3, B) for points (3, n, B) and images (2, n, B).

    The shift is in units of `unit` (B,). Cost is infinite, the rest NaN, where a point is behind the camera. With
    q = R p, X = q + t: d(X / Z) = (dX - (X / Z) dZ) / Z, and dX = turn x q + unit shift.
    """
    arm = turned(rotation, target)
    error, (u, v), inverse = residuals(arm, translation, image)
    x, y, z = arm * inverse
    step, rest = unit * inverse, np.zeros_like(inverse)
    count = target.shape[1]
    slope = np.empty((6, 2 * count, target.shape[2]))
    # rows of u, then rows of v
    for place, of_u, of_v in (
        (0, -u * y, -z - v * y), (1, z + u * x, v * x), (2, -y, x),
        (3, step, rest), (4, rest, step), (5, -u * step, -v * step),
    ):  # fmt: skip
        slope[place, :count], slope[place, count:] = of_u, of_v
    flat = error.reshape(2 * count, -1)
    information = np.empty((6, 6, target.shape[2]))
    for row in range(6):
        np.einsum("nb,knb->kb", slope[row], slope[row:], out=information[row, row:])
        information[row:, row] = information[row, row:]
    cost = np.einsum("nb,nb->b", flat, flat)
    gradient = np.einsum("nb,knb->kb", flat, slope)
    return Errors(np.where(np.isnan(cost), np.inf, cost), gradient, information)


def cost_of(rotation: np.ndarray, translation: np.ndarray, target: np.ndarray, image: np.ndarray) -> np.ndarray:
    """Return costs (B,) of poses (B, 3, 3), (B, 3) for points (B, n, 3), (B, n, 2); infinite behind the camera."""
    camera = target @ np.swapaxes(rotation, 1, 2) + translation[:, None]
    depth = camera[..., 2:]
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        squares = (camera[..., :2] / depth - image) ** 2
        cost = squares.sum(axis=(1, 2))
    return np.where(np.all(depth > 0, axis=(1, 2)) & np.isfinite(cost), cost, np.inf)


def cost_and_information(
    rotation: np.ndarray, translation_m: np.ndarray, points_m: np.ndarray, points: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return cost (B,) and J^T J (B, 6, 6) of poses, by turn [rad] and shift [m]; NaN where the pose is."""
    cost = np.empty(len(points_m))
    information = np.empty((len(points_m), 6, 6))
    for first in range(0, len(points_m), CHUNK):
        part = slice(first, first + CHUNK)
        given = [batch_last(values[part]) for values in (rotation, translation_m)]
        seen = [batch_last(np.swapaxes(values[part], 1, 2)) for values in (points_m, points)]
        found = errors(*given, *seen, np.ones(len(cost[part])))
        cost[part] = np.where(np.isnan(given[1][0]), np.nan, found.cost)
        information[part] = batch_first(found.information)
    return cost, information
