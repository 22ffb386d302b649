"""Direct linear transform: the 3 x 4 matrix of least algebraic error, its rotation part made a rotation afterwards.

Needs 6 points of a solid target; of flat ones the matrix is not determined (`Status.WRONG_KIND`), and of nearly flat
ones its column across the plane only as well as noise is small against what the points off the plane shift. Whether
it is the matrix itself tells: the left 3 x 3 block is a rotation times a number, all three singular values one. Where
the largest of a nearly flat target's is above 1.5 times the least, or the block a mirror's, there is no pose
(`Status.NO_POSE`). With 6 to 60 points 1 to 10 % off a plane and 0.02 to 1 px of noise on 100 px that leaves 0.2 % of
the problems at most with a pose off by more than 15 deg, where up to 92 % had one, and refuses right poses of a quarter
at most; without noise it refuses none.

For other solid targets the pose is given as the matrix has it. With 6 points noise can turn that far off: at a spread
across the plane of a fifth of the whole 0.2 px on 100 do by more than 15 deg in one half. The cost tells.

Source: Hartley and Zisserman, Multiple View Geometry, 2nd ed., section 7.1, with normalised points and images; the
rotation by the nearest one to the left 3 x 3 block.
"""

import numpy as np

from uwsim.pose.batches import FLAT_SHARE, NEARLY_FLAT, Centred, Poses, flat_up_to, scatter_of, solved
from uwsim.pose.control_points import nearest_rotation
from uwsim.pose.solution import Solution

MINIMUM_POINTS = 6
PLANAR_OK = False
NEEDS = ()
_MOST_UNLIKE = 1.5


def solve(points_m: np.ndarray, points: np.ndarray) -> Solution:
    """Return camera_from_target for target points (B, n, 3) [m] seen at normalised image points (B, n, 2).

    Degenerate or flat targets, nearly flat ones whose matrix is no rotation's, points behind the camera: not ok. Fewer
    than 6 points, NaN or other shapes: ValueError.
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
    lengths = np.linalg.svd(matrix[..., :3], compute_uv=False)
    unlike = (lengths[:, 0] > _MOST_UNLIKE * lengths[:, 2]) | (np.linalg.det(matrix[..., :3]) < 0)
    rotation[unlike & flat_up_to(NEARLY_FLAT, scatter_of(target))] = np.nan
    return Poses(rotation, matrix[..., 3] / lengths.mean(axis=1)[:, None])
