"""Errors of `best` on noisy images of a layout: whether the bound is reached, and how often another pose is found."""

from typing import NamedTuple

import numpy as np

from uwsim.pose import limits
from uwsim.pose.bound import bound
from uwsim.pose.design import Sweep, View, curves
from uwsim.pose.problems import Placed, images
from uwsim.pose.solvers import best

PLACES = 9
_ELSEWHERE = 5.0


class Trials(NamedTuple):
    """What `best` did at `values` (q,): root mean square errors of the poses near the true one, and the others' share.

    Others, `elsewhere_percent`: off by more than 5 times the bound of their pose, or not found at all; mostly the
    second pose that the image of a flat target fits.
    """

    values: np.ndarray
    rotation_deg: np.ndarray
    translation_percent: np.ndarray
    elsewhere_percent: np.ndarray


def tried(
    points_m: np.ndarray, sweep: Sweep, view: View, *, trials: int, rng: np.random.Generator, places: int = PLACES
) -> Trials:
    """Return errors of `trials` noisy images at each of some places of a sweep where points (n, 3) [m] hold a pose.

    Orientations are drawn from those of the sweep. NaN where no pose is near the true one. ValueError for no trials,
    and for more than `limits.TRIALS`.
    """
    limits.TRIALS._replace(least=1).check(trials, name="trials")
    held = np.flatnonzero(np.isfinite(curves(points_m, sweep, view).rotation_bound_deg))
    chosen = held[np.unique(np.linspace(0, len(held) - 1, places).round().astype(int))] if len(held) else held
    found = np.full((3, len(chosen)), np.nan)
    for index, place in enumerate(chosen):
        drawn = rng.integers(sweep.rotation.shape[1], size=trials)
        placed = Placed(
            np.tile(points_m, (trials, 1, 1)), sweep.rotation[place, drawn],
            np.tile(sweep.translation_m[place], (trials, 1)),
        )  # fmt: skip
        found[:, index] = _errors(placed, view, rng=rng)
    return Trials(sweep.values[chosen], *found)


def _errors(placed: Placed, view: View, *, rng: np.random.Generator) -> tuple[float, float, float]:
    focal_px = np.array([view.K[0, 0], view.K[1, 1]])
    seen = images(placed, focal_px=focal_px, noise_px=view.noise_px, rng=rng)
    solution = best.solve(placed.points_m, seen)
    least = bound(placed.points_m, placed.rotation, placed.translation_m, K=view.K, noise_px=view.noise_px)
    between = np.swapaxes(solution.rotation, 1, 2) @ placed.rotation
    # the angle by its half: exact near 0
    half = np.linalg.norm(between - np.eye(3), axis=(1, 2)) / np.sqrt(8)
    turned_deg = np.degrees(2 * np.arcsin(np.minimum(half, 1)))
    shift_m = np.linalg.norm(solution.translation_m - placed.translation_m, axis=1)
    moved_percent = 100 * shift_m / np.linalg.norm(placed.translation_m, axis=1)
    near = solution.ok & (turned_deg <= _ELSEWHERE * least.rotation_deg)
    if not near.any():
        return np.nan, np.nan, 100.0
    rms = [float(np.sqrt(np.mean(part[near] ** 2))) for part in (turned_deg, moved_percent)]
    return *rms, 100 * float(np.mean(~near))
