"""Whether the housings of camera and lamps stand in each other: cylinders z in [-length, 0] of their front frames."""

import numpy as np

from uwsim.camera import pose
from uwsim.scene.housing import Housing

_TOUCH_M = 1e-4  # what cylinders may stand in each other: rounding of what a scene says
_ROUNDS = 2000


def inside_cylinder(points: np.ndarray, rig_from_front: np.ndarray, housing: Housing) -> np.ndarray:
    """Return which of points (n, 3) in the rig are inside a housing, more than 0.1 mm from its surface, (n,)."""
    local = pose.apply(pose.inverse(rig_from_front), points)
    across = np.hypot(local[:, 0], local[:, 1]) < housing.radius_m - _TOUCH_M
    return across & (local[:, 2] < -_TOUCH_M) & (local[:, 2] > _TOUCH_M - housing.length_m)


def cylinders_overlap(one: tuple[np.ndarray, Housing], other: tuple[np.ndarray, Housing]) -> bool:
    """Whether two cylinders, each (rig_from_front, housing), share room beyond touching.

    Source: alternating projections between convex sets (Cheney & Goldstein 1959, Proc. AMS 10:448): they approach the
    nearest pair of points.
    """
    point = pose.apply(one[0], np.array([0.0, 0.0, -one[1].length_m / 2]))
    for _ in range(_ROUNDS):
        there = _nearest(point, *other)
        back = _nearest(there, *one)
        if np.linalg.norm(back - there) < 1e-9:
            return True
        if np.linalg.norm(back - point) < 1e-12:
            return False
        point = back
    return False


def _nearest(point: np.ndarray, rig_from_front: np.ndarray, housing: Housing) -> np.ndarray:
    """Return the point of a cylinder, thinner and shorter all round by 0.05 mm, that is nearest to a point."""
    local = pose.apply(pose.inverse(rig_from_front), point)
    radius_m, inset_m = max(housing.radius_m - _TOUCH_M / 2, 0.0), min(_TOUCH_M / 2, housing.length_m / 2)
    across = np.hypot(local[0], local[1])
    if across > radius_m:
        local = local * np.array([radius_m / across, radius_m / across, 1.0])
    return pose.apply(
        rig_from_front, np.array([local[0], local[1], np.clip(local[2], inset_m - housing.length_m, -inset_m)])
    )
