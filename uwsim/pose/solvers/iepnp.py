"""IEPnP: EPnP's Gauss-Newton on the betas, started from the weak-perspective pose instead of from linear equations.

The start is poor off the optical axis, where the method ends in other minima.

Source: Chen et al. 2021 as the dissertation describes it (section 5.2 and 5.14-5.16); weak perspective
about the centroid.
"""

import numpy as np

from uwsim.pose.affine import weak_perspective_start
from uwsim.pose.batches import Centred, Poses, solved
from uwsim.pose.parallel import from_start
from uwsim.pose.solution import Solution

MINIMUM_POINTS = 4
PLANAR_OK = True
NEEDS = ()


def solve(points_m: np.ndarray, points: np.ndarray) -> Solution:
    """Return camera_from_target for target points (B, n, 3) [m] seen at normalised image points (B, n, 2).

    Both starts of a flat or nearly flat target are refined; the other pose is the `twin`. Degenerate points, points
    behind the camera: not ok. Fewer than 4 points, NaN or other shapes: ValueError.
    """
    return solved(points_m, points, _core, minimum=MINIMUM_POINTS, where="iepnp")


def _core(centred: Centred) -> Poses:
    return from_start(centred, weak_perspective_start)
