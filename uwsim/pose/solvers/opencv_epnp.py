"""OpenCV's EPnP with Gauss-Newton, one problem at a time.

Known limit: for four points it is wrong without any noise in more than half of the problems, flat or not, and says
nothing: its `cost` does. Not a reference for few points. Of eight points up to 0.1 % off a plane, 0.2 px of noise on
117, it is off by more than 15 deg in 32 to 47 %, from 1 % on in none.

Source: Lepetit, Moreno-Noguer and Fua, IJCV 81(2), 2009; `cv2.solvePnPGeneric` with SOLVEPNP_EPNP.
"""

import numpy as np

from uwsim.pose.batches import FLAT_SHARE, solved
from uwsim.pose.opencv import opencv_core
from uwsim.pose.solution import Solution

MINIMUM_POINTS = 4
PLANAR_OK = True
NEEDS = ()


def solve(points_m: np.ndarray, points: np.ndarray) -> Solution:
    """Return camera_from_target for target points (B, n, 3) [m] seen at normalised image points (B, n, 2).

    Degenerate points, points behind the camera: not ok. Fewer than 4 points, NaN or other shapes: ValueError.
    """
    return solved(
        points_m, points, opencv_core("SOLVEPNP_EPNP"), minimum=MINIMUM_POINTS, where="opencv_epnp",
        flat_share=FLAT_SHARE,
    )  # fmt: skip
