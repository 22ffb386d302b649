"""Para-perspective start only: the closed-form pose of an affine camera about the centroid, no iteration.

Errors fall with the square of size by distance; what noise allows is not reached near the camera. The mathematics is
in `uwsim.pose.affine`.

Source: Horaud et al., IJCV 22(2), 1997; dissertation 5.17-5.21.
Errata: 5.19 as printed divides by |I_p| twice, the second is |J_p|; 5.17 holds for a reference point that is seen, here
the centroid; and [i j k] of 5.21 is not orthonormal, which the closed form is.
"""

import numpy as np

from uwsim.pose.affine import paraperspective_start
from uwsim.pose.batches import solved
from uwsim.pose.solution import Solution

MINIMUM_POINTS = 4
PLANAR_OK = True
NEEDS = ()


def solve(points_m: np.ndarray, points: np.ndarray) -> Solution:
    """Return camera_from_target for target points (B, n, 3) [m] seen at normalised image points (B, n, 2).

    A flat target has two poses, the other is the `twin`. Degenerate points, points behind the camera: not ok. Fewer
    than 4 points, NaN or other shapes: ValueError.
    """
    return solved(points_m, points, paraperspective_start, minimum=MINIMUM_POINTS, where="paraperspective")
