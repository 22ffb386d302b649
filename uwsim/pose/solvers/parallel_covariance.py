"""Parallel with the weights that follow from the noise: the full covariance of the distances, not a guess of each.

Row pairs of M divided by the points' depths make M x the errors of the images, so noise of variance sigma^2 gives x the
likelihood exp(-x^T M^T M x / (2 sigma^2)), on the condition that the squared distances r(x) are right. Let V1 be the
vectors of least eigenvalues Lam1 that `parallel` keeps, x = V1 beta + V2 gamma, and A = dr/dx. To first order in gamma
the condition is r(V1 beta) + A V2 gamma = 0; the likeliest gamma that meets it is -Lam2^-1 V2^T A^T S^-1 r with
S = A V2 Lam2^-1 V2^T A^T, and what is left for beta is

    beta^T Lam1 beta + r(V1 beta)^T S^-1 r(V1 beta).

Three Gauss-Newton steps from the betas of `parallel`. Efficient to first order: its errors are those of least
reprojection error but for large noise.

Source: this project, in place of dissertation 5.30; sigma cancels.
"""

import numpy as np

from uwsim.pose.batches import solved
from uwsim.pose.parallel import by_covariance
from uwsim.pose.solution import Solution

MINIMUM_POINTS = 4
PLANAR_OK = True
NEEDS = ()


def solve(points_m: np.ndarray, points: np.ndarray) -> Solution:
    """Return camera_from_target for target points (B, n, 3) [m] seen at normalised image points (B, n, 2).

    Of this pose and that of `parallel` the one of less reprojection error; for flat and nearly flat targets from both
    starts, the other pose is the `twin`. Degenerate points, points behind the camera: not ok. Fewer than 4 points, NaN
    or other shapes: ValueError.
    """
    return solved(points_m, points, by_covariance, minimum=MINIMUM_POINTS, where="parallel_covariance")
