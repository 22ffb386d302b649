"""Parallel: EPnP's Gauss-Newton on the betas, started from the para-perspective pose; all distances count alike.

Nearly flat targets (`uwsim.pose.batches.NEARLY_FLAT`) keep four control points, but start from both para-perspective
poses of a flat target: of the third axis of four such points noise leaves no sign.

Source: dissertation 5.14-5.21 with 5.10; about the centroid, and with three control points for flat targets.
"""

import numpy as np

from uwsim.pose.affine import paraperspective_start
from uwsim.pose.batches import Centred, Poses, solved
from uwsim.pose.parallel import from_start
from uwsim.pose.solution import Solution

MINIMUM_POINTS = 4
PLANAR_OK = True
NEEDS = ()


def solve(points_m: np.ndarray, points: np.ndarray) -> Solution:
    """Return camera_from_target for target points (B, n, 3) [m] seen at normalised image points (B, n, 2).

    The two starts of a flat or nearly flat target are both refined; the other pose is the `twin`. Degenerate points,
    points behind the camera: not ok. Fewer than 4 points, NaN or other shapes: ValueError.
    """
    return solved(points_m, points, _core, minimum=MINIMUM_POINTS, where="parallel")


def _core(centred: Centred) -> Poses:
    return from_start(centred, paraperspective_start)
