"""OpenCV's default: least reprojection error from a homography (flat targets) or a direct linear transform.

Known limits: solid targets need 6 points, fewer have no pose; with 6 noisy ones the linear start often fails and the
result with it. It takes targets up to about 1 % off a plane for flat: of four such points 0 to 5 % are off by more than
15 deg with 0.2 px of noise on 117, of eight none.

Source: `cv2.solvePnPGeneric` with SOLVEPNP_ITERATIVE.
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

    Degenerate points, solid targets of fewer than 6 points, points behind the camera: not ok. Fewer than 4 points, NaN
    or other shapes: ValueError.
    """
    return solved(
        points_m, points, opencv_core("SOLVEPNP_ITERATIVE"), minimum=MINIMUM_POINTS, where="opencv_iterative",
        flat_share=FLAT_SHARE,
    )  # fmt: skip
