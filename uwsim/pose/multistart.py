"""Many starts of each problem, all refined, the one of least cost with all points before the camera kept."""

from collections.abc import Callable

import numpy as np

from uwsim.pose.batches import Centred, Poses, least_of
from uwsim.pose.levenberg import State, minimise
from uwsim.pose.reprojection import Errors, batch_last

STARTS = 12
"""Rotations that a search over all rotations begins with."""


def gathered(matrices: np.ndarray, each: int) -> Callable[[np.ndarray], np.ndarray]:
    """Return a function index -> matrices (..., index) of the starts' problems, each with `each` starts (B, ...)."""
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
