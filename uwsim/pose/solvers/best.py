"""The pose of least reprojection error, sought from several starts: what to use if nothing else is known.

Para-perspective and `parallel` starts (both of a flat target's) are refined by Levenberg-Marquardt over rotation and
translation, and the least reprojection error counts. RPnP joins where they end in different minima, where fewer than
five points hold the pose, and where the error is above a hundredth of the image's own spread; where its minimum is
another one still, DLS, OPnP and 12 rotations over all directions join too. Neither noise nor truth is needed for that.

`extra="always"` asks RPnP on every problem, `extra="never"` on none.

Source: this project; its starts are in `paraperspective`, `parallel`, `rpnp`, `dls` and `opnp`.
"""

from functools import partial
from typing import get_args

import numpy as np

from uwsim.pose.batches import solved
from uwsim.pose.search import Extra, least_reprojection_pose
from uwsim.pose.solution import Solution

MINIMUM_POINTS = 4
PLANAR_OK = True
NEEDS = ()


def solve(points_m: np.ndarray, points: np.ndarray, *, extra: Extra = "needed") -> Solution:
    """Return camera_from_target for target points (B, n, 3) [m] seen at normalised image points (B, n, 2).

    For flat and nearly flat targets the other minimum, where there is one, is the `twin`. Degenerate points: not ok.
    Fewer than 4 points, NaN, other shapes or another `extra`: ValueError.
    """
    if extra not in get_args(Extra):
        raise ValueError(f"best: extra is {extra!r}, allowed: {', '.join(get_args(Extra))}")
    core = partial(least_reprojection_pose, extra=extra)
    return solved(points_m, points, core, minimum=MINIMUM_POINTS, where="best")
