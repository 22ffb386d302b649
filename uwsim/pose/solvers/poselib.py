"""PoseLib: poses of three points at random, the best refined to least reprojection error, one problem at a time.

Nearly flat targets have no more wrong poses than least reprojection error has. All points count as inliers, the loss is
plain squares, and the draws are the same from call to call.

Source: Larsson and contributors, PoseLib, github.com/PoseLib/PoseLib; `poselib.estimate_absolute_pose`.
"""

import numpy as np

from uwsim.pose.batches import FLAT_SHARE, Centred, Poses, solved
from uwsim.pose.solution import Solution

MINIMUM_POINTS = 4
PLANAR_OK = True
NEEDS = ()
REQUIRES = ("poselib",)

# its thresholds are in pixels
_FOCAL_PX = 1000.0
_DRAWS = {"min_iterations": 20, "max_iterations": 100, "max_reproj_error": 1e6, "seed": 0}
_REFINEMENT = {"loss_type": "TRIVIAL", "max_iterations": 50}


def solve(points_m: np.ndarray, points: np.ndarray) -> Solution:
    """Return camera_from_target for target points (B, n, 3) [m] seen at normalised image points (B, n, 2).

    Degenerate points, points behind the camera: not ok. Fewer than 4 points, NaN or other shapes: ValueError.
    """
    return solved(points_m, points, _core, minimum=MINIMUM_POINTS, where="poselib", flat_share=FLAT_SHARE)


def _core(centred: Centred) -> Poses:
    import poselib

    camera = {"model": "SIMPLE_PINHOLE", "width": 1, "height": 1, "params": [_FOCAL_PX, 0.0, 0.0]}
    rotation = np.full((len(centred.target), 3, 3), np.nan)
    translation = np.full((len(centred.target), 3), np.nan)
    for index, (target, image) in enumerate(zip(centred.target, centred.image, strict=True)):
        pose, report = poselib.estimate_absolute_pose(_FOCAL_PX * image, target, camera, _DRAWS, _REFINEMENT)
        if report["num_inliers"] > 0:
            rotation[index], translation[index] = pose.R, pose.t
    return Poses(rotation, translation)
