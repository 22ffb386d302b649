"""Para-perspective start only: the closed-form pose of an affine camera about the centroid, no iteration.

Errors fall with the square of size by distance; what noise allows is not reached near the camera. The mathematics is
in `uwsim.pose.affine`.

`form="two_constraints"` is 5.19-5.21 corrected, `form="as_printed"` with the misprint of 5.19; both for solid targets
alone (`Status.WRONG_KIND`), since 5.18 gives of a flat one only the part in its plane, and of a nearly flat one a part
across it that noise has made.

Source: Horaud et al., IJCV 22(2), 1997; dissertation 5.17-5.21.
Errata: 5.19 as printed divides by |I_p| twice, the second is |J_p|; 5.17 holds for a reference point that is seen, here
the centroid; and [i j k] of 5.21 is not orthonormal, which the closed form is.
"""

from functools import partial

import numpy as np

from uwsim.pose.affine import paraperspective_start
from uwsim.pose.affine_printed import two_constraints_start
from uwsim.pose.batches import solved
from uwsim.pose.solution import Solution

MINIMUM_POINTS = 4
PLANAR_OK = True
NEEDS = ()
FORMS = ("closed", "two_constraints", "as_printed")


def solve(points_m: np.ndarray, points: np.ndarray, *, form: str = "closed") -> Solution:
    """Return camera_from_target for target points (B, n, 3) [m] seen at normalised image points (B, n, 2).

    A flat or nearly flat target has two poses, the other is the `twin`. Degenerate points, points behind the camera:
    not ok. Fewer than 4 points, NaN, other shapes or another form: ValueError.
    """
    if form not in FORMS:
        raise ValueError(f"paraperspective: form is {form!r}, allowed: {', '.join(FORMS)}")
    closed = form == "closed"
    core = paraperspective_start if closed else partial(two_constraints_start, misprint=form == "as_printed")
    return solved(points_m, points, core, minimum=MINIMUM_POINTS, where="paraperspective", flat_ok=closed)
