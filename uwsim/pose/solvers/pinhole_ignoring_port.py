"""The pose of a camera taken for a pinhole in air, the port and the water forgotten: what a calibration in air gives.

Through a flat port everything looks nearer by about the index of water, 1.33, and the more the farther off the axis. A
baseline; without a port it is `best`.

Source: Treibitz and others, PAMI 34(1), 2012, on what the pinhole is off by.
"""

import numpy as np

from uwsim.camera import distortion
from uwsim.camera.lens import Lens
from uwsim.pose.solution import Solution
from uwsim.pose.solvers import best

MINIMUM_POINTS = best.MINIMUM_POINTS
PLANAR_OK = best.PLANAR_OK
NEEDS = ("pixels", "lens")


def solve(points_m: np.ndarray, points: np.ndarray, *, pixels: np.ndarray, lens: Lens) -> Solution:
    """Return camera_from_target for points (B, n, 3) [m] seen at `pixels` (B, n, 2) [px]; `points` is ignored.

    Of the `lens` its matrix and its distortion count. ValueError as of `best`.
    """
    directions = distortion.directions(np.asarray(pixels, float), lens.K, coefficients=lens.coefficients)
    return best.solve(points_m, directions[..., :2] / directions[..., 2:])
