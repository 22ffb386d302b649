"""PoseLib: LO-RANSAC with P3P, refined on who agrees, with its own options.

Known limit: it always gives a pose, however few points agree with it.

Source: Larsson and contributors, PoseLib, github.com/PoseLib/PoseLib; `poselib.estimate_absolute_pose`.
"""

import numpy as np

from uwsim.pose.one_by_one import Found, solved_one_by_one
from uwsim.pose.solution import Solution

MINIMUM_POINTS = 4
PLANAR_OK = True
NEEDS = ("threshold",)
REQUIRES = ("poselib",)

# its thresholds are in pixels
_FOCAL_PX = 1000.0


def solve(points_m: np.ndarray, points: np.ndarray, *, threshold: float) -> Solution:
    """Return camera_from_target for target points (B, n, 3) [m] seen at normalised image points (B, n, 2).

    `threshold`: reprojection error on the plane z = 1 above which a point is an outlier. The draws are the same from
    call to call. Fewer than 4 points, NaN or other shapes: ValueError.
    """
    import poselib

    camera = {"model": "SIMPLE_PINHOLE", "width": 1, "height": 1, "params": [_FOCAL_PX, 0.0, 0.0]}
    options = {"max_reproj_error": _FOCAL_PX * threshold, "seed": 0}

    def find(number: int, target_m: np.ndarray, image: np.ndarray) -> Found | None:
        pose, report = poselib.estimate_absolute_pose(_FOCAL_PX * image, target_m, camera, options, {})
        return (pose.R, pose.t) if report["num_inliers"] > 0 else None

    return solved_one_by_one(points_m, points, find, minimum=MINIMUM_POINTS, where="poselib_ransac")
