"""Direct linear transform: the 3 x 4 matrix of least algebraic error, its rotation part made a rotation afterwards.

Needs 6 points of a solid target; of flat ones the matrix is not determined (`Status.WRONG_KIND`).

Source: Hartley and Zisserman, Multiple View Geometry, 2nd ed., section 7.1, with normalised points and images; the
rotation by the nearest one to the left 3 x 3 block.
"""

import numpy as np

from uwsim.pose.batches import FLAT_SHARE, Centred, Poses, solved
from uwsim.pose.control_points import nearest_rotation
from uwsim.pose.solution import Solution

MINIMUM_POINTS = 6
PLANAR_OK = False
NEEDS = ()


def solve(points_m: np.ndarray, points: np.ndarray) -> Solution:
    """Return camera_from_target for target points (B, n, 3) [m] seen at normalised image points (B, n, 2).

    Degenerate or flat targets, points behind the camera: not ok. Fewer than 6 points, NaN or other shapes: ValueError.
    """
    return solved(
        points_m, points, _core, minimum=MINIMUM_POINTS, where="dlt", flat_ok=False, flat_share=FLAT_SHARE
    )  # fmt: skip


def _core(centred: Centred) -> Poses:
    target, image = centred.target, centred.image
    middle = image.mean(axis=1)
    size = np.sqrt(((image - middle[:, None]) ** 2).sum(axis=2).mean(axis=1) / 2)
    u, v = np.moveaxis((image - middle[:, None]) / size[:, None, None], 2, 0)
    homogeneous = np.concatenate([target, np.ones((*u.shape, 1))], axis=2)
    nothing = np.zeros_like(homogeneous)
    rows = np.concatenate(
        [
            np.concatenate([homogeneous, nothing, -u[..., None] * homogeneous], axis=2),
            np.concatenate([nothing, homogeneous, -v[..., None] * homogeneous], axis=2),
        ],
        axis=1,
    )
    matrix = np.linalg.svd(rows)[2][:, -1].reshape(-1, 3, 4)
    # undo the normalisation of the image: x = size x' + middle
    matrix[:, :2] = size[:, None, None] * matrix[:, :2] + middle[:, :, None] * matrix[:, 2:]
    # the centroid is before the camera
    matrix = matrix * np.where(matrix[:, 2, 3] < 0, -1.0, 1.0)[:, None, None]
    rotation = nearest_rotation(matrix[..., :3])
    scale = np.linalg.svd(matrix[..., :3], compute_uv=False).mean(axis=1)
    return Poses(rotation, matrix[..., 3] / scale[:, None])
