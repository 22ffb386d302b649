"""Algebraic image error weighted by depth, over quaternions of any length.

With the rotation divided by the mean depth, R' = R / z, and centred points, a point's depth in units of z is
1 + r3'.p, and u (1 + r3'.p) = r1'.p + t1' is linear in R' and t'. The best t' leaves r^T Q r - 2 b.r + c in the nine
entries r of R', which are quadratic in a quaternion whose square of length is 1 / z.

Source: Zheng, Kuang, Sugimoto, Astrom and Okutomi, ICCV 2013, "Revisiting the PnP problem".
"""

from typing import NamedTuple

import numpy as np

from uwsim.pose.batches import Centred, Poses
from uwsim.pose.multistart import STARTS, from_starts, gathered, tetrahedral_rotations
from uwsim.pose.reprojection import Errors


class _Cost(NamedTuple):
    """Q (B, 9, 9), b (B, 9), c (B,); means of the images (B, 2) and of u p and v p (B, 2, 3), of which t' follows."""

    matrix: np.ndarray
    linear: np.ndarray
    constant: np.ndarray
    middle: np.ndarray
    moments: np.ndarray


def depth_weighted_pose(centred: Centred) -> Poses:
    """Return the poses of least depth-weighted error of 12 starts with all points before the camera."""
    cost = _cost(centred)
    matrix_of, linear_of = gathered(cost.matrix, STARTS), gathered(cost.linear, STARTS)
    constant_of = gathered(cost.constant, STARTS)
    squares = _entries_of_products()

    def evaluate(state, index):
        (quaternion,) = state
        slope = 2 * np.einsum("kij,jb->ikb", squares, quaternion)
        entries = np.einsum("ikb,ib->kb", slope, quaternion) / 2
        matrix, linear = matrix_of(index), linear_of(index)
        pull = np.einsum("ijb,jb->ib", matrix, entries) - linear
        bent = np.einsum("ijb,kjb->kib", matrix, slope)
        return Errors(
            np.einsum("ib,ib->b", entries, pull - linear) + constant_of(index),
            np.einsum("kib,ib->kb", slope, pull),
            np.einsum("kib,lib->klb", slope, bent),
        )

    def poses(state):
        return _poses(state[0], cost, len(centred.target))

    return from_starts((_starts(cost),), evaluate, lambda state, step: (state[0] + step,), poses, centred)


def _cost(centred: Centred) -> _Cost:
    target, image = centred.target, centred.image
    middle = image.mean(axis=1)
    apart = image - middle[:, None]
    turned = -image[..., None] * target[:, :, None]
    moments = -turned.mean(axis=1)
    turned = turned + moments[:, None]
    count = len(target)
    matrix = np.zeros((count, 3, 3, 3, 3))
    scatter = np.swapaxes(target, 1, 2) @ target
    matrix[:, 0, :, 0] = matrix[:, 1, :, 1] = scatter
    linear = np.zeros((count, 3, 3))
    for row in range(2):
        cross = np.swapaxes(target, 1, 2) @ turned[:, :, row]
        matrix[:, row, :, 2], matrix[:, 2, :, row] = cross, np.swapaxes(cross, 1, 2)
        matrix[:, 2, :, 2] += np.swapaxes(turned[:, :, row], 1, 2) @ turned[:, :, row]
        linear[:, row] = np.einsum("bni,bn->bi", target, apart[..., row])
        linear[:, 2] += np.einsum("bni,bn->bi", turned[:, :, row], apart[..., row])
    constant = (apart**2).sum(axis=(1, 2))
    return _Cost(matrix.reshape(count, 9, 9), linear.reshape(count, 9), constant, middle, moments)


def _entries_of_products() -> np.ndarray:
    """Return T (9, 4, 4) with which entry k of the rotation matrix is q^T T_k q, q = (w, x, y, z)."""
    w, x, y, z = np.eye(4)

    def pair(first, second):
        return (np.outer(first, second) + np.outer(second, first)) / 2

    def square(*signs):
        return np.diag(np.array(signs, float))

    return np.array(
        [
            square(1, 1, -1, -1), 2 * (pair(x, y) - pair(w, z)), 2 * (pair(x, z) + pair(w, y)),
            2 * (pair(x, y) + pair(w, z)), square(1, -1, 1, -1), 2 * (pair(y, z) - pair(w, x)),
            2 * (pair(x, z) - pair(w, y)), 2 * (pair(y, z) + pair(w, x)), square(1, -1, -1, 1),
        ]
    )  # fmt: skip


def _starts(cost: _Cost) -> np.ndarray:
    """Return quaternions (4, B * starts) of the start rotations, each as long as suits it best."""
    from scipy.spatial.transform import Rotation

    turns = tetrahedral_rotations()
    entries = turns.reshape(STARTS, 9)
    along = cost.linear @ entries.T
    across = np.einsum("si,bij,sj->bs", entries, cost.matrix, entries)
    # a start on the wrong side begins far away
    inverse_depth = np.maximum(along / across, 1e-3 * np.abs(along / across).max(axis=1, keepdims=True))
    quaternion = Rotation.from_matrix(turns).as_quat(scalar_first=True)
    return (np.sqrt(inverse_depth)[..., None] * quaternion).reshape(-1, 4).T.copy()


def _poses(quaternion: np.ndarray, cost: _Cost, count: int) -> Poses:
    length2 = np.maximum((quaternion**2).sum(axis=0), 1e-300)
    entries = np.einsum("ib,kij,jb->bk", quaternion, _entries_of_products(), quaternion) / length2[:, None]
    rotation = entries.reshape(count, STARTS, 3, 3)
    depth = (1 / length2).reshape(count, STARTS, 1)
    shift = depth * cost.middle[:, None] + np.einsum("bri,bsi->bsr", cost.moments, rotation[:, :, 2])
    return Poses(rotation, np.concatenate([shift, depth], axis=2))
