"""`best` on the points that are no outliers, by the truth: what a robust solver can reach at most."""

import numpy as np

from uwsim.pose.one_by_one import Found, solved_one_by_one
from uwsim.pose.solution import Solution
from uwsim.pose.solvers import best

MINIMUM_POINTS = best.MINIMUM_POINTS
PLANAR_OK = True
NEEDS = ("inliers",)


def solve(points_m: np.ndarray, points: np.ndarray, *, inliers: np.ndarray) -> Solution:
    """Return camera_from_target for target points (B, n, 3) [m] seen at normalised image points (B, n, 2).

    `inliers` (B, n) bool: points whose images are theirs, at least 4 of each problem. Fewer than 4 points, NaN or other
    shapes: ValueError.
    """

    def find(number: int, target_m: np.ndarray, image: np.ndarray) -> Found | None:
        good = inliers[number]
        solution = best.solve(target_m[None, good], image[None, good])
        return (solution.rotation[0], solution.translation_m[0]) if solution.ok[0] else None

    return solved_one_by_one(points_m, points, find, minimum=MINIMUM_POINTS, where="oracle_inliers")
