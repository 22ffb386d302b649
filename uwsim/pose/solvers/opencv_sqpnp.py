"""OpenCV's SQPnP: sequential quadratic programming from several starts, one problem at a time.

Known limit: farther away than about 200 times the size of the target it finds no pose (not ok), noise or not. Four
points 0.01 to 1 % off a plane, 0.2 px of noise on 117: off by more than 15 deg in 1 to 11 %; of eight points in none.

Source: Terzakis and Lourakis, ECCV 2020, "A consistently fast and globally optimal solution to the
perspective-n-point problem"; `cv2.solvePnPGeneric` with SOLVEPNP_SQPNP.
"""

import numpy as np

from uwsim.pose.batches import FLAT_SHARE, solved
from uwsim.pose.opencv import opencv_core
from uwsim.pose.solution import Solution

# three points fit several poses
MINIMUM_POINTS = 4
PLANAR_OK = True
NEEDS = ()


def solve(points_m: np.ndarray, points: np.ndarray) -> Solution:
    """Return camera_from_target for target points (B, n, 3) [m] seen at normalised image points (B, n, 2).

    Of several solutions that have all points before the camera the one with the least reprojection error
    counts. Points on one line, or images in one point: not ok. Fewer than 4 points, NaN or other shapes:
    ValueError.
    """
    return solved(
        points_m, points, opencv_core("SOLVEPNP_SQPNP"), minimum=MINIMUM_POINTS, where="opencv_sqpnp",
        flat_share=FLAT_SHARE,
    )  # fmt: skip
