"""`best` on all points, as if none were an outlier: the do-nothing entry."""

import numpy as np

from uwsim.pose.solution import Solution
from uwsim.pose.solvers import best

MINIMUM_POINTS = best.MINIMUM_POINTS
PLANAR_OK = True
NEEDS = ()


def solve(points_m: np.ndarray, points: np.ndarray) -> Solution:
    """Return camera_from_target for target points (B, n, 3) [m] seen at normalised image points (B, n, 2).

    Raises what `best.solve` raises.
    """
    return best.solve(points_m, points)
