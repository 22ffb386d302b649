"""Weak-perspective start only: the closed-form pose of an affine camera that looks straight at every target.

Errors fall with size by distance, not with its square as those of `paraperspective`, and are larger off the axis: the
start of `iepnp`, alone.

Source: Horaud et al., IJCV 22(2), 1997; the mathematics is in `uwsim.pose.affine`.
"""

import numpy as np

from uwsim.pose.affine import weak_perspective_start
from uwsim.pose.batches import solved
from uwsim.pose.solution import Solution

MINIMUM_POINTS = 4
PLANAR_OK = True
NEEDS = ()


def solve(points_m: np.ndarray, points: np.ndarray) -> Solution:
    """Return camera_from_target for target points (B, n, 3) [m] seen at normalised image points (B, n, 2).

    A flat or nearly flat target has two poses, the other is the `twin`. Degenerate points, points behind the camera:
    not ok. Fewer than 4 points, NaN or other shapes: ValueError.
    """
    return solved(points_m, points, weak_perspective_start, minimum=MINIMUM_POINTS, where="weak_perspective")
