"""Points as weighted means of four control points (three for a flat target), and what images say about those.

x stacks the control points in the camera, (c1x, c1y, c1z, c2x, ...). Each image point gives two rows of M x = 0:
sum_j alpha_j (c_jx - u c_jz) = 0, and so for v. Noise leaves M^T M no exact null space beyond that of few points: 4, 2
and 1 dimensions for 4, 5 and more solid points, 1 for a flat target; its vectors of least eigenvalue stand for it.

Source: Lepetit, Moreno-Noguer and Fua, IJCV 81(2), 2009, sections 3.1-3.3; dissertation 5.4-5.9.
Errata: 5.9 speaks of eigenvalues zero; 5.4 asks for control points that are not coplanar, which no flat target has.
"""

from typing import NamedTuple

import numpy as np

from uwsim.pose.batches import Centred, Poses, scatter_of

PAIRS = {4: ((0, 0, 0, 1, 1, 2), (1, 2, 3, 2, 3, 3)), 3: ((0, 0, 1), (1, 2, 2))}
"""First and second control points of all distances."""


class Controls(NamedTuple):
    """Control points (B, m, 3) of targets, weights alpha (B, n, m), squares of their distances (B, pairs)."""

    points: np.ndarray
    weights: np.ndarray
    distances2: np.ndarray


def control_points(centred: Centred) -> Controls:
    """Return the tips of the principal axes, as long as the spread along them, and the centroid last."""
    target = centred.target
    even = centred.flat and not centred.relief
    count = 2 if even else 3
    scatter = scatter_of(target)
    if even:
        spread = np.sqrt(scatter[:, (0, 1), (0, 1)])
        axes = np.broadcast_to(np.eye(3)[:, :2], (len(target), 3, 2))
    else:
        values, axes = np.linalg.eigh(scatter)
        spread = np.sqrt(np.maximum(values, 1e-300))
    points = np.zeros((len(target), count + 1, 3))
    points[:, :count] = spread[:, :, None] * np.swapaxes(axes, 1, 2)
    weights = np.empty((*target.shape[:2], count + 1))
    weights[..., :count] = target @ axes / spread[:, None]
    weights[..., count] = 1 - weights[..., :count].sum(axis=2)
    first, second = PAIRS[count + 1]
    return Controls(points, weights, ((points[:, first] - points[:, second]) ** 2).sum(axis=2))


def eigenvectors(
    weights: np.ndarray, image: np.ndarray, depth: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Return eigenvalues (B, 3 m), least first, and vectors (B, 3 m, 3 m) of M^T M for images (B, n, 2).

    With depths (B, n) each pair of rows is divided by its own: M x is then the error of the image point.
    """
    u, v = image[..., 0], image[..., 1]
    ones = np.ones_like(u)
    share = ones if depth is None else 1 / depth**2
    columns = np.swapaxes(weights, 1, 2)
    plain, by_u, by_v, by_both = (
        columns @ (weights * (share * part)[..., None]) for part in (ones, u, v, u * u + v * v)
    )
    count = weights.shape[2]
    matrix = np.zeros((len(weights), count, 3, count, 3))
    matrix[:, :, 0, :, 0] = matrix[:, :, 1, :, 1] = plain
    matrix[:, :, 0, :, 2] = matrix[:, :, 2, :, 0] = -by_u
    matrix[:, :, 1, :, 2] = matrix[:, :, 2, :, 1] = -by_v
    matrix[:, :, 2, :, 2] = by_both
    return np.linalg.eigh(matrix.reshape(len(weights), 3 * count, 3 * count))


def differences(vectors: np.ndarray) -> np.ndarray:
    """Return what vectors (B, 3 m, N) say about the difference of each pair of control points, (B, pairs, 3, N)."""
    parts = vectors.reshape(len(vectors), -1, 3, vectors.shape[2])
    first, second = PAIRS[parts.shape[1]]
    return parts[:, first] - parts[:, second]


def in_camera(pose: Poses, controls: Controls) -> np.ndarray:
    """Return control points (B, m, 3) moved by poses."""
    return controls.points @ np.swapaxes(pose.rotation, 1, 2) + pose.translation[:, None]


def pose_of(stacked: np.ndarray, controls: Controls, centred: Centred) -> Poses:
    """Return the poses that put targets nearest to where control points x (B, 3 m), of either sign, put them.

    Source: Horn, Hilden and Negahdaripour, JOSA A 5(7), 1988: absolute orientation.
    """
    camera = controls.weights @ stacked.reshape(len(stacked), -1, 3)
    camera = camera * np.where(camera[..., 2].sum(axis=1) < 0, -1.0, 1.0)[:, None, None]
    return absolute_orientation(centred.target, camera)


def absolute_orientation(target: np.ndarray, camera: np.ndarray) -> Poses:
    """Return poses that bring centred points (B, n, 3) nearest to points (B, n, 3); NaN where those are not finite."""
    known = np.all(np.isfinite(camera), axis=(1, 2))
    camera = np.where(known[:, None, None], camera, 0.0)
    middle = camera.mean(axis=1)
    rotation = nearest_rotation(np.swapaxes(camera, 1, 2) @ target)
    return Poses(np.where(known[:, None, None], rotation, np.nan), middle)


def nearest_rotation(matrix: np.ndarray) -> np.ndarray:
    """Return the rotation R (..., 3, 3) of greatest trace R^T matrix."""
    left, _, right = np.linalg.svd(matrix)
    mirrored = np.linalg.det(left) * np.linalg.det(right) < 0
    left[..., 2] = np.where(mirrored[..., None], -left[..., 2], left[..., 2])
    return left @ right
