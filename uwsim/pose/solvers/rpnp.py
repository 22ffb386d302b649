"""RPnP: the edge between two points is placed so that all triangles on it fit, then the rest follows linearly.

The edge is that of the two points seen farthest apart. Let d1, d2 be its ends' distances from the camera, c, s cosine
and sine between their lines of sight, and d2 / d1 = c + s xi: then the edge squared is d1^2 q with q = s^2 (1 + xi^2).
For a third point at y d1, with its cosines c1, c2 to the ends and its sides a, b to them in units of the edge, the law
of cosines gives

    (y - c1)^2 = a^2 q - s1^2,    (d2 / d1)^2 + y^2 - 2 (d2 / d1) y c2 = b^2 q.

Their difference is linear in y: y = N / (2 L) with L = c1 - (c + s xi) c2 and N = 1 - (c + s xi)^2 + (b^2 - a^2) q.
Put into the first it is a quartic of xi, (N - 2 c1 L)^2 = 4 L^2 (a^2 q - s1^2), whose coefficients after division by
s^4 are of the size of 1 at any distance. Each third point gives one, divided by a^2 + b^2 because noise moves those of
long sides more; the least sum of their squares lies at roots of its derivative, of degree 7. Each minimum places the
edge; the turn about it (cosine, sine) and the shift solve linear equations, and every point then moves to its line of
sight, where the target is fitted to them. Of up to four minima the least reprojection error counts.

Source: Li, Xu and Xie, IEEE PAMI 34(7), 2012, "A robust O(n) solution to the perspective-n-point problem"; the quartic
is derived anew.
"""

import numpy as np

from uwsim.pose.batches import solved
from uwsim.pose.edge_placing import by_placed_edges
from uwsim.pose.solution import Solution

MINIMUM_POINTS = 4
PLANAR_OK = True
NEEDS = ()


def solve(points_m: np.ndarray, points: np.ndarray) -> Solution:
    """Return camera_from_target for target points (B, n, 3) [m] seen at normalised image points (B, n, 2).

    A flat or nearly flat target's second candidate is the `twin`. Degenerate points, points behind the camera: not ok.
    Fewer than 4 points, NaN or other shapes: ValueError.
    """
    return solved(points_m, points, by_placed_edges, minimum=MINIMUM_POINTS, where="rpnp")
