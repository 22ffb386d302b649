"""The pose of least reprojection error at the true image points: an oracle, the score of perfect corners.

It knows the lens too, with its distortion and its port, so that what is left is the round-off of the arithmetic; behind
a rolling shutter in motion also that the points are seen one after the other.

Source: SQPnP as `opencv_sqpnp` for the start, then least squares over the reprojection through the lens.
"""

import numpy as np

from uwsim.camera.lens import Lens
from uwsim.pose.refine import refine
from uwsim.pose.solution import Solution
from uwsim.pose.solvers import opencv_sqpnp

MINIMUM_POINTS = opencv_sqpnp.MINIMUM_POINTS
PLANAR_OK = opencv_sqpnp.PLANAR_OK
NEEDS = ("true_points", "true_pixels", "lens")


def solve(
    points_m: np.ndarray, points: np.ndarray, *, true_points: np.ndarray, true_pixels: np.ndarray, lens: Lens
) -> Solution:
    """Return camera_from_target for points (B, n, 3) [m] at `true_pixels` (B, n, 2) [px]; `points` is ignored.

    `true_points` (B, n, 2): the same normalised, of a pinhole near to the lens. No pose where SQPnP finds none there.
    """
    start = opencv_sqpnp.solve(points_m, true_points)
    return refine(start, points_m, true_pixels, lens=lens)
