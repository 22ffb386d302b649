"""Least reprojection error started at the true pose: an oracle, what the noise of the image points leaves.

Not the least of all minima where noise has made another one lower, as of flat targets; and at the Cramer-Rao bound
wherever errors are small.

Source: Levenberg-Marquardt as `paraperspective_lm`, from the truth.
"""

import numpy as np

from uwsim.pose.polish import polished
from uwsim.pose.solution import Solution, Status, accept, check_points, spread_out

MINIMUM_POINTS = 4
PLANAR_OK = True
NEEDS = ("true_pose",)


def solve(points_m: np.ndarray, points: np.ndarray, *, true_pose: np.ndarray) -> Solution:
    """Return camera_from_target for target points (B, n, 3) [m] seen at normalised image points (B, n, 2).

    `true_pose` (B, 4, 4): camera_from_target. Points on one line, images in one point: not ok. Fewer than 4 points, NaN
    or other shapes: ValueError.
    """
    points_m, points = check_points(points_m, points, minimum=MINIMUM_POINTS, where="oracle_start")
    usable = spread_out(points_m, points)
    rotation = np.array(true_pose[:, :3, :3], float)
    rotation[~usable] = np.nan
    rotation, translation_m, _ = polished(rotation, np.array(true_pose[:, :3, 3], float), points_m, points)
    status = np.where(usable, Status.OK, Status.DEGENERATE)
    return accept(rotation, translation_m, points_m, points, status=status)
