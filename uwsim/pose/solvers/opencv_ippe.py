"""OpenCV's IPPE: both poses of a flat target in closed form from its homography, one problem at a time.

For targets flat to 1e-6 only (`Status.WRONG_KIND` for others, also a board whose corners have been measured). OpenCV
(4.11, 5.0) loses rotations by exactly 180 deg, those of a flat target that faces the camera, when it makes vectors of
them: its targets come turned. Of exact images of a target seen face-on it makes NaN, by round-off: it gets those again,
squeezed by 1e-14.

Source: Collins and Bartoli, IJCV 109(3), 2014, "Infinitesimal plane-based pose estimation"; `cv2.solvePnPGeneric` with
SOLVEPNP_IPPE.
"""

import numpy as np

from uwsim.pose.batches import FLAT_SHARE, solved
from uwsim.pose.opencv import opencv_core
from uwsim.pose.solution import Solution

MINIMUM_POINTS = 4
PLANAR_OK = True
SOLID_OK = False
NEEDS = ()


def solve(points_m: np.ndarray, points: np.ndarray) -> Solution:
    """Return camera_from_target for target points (B, n, 3) [m] seen at normalised image points (B, n, 2).

    The pose of less reprojection error, the other is the `twin`. Degenerate points, solid targets, points behind the
    camera: not ok. Fewer than 4 points, NaN or other shapes: ValueError.
    """
    return solved(
        points_m,
        points,
        opencv_core("SOLVEPNP_IPPE", mend_frontal=True),
        minimum=MINIMUM_POINTS,
        where="opencv_ippe",
        solid_ok=False,
        flat_share=FLAT_SHARE,
    )
