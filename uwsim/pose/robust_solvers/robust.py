"""`uwsim.pose.robust.solve_robust`: consensus by OpenCV's USAC, then `best` on who agrees until that stays the same."""

import numpy as np

from uwsim.pose.one_by_one import Found, solved_one_by_one
from uwsim.pose.robust import LEAST_INLIERS, Method, solve_robust
from uwsim.pose.solution import Solution

MINIMUM_POINTS = LEAST_INLIERS
PLANAR_OK = True
NEEDS = ("threshold",)


def solve(points_m: np.ndarray, points: np.ndarray, *, threshold: float, method: Method = "magsac") -> Solution:
    """Return camera_from_target for target points (B, n, 3) [m] seen at normalised image points (B, n, 2).

    `threshold`, `method`: as in `solve_robust`, whose other options are left as they are. Not ok where fewer than five
    points agree. Raises what it raises.
    """

    def find(number: int, target_m: np.ndarray, image: np.ndarray) -> Found | None:
        solution = solve_robust(target_m, image, threshold=threshold, method=method).solution
        return (solution.rotation[0], solution.translation_m[0]) if solution.ok[0] else None

    return solved_one_by_one(points_m, points, find, minimum=MINIMUM_POINTS, where="robust")
