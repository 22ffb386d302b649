"""Least reprojection error through lens and port, in pixels, from the pose that a pinhole in the water leads to.

The rays behind a flat port do not meet in one point, so no pinhole is exact: `best` on the points of the paraxial
pinhole (`points`) is the start, both of its poses for flat targets, and Levenberg-Marquardt over rotation and
translation ends where the points, refracted, fall nearest to the pixels; weighted by their covariances where they have
some.

Source: this project; the port is `uwsim.camera.port`.
"""

import numpy as np

from uwsim.camera.lens import Lens
from uwsim.pose.refine import least_refined
from uwsim.pose.solution import Solution
from uwsim.pose.solvers import best

MINIMUM_POINTS = best.MINIMUM_POINTS
PLANAR_OK = best.PLANAR_OK
NEEDS = ("pixels", "lens", "covariance_px2")


def solve(
    points_m: np.ndarray, points: np.ndarray, *, pixels: np.ndarray, lens: Lens,
    covariance_px2: np.ndarray | None = None,
) -> Solution:  # fmt: skip
    """Return camera_from_target for points (B, n, 3) [m] seen at `pixels` (B, n, 2) [px].

    `points` (B, n, 2): the same normalised, of a pinhole near to the lens. `covariance_px2` (B, n, 2, 2), of the
    pixels; None: all alike. `covariance(noise=1.0)` of what is returned is that of the pose. No pose where `best` finds
    none; ValueError as there, and as of `uwsim.pose.refine` for pixels and covariances.
    """
    start = best.solve(points_m, points)
    return least_refined(start, points_m, pixels, lens=lens, covariance_px2=covariance_px2)
