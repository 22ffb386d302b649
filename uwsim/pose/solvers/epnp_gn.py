"""EPnP with Gauss-Newton: every set of betas refined on the distances before the best is taken.

For 4 and 5 points the linear start is often outside the basin of the right minimum.

Nearly flat targets (`uwsim.pose.batches.NEARLY_FLAT`), of which the paper does not speak, are solved by the flat form,
then by Gauss-Newton on the distances of four control points, from that pose and its mirror image: see
`uwsim.pose.epnp`.

Source: Lepetit, Moreno-Noguer and Fua, IJCV 81(2), 2009; three control points for flat targets.
"""

from functools import partial

import numpy as np

from uwsim.pose.batches import solved
from uwsim.pose.epnp import by_linear_equations
from uwsim.pose.solution import Solution

MINIMUM_POINTS = 4
PLANAR_OK = True
NEEDS = ()


def solve(points_m: np.ndarray, points: np.ndarray) -> Solution:
    """Return camera_from_target for target points (B, n, 3) [m] seen at normalised image points (B, n, 2).

    A nearly flat target's other pose is the `twin`. Degenerate points, points behind the camera: not ok. Fewer than 4
    points, NaN or other shapes: ValueError.
    """
    core = partial(by_linear_equations, refine=True)
    return solved(points_m, points, core, minimum=MINIMUM_POINTS, where="epnp_gn")
