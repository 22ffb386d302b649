"""DLS: the rotation of least sum of squared distances between points and their lines of sight, over all rotations.

The published method finds every stationary point from polynomial equations; here its cost is minimised by
Levenberg-Marquardt from 12 rotations no farther than 90 deg from any other, and the least value counts. That finds the
global minimum in all but a few of a thousand problems, and is not certified.

Source: Hesch and Roumeliotis, ICCV 2011, "A direct least-squares (DLS) method for PnP": the cost.
"""

import numpy as np

from uwsim.pose.batches import solved
from uwsim.pose.multistart import STARTS
from uwsim.pose.object_space import object_space_pose
from uwsim.pose.reprojection import CHUNK
from uwsim.pose.solution import Solution

MINIMUM_POINTS = 4
PLANAR_OK = True
NEEDS = ()


def solve(points_m: np.ndarray, points: np.ndarray) -> Solution:
    """Return camera_from_target for target points (B, n, 3) [m] seen at normalised image points (B, n, 2).

    A flat or nearly flat target's second minimum is the `twin`. Degenerate points, points behind the camera: not ok.
    Fewer than 4 points, NaN or other shapes: ValueError.
    """
    return solved(points_m, points, object_space_pose, minimum=MINIMUM_POINTS, where="dls", chunk=CHUNK // STARTS)
