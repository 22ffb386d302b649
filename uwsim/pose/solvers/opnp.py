"""OPnP: least algebraic image error, weighted by depth, over quaternions of any length.

The published method finds every stationary point by a Groebner basis; here the cost (`uwsim.pose.depth_weighted`) is
minimised by Levenberg-Marquardt over the four entries from 12 rotations, each at its best length, and the least value
counts.

Source: Zheng, Kuang, Sugimoto, Astrom and Okutomi, ICCV 2013, "Revisiting the PnP problem": the cost. A comparison in
circulation picks among several solutions by the true pose; here the least cost with all points before the camera
counts.
"""

import numpy as np

from uwsim.pose.batches import solved
from uwsim.pose.depth_weighted import depth_weighted_pose
from uwsim.pose.multistart import STARTS
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
    return solved(points_m, points, depth_weighted_pose, minimum=MINIMUM_POINTS, where="opnp", chunk=CHUNK // STARTS)
