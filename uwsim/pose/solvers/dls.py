"""DLS: the rotation of least sum of squared distances between points and their lines of sight, over all rotations.

The published method finds every stationary point from polynomial equations; here its cost is minimised by
Levenberg-Marquardt from 12 rotations no farther than 90 deg from any other, and the least value counts. That finds the
global minimum in all but a few of a thousand problems, and is not certified.

Source: Hesch and Roumeliotis, ICCV 2011, "A direct least-squares (DLS) method for PnP": the cost.
"""

import numpy as np

from uwsim.pose.batches import Centred, Poses, solved
from uwsim.pose.levenberg import exponential, product
from uwsim.pose.object_space import form_of, from_starts, gathered, tetrahedral_rotations, translation_of
from uwsim.pose.reprojection import CHUNK, Errors
from uwsim.pose.solution import Solution

MINIMUM_POINTS = 4
PLANAR_OK = True
NEEDS = ()
_STARTS = 12


def solve(points_m: np.ndarray, points: np.ndarray) -> Solution:
    """Return camera_from_target for target points (B, n, 3) [m] seen at normalised image points (B, n, 2).

    A flat target's second minimum is the `twin`. Degenerate points, points behind the camera: not ok. Fewer than 4
    points, NaN or other shapes: ValueError.
    """
    return solved(points_m, points, _core, minimum=MINIMUM_POINTS, where="dls", chunk=CHUNK // _STARTS)


def _core(centred: Centred) -> Poses:
    form = form_of(centred)
    omega_of = gathered(form.omega, _STARTS)

    def evaluate(state, index):
        (rotation,) = state
        omega, entries = omega_of(index), rotation.reshape(9, -1)
        pull = np.einsum("ijb,jb->ib", omega, entries)
        # of e_k x rotation for each axis
        first, second, third = rotation
        none = np.zeros_like(first)
        slope = np.array([[none, -third, second], [third, none, -first], [-second, first, none]]).reshape(3, 9, -1)
        bent = np.einsum("ijb,kjb->kib", omega, slope)
        return Errors(
            np.einsum("ib,ib->b", entries, pull),
            np.einsum("kib,ib->kb", slope, pull),
            np.einsum("kib,lib->klb", slope, bent),
        )

    def poses(state):
        rotation = np.moveaxis(state[0], -1, 0).reshape(len(centred.target), _STARTS, 3, 3)
        places = translation_of(form, np.swapaxes(rotation, 0, 1))
        return Poses(rotation, np.swapaxes(places, 0, 1))

    starts = np.tile(np.moveaxis(tetrahedral_rotations(), 0, -1), len(centred.target))
    return from_starts(
        (starts,), evaluate, lambda state, step: (product(exponential(step), state[0]),), poses, centred
    )  # fmt: skip
