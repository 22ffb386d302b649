"""What a setting's noise leaves, whatever the solver: ML*, the best known minimum of each problem, and the bound.

ML* is the least reprojection error reached from the true pose: no method, and no lower limit for flat targets, whose
second minimum may be lower. The bound is Cramer-Rao's at the true pose.
"""

from typing import NamedTuple

import numpy as np

from uwsim.bench.pnp.settings import Batch
from uwsim.metrics.pose import rotation_error_deg, translation_error_percent
from uwsim.pose.affine import placed_at
from uwsim.pose.multistart import tetrahedral_rotations
from uwsim.pose.polish import polished
from uwsim.pose.problems import Placed
from uwsim.pose.reprojection import cost_and_information

_BOUND_DRAWS = 8
_FAIL_QUANTILE, _FAIL_FACTOR = 0.95, 5.0
_SECOND_TURN = np.array([[1.0, 2.0, 2.0], [2.0, 1.0, -2.0], [-2.0, 2.0, -1.0]]) / 3
STEPS = 60
"""Far more than solvers need: a minimum that is not reached would be taken for another one."""


class Errors(NamedTuple):
    """Of each problem (B,): turn [deg] and shift [%]; infinite where there is no pose."""

    turn_deg: np.ndarray
    shift_percent: np.ndarray


class Reference(NamedTuple):
    """`ml` (B,): errors of ML*; `best` (B,): those of the pose of least known cost, `cost` (B,) that cost.

    `bound`: median turn [deg] and shift [%] of a normal error at the bound; `bound_rms`: root mean squares.
    `fail_deg`: above that turn a pose has failed.
    """

    ml: Errors
    best: Errors
    cost: np.ndarray
    bound: tuple[float, float]
    bound_rms: tuple[float, float]
    fail_deg: float


def errors_of(rotation: np.ndarray, translation_m: np.ndarray, placed: Placed) -> Errors:
    """Return the errors of poses (B, 3, 3), (B, 3) [m]; infinite where a pose is NaN."""
    known = np.all(np.isfinite(translation_m), axis=1) & np.all(np.isfinite(rotation), axis=(1, 2))
    turn, shift = np.full(len(known), np.inf), np.full(len(known), np.inf)
    turn[known] = rotation_error_deg(rotation[known], placed.rotation[known])
    shift[known] = translation_error_percent(translation_m[known], placed.translation_m[known])
    return Errors(turn, shift)


def reference_of(batch: Batch, *, noise: float, rng: np.random.Generator) -> Reference:
    """Return the reference of problems whose image coordinates have `noise` on the plane z = 1."""
    placed = batch.placed
    start = polished(placed.rotation, placed.translation_m, placed.points_m, batch.points, steps=STEPS)
    ml = errors_of(*start[:2], placed)
    rotation, translation_m, cost = _least([start, _from_everywhere(batch)])
    bound, bound_rms = _bound(placed, noise=noise, rng=rng)
    fail_deg = _FAIL_FACTOR * float(np.quantile(ml.turn_deg, _FAIL_QUANTILE, method="inverted_cdf"))
    return Reference(ml, errors_of(rotation, translation_m, placed), cost, bound, bound_rms, fail_deg)


def _least(found: list[tuple[np.ndarray, ...]]) -> tuple[np.ndarray, ...]:
    """Return of (rotation, translation_m, cost), each (B, ...), those of least cost."""
    first = np.argmin([one[2] for one in found], axis=0)
    everyone = np.arange(len(first))
    return tuple(np.stack(parts)[first, everyone] for parts in zip(*found, strict=True))


def _from_everywhere(batch: Batch) -> tuple[np.ndarray, ...]:
    """Return (rotation, translation_m, cost) of the least minimum from 24 rotations over all.

    They are those of a tetrahedron and the same turned on, the centroid where it is seen and as far off as it is large
    in the image.
    """
    once = tetrahedral_rotations()
    turns = np.concatenate([once, once @ _SECOND_TURN])
    points_m, points = batch.placed.points_m, batch.points
    count = len(points)
    centre_m, middle = points_m.mean(axis=1), points.mean(axis=1)
    size_m = np.sqrt(((points_m - centre_m[:, None]) ** 2).sum(axis=(1, 2)) * 2 / 3)
    size = np.sqrt(((points - middle[:, None]) ** 2).sum(axis=(1, 2)))
    place_m = placed_at(size_m / np.maximum(size, 1e-12), middle)
    starts_m = np.concatenate([place_m - centre_m @ turn.T for turn in turns])
    again = [np.tile(values, (len(turns), 1, 1)) for values in (points_m, points)]
    found = polished(np.repeat(turns, count, axis=0), starts_m, *again, steps=STEPS)
    return _least([tuple(part[first : first + count] for part in found) for first in range(0, len(starts_m), count)])


def _bound(
    placed: Placed, *, noise: float, rng: np.random.Generator
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return medians and root mean squares of turn [deg] and shift [%] at the bound, NaN where it is not finite."""
    camera_m = placed.points_m @ np.swapaxes(placed.rotation, 1, 2) + placed.translation_m[:, None]
    exact = camera_m[..., :2] / camera_m[..., 2:]
    information = cost_and_information(placed.rotation, placed.translation_m, placed.points_m, exact)[1]
    # shifts as shares of the distance, so that all unknowns are of one size
    distance_m = np.linalg.norm(placed.translation_m, axis=1)
    scale = np.ones((len(exact), 6))
    scale[:, 3:] = distance_m[:, None]
    values, vectors = np.linalg.eigh(information * scale[:, :, None] * scale[:, None])
    if np.any(values[:, 0] <= 1e-14 * values[:, -1]):
        return (np.nan, np.nan), (np.nan, np.nan)
    roots = noise * vectors / np.sqrt(values)[:, None]
    drawn = np.einsum("bij,bjk->bik", roots, rng.standard_normal((len(exact), 6, _BOUND_DRAWS)))
    turn_deg = np.degrees(np.linalg.norm(drawn[:, :3], axis=1))
    shift_percent = 100 * np.linalg.norm(drawn[:, 3:], axis=1)
    variances = (roots**2).sum(axis=2)
    rms = np.sqrt(np.mean([variances[:, :3].sum(axis=1), variances[:, 3:].sum(axis=1)], axis=1))
    return (
        (float(np.median(turn_deg)), float(np.median(shift_percent))),
        (float(np.degrees(rms[0])), float(100 * rms[1])),
    )
