"""LHM, orthogonal iteration: points put on their lines of sight and the target turned to them, by turns.

Each turn lowers the sum of the squared distances from the lines of sight, but by less and less: it stops after 300, and
one start can end in another minimum: with the four corners of a square in 42 % of the problems. Flat and nearly flat
targets (`uwsim.pose.batches.NEARLY_FLAT`) are therefore tried from the mirror image of the first pose, too.

Source: Lu, Hager and Mjolsness, IEEE PAMI 22(6), 2000; both poses of a flat target: Schweighofer and Pinz, IEEE PAMI
28(12), 2006. With the best translation the points on their lines of sight
give sum V (R p + t) p^T = R S - [Omega r], so a turn costs the same for any number of points.
"""

import numpy as np

from uwsim.pose.affine import mirrored
from uwsim.pose.batches import Centred, Poses, least, solved, together
from uwsim.pose.control_points import nearest_rotation
from uwsim.pose.object_space import Form, form_of, translation_of
from uwsim.pose.solution import Solution

MINIMUM_POINTS = 4
PLANAR_OK = True
NEEDS = ()
_TURNS = 300
_TOLERANCE = 1e-10


def solve(points_m: np.ndarray, points: np.ndarray) -> Solution:
    """Return camera_from_target for target points (B, n, 3) [m] seen at normalised image points (B, n, 2).

    A flat or nearly flat target's other pose is the `twin`. Degenerate points, points behind the camera: not ok. Fewer
    than 4 points, NaN or other shapes: ValueError.
    """
    return solved(points_m, points, _core, minimum=MINIMUM_POINTS, where="lhm")


def _core(centred: Centred) -> Poses:
    form = form_of(centred)
    # as if the images were points of a plane across the axis
    apart = centred.image - centred.image.mean(axis=1, keepdims=True)
    flat = np.concatenate([apart, np.zeros((*apart.shape[:2], 1))], axis=2)
    first = _turned(nearest_rotation(np.swapaxes(flat, 1, 2) @ centred.target), form)
    if not centred.flat:
        return first
    return least(together([first, _turned(mirrored(first).rotation, form)]), centred)


def _turned(rotation: np.ndarray, form: Form) -> Poses:
    """Return the poses that turns from rotations (B, 3, 3) end in."""
    index = np.arange(len(rotation))
    omega, scatter = form.omega, form.scatter
    for _ in range(_TURNS):
        now = rotation[index]
        pull = (omega @ now.reshape(-1, 9, 1)).reshape(-1, 3, 3)
        new = nearest_rotation(now @ scatter - pull)
        rotation[index] = new
        going = np.abs(new - now).max(axis=(1, 2)) > _TOLERANCE
        index, omega, scatter = index[going], omega[going], scatter[going]
        if not len(index):
            break
    return Poses(rotation, translation_of(form, rotation))
