"""The least minimum of the reprojection error, sought from as many starts as a problem asks for: `solvers.best`."""

from collections.abc import Callable
from typing import Literal

import numpy as np

from uwsim.pose.affine import paraperspective_start
from uwsim.pose.batches import Centred, Poses, least_of, together
from uwsim.pose.depth_weighted import depth_weighted_pose
from uwsim.pose.edge_placing import by_placed_edges
from uwsim.pose.levenberg import STEPS
from uwsim.pose.multistart import tetrahedral_rotations
from uwsim.pose.object_space import object_space_pose
from uwsim.pose.parallel import from_start
from uwsim.pose.refined import refined, starts_of

Extra = Literal["needed", "always", "never"]
_SAME_COST = 1e-6
# costs of exact problems are round-off, whose ratio says nothing
_NO_COST = 1e-20
_NOISY_SHARE = 0.01
_MANY_STEPS = 150


class _Found:
    """Minima found so far, each over the whole batch; infinite cost where a start was not asked for."""

    def __init__(self, centred: Centred):
        self.centred = centred
        self.poses: list[Poses] = []
        self.costs: list[np.ndarray] = []

    def add(
        self, starts: Callable[[Centred], list[Poses]], where: np.ndarray | None = None, *, steps: int = STEPS
    ) -> np.ndarray:
        """Refine starts of the problems `where` (B,); return the lowest costs (B,)."""
        count = len(self.centred.target)
        index = np.arange(count) if where is None else np.flatnonzero(where)
        lowest = np.full(count, np.inf)
        if not len(index):
            return lowest
        part = self.centred if where is None else _part(self.centred, index)
        found = starts(part)
        # one long batch of all starts: few long rows rather than many short ones
        rotations, translations = (np.concatenate([pose[field] for pose in found]) for field in (0, 1))
        again = np.tile(np.arange(len(index)), len(found))
        refined_pose, costs = refined(Poses(rotations, translations), _part(part, again), steps=steps)
        for first in range(0, len(again), len(index)):
            one = slice(first, first + len(index))
            rotation, translation = np.tile(np.eye(3), (count, 1, 1)), np.zeros((count, 3))
            cost = np.full(count, np.inf)
            rotation[index], translation[index] = refined_pose.rotation[one], refined_pose.translation[one]
            cost[index] = costs[one]
            self.poses.append(Poses(rotation, translation))
            self.costs.append(cost)
            lowest = np.minimum(lowest, cost)
        return lowest

    def forget(self, where: np.ndarray) -> None:
        """Drop what was found for the problems `where` (B,)."""
        for cost in self.costs:
            cost[where] = np.inf

    def least(self) -> Poses:
        return least_of(together(self.poses), np.stack(self.costs), flat=self.centred.flat)


def least_reprojection_pose(centred: Centred, *, extra: Extra) -> Poses:
    """Return the poses of least reprojection error that the starts lead to; of flat targets the next minimum too."""
    found = _Found(centred)
    first = paraperspective_start(centred)
    from_first = found.add(lambda part: starts_of(first))
    from_betas = found.add(lambda part: starts_of(from_start(part, lambda _: first)))
    if extra == "never":
        return found.least()
    few = centred.target.shape[1] < 5
    differ = ~_same(from_first, from_betas)
    # with errors of this size steps get slow, and minima many
    spread = ((centred.image - centred.image.mean(axis=1, keepdims=True)) ** 2).sum(axis=(1, 2))
    lowest = np.minimum(from_first, from_betas)
    noisy = lowest > _NOISY_SHARE * spread
    asked = differ | noisy | (few or extra == "always")
    from_edges = found.add(lambda part: starts_of(by_placed_edges(part)), asked)
    rough = differ | asked & ~_same(from_edges, lowest)
    found.add(_everywhere, rough)
    ends, slow = found.least(), noisy | rough
    found.forget(slow)
    found.add(lambda part: [_some(pose, np.flatnonzero(slow)) for pose in starts_of(ends)], slow, steps=_MANY_STEPS)
    return found.least()


def _everywhere(centred: Centred) -> list[Poses]:
    place = paraperspective_start(centred).translation
    turned = [Poses(np.broadcast_to(turn, (len(place), 3, 3)), place) for turn in tetrahedral_rotations()]
    return [*starts_of(object_space_pose(centred)), *starts_of(depth_weighted_pose(centred)), *turned]


def _same(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return where two starts end in minima of one cost."""
    with np.errstate(invalid="ignore"):
        return np.abs(first - second) <= _SAME_COST * np.minimum(first, second) + _NO_COST


def _some(poses: Poses, index: np.ndarray) -> Poses:
    return Poses(poses.rotation[index], poses.translation[index])


def _part(centred: Centred, index: np.ndarray) -> Centred:
    return centred._replace(target=centred.target[index], image=centred.image[index], origin=centred.origin[index])
