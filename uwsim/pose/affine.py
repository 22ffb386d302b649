"""Poses in closed form from cameras that are affine about the target: para-perspective and weak perspective.

With the centroid at depth z seen at (u0, v0), rows i, j, k of the rotation and eps = k.p / z, a point's image is
exactly u = (u0 + i.p / z) / (1 + eps). Para-perspective drops the second order in p / z: u - u0 = (i - u0 k).p / z, and
so for v: W = D R / z with D = [[1, 0, -u0], [0, 1, -v0]]. Weak perspective drops eps altogether: D = [[1, 0, 0],
[0, 1, 0]]. The rows of D span the plane across n, the unit vector to the centroid, and D D^T = A = L L^T: so
z L^-1 W has orthonormal rows a, b, and R = D^T L^-T [a; b] + n (a x b)^T is a rotation without any averaging.

Source: Horaud, Dornaika, Lamiroy and Christy, IJCV 22(2), 1997, for the projections; dissertation 5.17-5.21, of which
this uses all three constraints on W instead of two (the printed way: `uwsim.pose.affine_printed`).
"""

import numpy as np

from uwsim.pose.batches import Centred, Poses, least


def paraperspective_start(centred: Centred) -> Poses:
    """Return poses of the para-perspective camera; of a flat target's two the one of less reprojection error, and both.

    Second-order in size by distance: exact for images of that camera.
    """
    middle = centred.image.mean(axis=1)
    return _start(centred, middle)


def weak_perspective_start(centred: Centred) -> Poses:
    """Return poses of the weak-perspective camera, as `paraperspective_start`; first-order, worse off the axis."""
    return _start(centred, np.zeros((len(centred.image), 2)))


def _start(centred: Centred, tilt: np.ndarray) -> Poses:
    """Return poses of the affine camera whose D has -tilt (B, 2) as its last column."""
    middle = centred.image.mean(axis=1)
    across, factor = _across(tilt)
    scaled = _whitened(affine_rows(centred, middle), factor)
    if centred.flat:
        depth, rows = _flat_rows(scaled)
        # both signs of the component along the normal fit
        both = np.stack([rows, rows * [1, 1, -1]])
        rotation = _rotation(both, across, factor, tilt)
        place = np.broadcast_to(placed_at(depth, middle), (2, *depth.shape, 3))
        return least(Poses(rotation, place), centred)
    depth, rows = _solid_rows(scaled)
    return Poses(_rotation(rows, across, factor, tilt), placed_at(depth, middle))


def mirrored(pose: Poses) -> Poses:
    """Return the other poses that affine images of flat targets fit, third axis the normal, from one each.

    The plane is mirrored in one across the line of sight to the centroid, which moves points along that line alone.
    """
    sight = pose.translation / np.linalg.norm(pose.translation, axis=1, keepdims=True)
    along = (sight[:, None] @ pose.rotation) * [1, 1, -1]
    return Poses(pose.rotation * [1, 1, -1] - 2 * sight[:, :, None] * along, pose.translation)


def placed_at(depth: np.ndarray, middle: np.ndarray) -> np.ndarray:
    """Return places (B, 3) at depths (B,) seen at `middle` (B, 2)."""
    return depth[:, None] * np.concatenate([middle, np.ones((len(depth), 1))], axis=1)


def affine_rows(centred: Centred, middle: np.ndarray) -> np.ndarray:
    """Return W (B, 2, 3) of least squares, of a flat target (B, 2, 2) in its plane."""
    target = centred.target[..., :2] if centred.flat else centred.target
    transposed = np.swapaxes(target, 1, 2)
    return np.swapaxes(np.linalg.solve(transposed @ target, transposed @ (centred.image - middle[:, None])), 1, 2)


def _across(tilt: np.ndarray) -> tuple[np.ndarray, tuple[np.ndarray, ...]]:
    """Return the unit vectors n (B, 3) and the Cholesky factor (l11, l21, l22) of A."""
    u, v = tilt.T
    l11 = np.sqrt(1 + u * u)
    l21 = u * v / l11
    l22 = np.sqrt(1 + v * v - l21 * l21)
    across = np.stack([u, v, np.ones_like(u)], axis=1)
    return across / np.linalg.norm(across, axis=1, keepdims=True), (l11, l21, l22)


def _whitened(rows: np.ndarray, factor: tuple[np.ndarray, ...]) -> np.ndarray:
    """Return L^-1 W."""
    l11, l21, l22 = (part[:, None] for part in factor)
    first = rows[:, 0] / l11
    return np.stack([first, (rows[:, 1] - l21 * first) / l22], axis=1)


def _gram(rows: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    return tuple(np.einsum("bk,bk->b", rows[:, i], rows[:, j]) for i, j in ((0, 0), (0, 1), (1, 1)))


def _solid_rows(scaled: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return depth (B,), and a, b (B, 2, 3): the nearest orthonormal rows, and the mean of both lengths."""
    xx, xy, yy = _gram(scaled)
    root = np.sqrt(np.maximum(xx * yy - xy * xy, 0))
    total = np.sqrt(xx + yy + 2 * root)  # the sum of the two singular values
    # square root of the Gram matrix is (G + root) / total, and its determinant is root
    with np.errstate(divide="ignore", invalid="ignore"):
        p, q, r = (yy + root) / (total * root), -xy / (total * root), (xx + root) / (total * root)
        depth = 2 / total
        first, second = scaled[:, 0], scaled[:, 1]
        rows = np.stack(
            [p[:, None] * first + q[:, None] * second, q[:, None] * first + r[:, None] * second], axis=1
        )  # fmt: skip
    return depth, rows


def _flat_rows(scaled: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return depth (B,), and a, b (B, 2, 3) with one sign of the component along the normal.

    N N^T + m m^T = 1 / z^2 for the part N in the plane and m along the normal: 1 / z^2 is the greater eigenvalue of
    N N^T, and m the eigenvector of the other, as long as the root of their difference.
    """
    xx, xy, yy = _gram(scaled)
    half = np.hypot((xx - yy) / 2, xy)
    greater = (xx + yy) / 2 + half
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = 1 / np.sqrt(greater)
    # m m^T = greater - N N^T, of rank one: its own columns give m, the sign of xy the relative one
    normal = np.stack(
        [np.sqrt(np.maximum(greater - xx, 0)), -np.sign(xy + (xy == 0)) * np.sqrt(np.maximum(greater - yy, 0))], axis=1
    )
    return depth, depth[:, None, None] * np.concatenate([scaled, normal[..., None]], axis=2)


def _rotation(
    rows: np.ndarray, across: np.ndarray, factor: tuple[np.ndarray, ...], tilt: np.ndarray
) -> np.ndarray:  # fmt: skip
    """Return D^T L^-T [a; b] + n (a x b)^T, (..., B, 3, 3)."""
    l11, l21, l22 = (part[:, None] for part in factor)
    a, b = rows[..., 0, :], rows[..., 1, :]
    second = b / l22
    first = (a - l21 * second) / l11
    third = -tilt[:, :1] * first - tilt[:, 1:] * second
    return np.stack([first, second, third], axis=-2) + across[:, :, None] * np.cross(a, b)[..., None, :]
