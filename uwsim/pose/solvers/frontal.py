"""The target faces the camera upright: the do-nothing entry, the score that a solver has to beat.

Target x to the right and y up in the picture, its z towards the camera; distance from the apparent size,
direction from the centroid. Exact for that one orientation of a flat target, and a guess for every other.

Source: weak perspective with the rotation given; Horaud et al., IJCV 22(2), 1997, section 2.
"""

import numpy as np

from uwsim.pose.solution import Solution, Status, accept, check_points, spread_out

MINIMUM_POINTS = 3
PLANAR_OK = True
NEEDS = ()

# camera x right, y down, z forward; target x right, y up, z towards the viewer
CAMERA_FROM_TARGET = np.diag([1.0, -1.0, -1.0])


def solve(points_m: np.ndarray, points: np.ndarray) -> Solution:
    """Return camera_from_target for target points (B, n, 3) [m] seen at normalised image points (B, n, 2).

    Points on one line, images in one point, points behind the camera: not ok. Fewer than 3 points, NaN or
    other shapes: ValueError.
    """
    points_m, points = check_points(points_m, points, minimum=MINIMUM_POINTS, where="frontal")
    centre_m, centre = points_m.mean(axis=1), points.mean(axis=1)
    turned = points_m @ CAMERA_FROM_TARGET.T
    size_m = np.linalg.norm(turned[..., :2] - turned[..., :2].mean(axis=1, keepdims=True), axis=(1, 2))
    size = np.linalg.norm(points - centre[:, None], axis=(1, 2))
    usable = spread_out(points_m, points)
    depth_m = np.where(usable, size_m / np.where(usable, size, 1.0), np.nan)
    middle_m = depth_m[:, None] * np.concatenate([centre, np.ones((len(centre), 1))], axis=1)
    rotation = np.broadcast_to(CAMERA_FROM_TARGET, (len(points_m), 3, 3))
    return accept(
        rotation, middle_m - centre_m @ CAMERA_FROM_TARGET.T, points_m, points,
        status=np.where(usable, Status.OK, Status.DEGENERATE),
    )  # fmt: skip
