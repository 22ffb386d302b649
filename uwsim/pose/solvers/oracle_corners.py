"""SQPnP on the true image points: an oracle, the score that a detector with perfect corners would reach.

Source: as `opencv_sqpnp`.
"""

import numpy as np

from uwsim.pose.solution import Solution
from uwsim.pose.solvers import opencv_sqpnp

MINIMUM_POINTS = opencv_sqpnp.MINIMUM_POINTS
PLANAR_OK = opencv_sqpnp.PLANAR_OK
NEEDS = ("true_points",)


def solve(points_m: np.ndarray, points: np.ndarray, *, true_points: np.ndarray) -> Solution:
    """Return camera_from_target for points (B, n, 3) [m] at `true_points` (B, n, 2); `points` is ignored."""
    return opencv_sqpnp.solve(points_m, true_points)
