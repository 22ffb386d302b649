"""Batches for what solves one problem at a time."""

from collections.abc import Callable

import numpy as np

from uwsim.pose.solution import Solution, Status, check_points

Found = tuple[np.ndarray, np.ndarray]
"""Rotation (3, 3) and translation (3,) [m], camera_from_target."""


def solved_one_by_one(
    points_m: np.ndarray, points: np.ndarray, find: Callable[[int, np.ndarray, np.ndarray], Found | None], *,
    minimum: int, where: str,
) -> Solution:  # fmt: skip
    """Return what `find(number, points_m (n, 3), points (n, 2))` finds of each problem of a batch; None: no pose.

    Points may lie behind the camera: some may be none of the target's. Raises what `check_points` raises.
    """
    points_m, points = check_points(points_m, points, minimum=minimum, where=where)
    rotation = np.tile(np.eye(3), (len(points), 1, 1))
    translation_m = np.full((len(points), 3), np.nan)
    for number, problem in enumerate(zip(points_m, points, strict=True)):
        pose = find(number, *problem)
        if pose is not None and all(np.all(np.isfinite(part)) for part in pose):
            rotation[number], translation_m[number] = pose
    ok = np.isfinite(translation_m[:, 0])
    return Solution(rotation, translation_m, ok, np.where(ok, Status.OK, Status.NO_POSE).astype(np.int8))
