"""Para-perspective start, then least reprojection error: the fastest to reach what the noise allows.

A flat target's two starts are both refined. Near the camera and far off the basin of the start it can end in another
minimum, which `best` guards against.

Source: start as `paraperspective`; Levenberg-Marquardt over rotation and translation (`uwsim.pose.levenberg`).
"""

import numpy as np

from uwsim.pose.batches import solved
from uwsim.pose.refined import refined_paraperspective
from uwsim.pose.solution import Solution

MINIMUM_POINTS = 4
PLANAR_OK = True
NEEDS = ()


def solve(points_m: np.ndarray, points: np.ndarray) -> Solution:
    """Return camera_from_target for target points (B, n, 3) [m] seen at normalised image points (B, n, 2).

    For flat and nearly flat targets the other minimum, where there is one, is the `twin`. Degenerate points, points
    behind the camera: not ok. Fewer than 4 points, NaN or other shapes: ValueError.
    """
    return solved(points_m, points, refined_paraperspective, minimum=MINIMUM_POINTS, where="paraperspective_lm")
