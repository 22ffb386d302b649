"""Rigid transforms `target_from_source` as (4, 4) matrices [m]. World: z up; camera: x right, y down, z forward."""

import numpy as np
from scipy.spatial.transform import Rotation

Pose = np.ndarray


def from_parts(rotation: np.ndarray, translation_m: np.ndarray) -> Pose:
    """Return the (4, 4) transform with rotation (3, 3) and translation (3,)."""
    pose = np.eye(4)
    pose[:3, :3] = rotation
    pose[:3, 3] = translation_m
    return pose


def _right(forward: np.ndarray) -> np.ndarray:
    """Horizontal unit vector to the right of `forward`; world y is up for a vertical one."""
    up = np.array([0.0, 0.0, 1.0])
    if np.linalg.norm(np.cross(forward, up)) < 1e-6:
        up = np.array([0.0, 1.0, 0.0])
    right = np.cross(forward, up)
    return right / np.linalg.norm(right)


def _direction(origin, target, *, where: str) -> np.ndarray:
    offset = np.asarray(target, float) - np.asarray(origin, float)
    if np.linalg.norm(offset) < 1e-9:
        raise ValueError(f"{where}: the position and the point looked at coincide at {list(map(float, origin))}")
    return offset / np.linalg.norm(offset)


def looking_at(position_m, target_m, *, roll_deg: float = 0.0, where: str = "pose") -> Pose:
    """Return world_from_camera of a camera at `position_m` that looks at `target_m`; roll is about its axis.

    Raises ValueError if the two points coincide.
    """
    forward = _direction(position_m, target_m, where=where)
    right = _right(forward)
    rotation = np.stack([right, np.cross(forward, right), forward], axis=1)
    rotation = rotation @ Rotation.from_euler("z", roll_deg, degrees=True).as_matrix()
    return from_parts(rotation, position_m)


def facing(position_m, target_m, *, where: str = "pose") -> Pose:
    """Return world_from_body of a flat body whose face (+z) looks at `target_m`; x to its right seen from there."""
    normal = _direction(position_m, target_m, where=where)
    right = -_right(normal)
    return from_parts(np.stack([right, np.cross(normal, right), normal], axis=1), position_m)


def rotated(pose: Pose, rotation_deg) -> Pose:
    """Return `pose` turned about its own x, then y, then z axes by `rotation_deg` (3,)."""
    turn = np.eye(4)
    turn[:3, :3] = Rotation.from_euler("XYZ", rotation_deg, degrees=True).as_matrix()
    return pose @ turn


def through_exposure(world_from_rig: Pose, *, velocity_m_per_s, rotation_deg_per_s, times_s: np.ndarray) -> np.ndarray:
    """Return poses (n, 4, 4) of a rig in uniform motion; `world_from_rig` is its pose at time 0.

    Velocity and rotation rate are along and about the rig's own axes at time 0.
    """
    times_s = np.asarray(times_s, float)
    motion = np.tile(np.eye(4), (len(times_s), 1, 1))
    turns = np.radians(np.asarray(rotation_deg_per_s, float)) * times_s[:, None]
    motion[:, :3, :3] = Rotation.from_rotvec(turns).as_matrix()
    motion[:, :3, 3] = np.asarray(velocity_m_per_s, float) * times_s[:, None]
    return world_from_rig @ motion


def screw(twists: np.ndarray) -> np.ndarray:
    """Return the motions (..., 4, 4) at the end of constant twists (..., 6): turn [rad], shift [m], in the own frame.

    The exponential of SE(3): a turn about, and a shift along, one line in space.
    Source: Murray, Li & Sastry 1994, A Mathematical Introduction to Robotic Manipulation, eq. 2.36.
    """
    twists = np.asarray(twists, float)
    result = np.zeros((*twists.shape[:-1], 4, 4))
    turns = twists[..., :3].reshape(-1, 3)
    result[..., :3, :3] = Rotation.from_rotvec(turns).as_matrix().reshape(*twists.shape[:-1], 3, 3)
    result[..., :3, 3] = np.einsum("...ij,...j->...i", _shift_per_twist(twists[..., :3]), twists[..., 3:])
    result[..., 3, 3] = 1.0
    return result


def twist(motions: np.ndarray) -> np.ndarray:
    """Return the constant twists (..., 6) that make motions (..., 4, 4), inverse to `screw`; turns below 180 deg."""
    motions = np.asarray(motions, float)
    turns = Rotation.from_matrix(motions[..., :3, :3].reshape(-1, 3, 3)).as_rotvec()
    turns = turns.reshape(*motions.shape[:-2], 3)
    shifts = np.linalg.solve(_shift_per_twist(turns), motions[..., :3, 3:])[..., 0]
    return np.concatenate([turns, shifts], axis=-1)


def _shift_per_twist(turns: np.ndarray) -> np.ndarray:
    """Return V (..., 3, 3) of rotation vectors (..., 3) [rad]: a twist (w, v) ends at V(w) v."""
    angle = np.linalg.norm(turns, axis=-1)[..., None, None]
    x, y, z = np.moveaxis(turns, -1, 0)
    none = np.zeros_like(x)
    cross = np.stack([none, -z, y, z, none, -x, -y, x, none], axis=-1).reshape(*turns.shape, 3)
    first = 0.5 * np.sinc(angle / (2 * np.pi)) ** 2  # (1 - cos a) / a^2
    # (a - sin a) / a^3, which loses its digits for small angles
    large = np.where(angle > 0.05, angle, 1.0)
    series = 1 / 6 - angle**2 / 120 + angle**4 / 5040
    second = np.where(angle > 0.05, (large - np.sin(large)) / large**3, series)
    return np.eye(3) + first * cross + second * (cross @ cross)


def interpolate(poses: np.ndarray, *, knots_s: np.ndarray, times_s: np.ndarray) -> np.ndarray:
    """Return poses (n, 4, 4) at `times_s` (n,) of a path through `poses` (k, 4, 4) at `knots_s` (k,), k >= 2.

    Between two knots the twist is constant: the shortest screw motion. Raises ValueError unless the knots increase
    and all times lie within them.
    Source: geodesics of SE(3), pose(t) = P exp(s log(P^-1 Q)) with s from 0 at P to 1 at Q.
    Valid: turns of less than 180 degrees from knot to knot.
    """
    poses, knots_s, times_s = (np.asarray(values, float) for values in (poses, knots_s, times_s))
    if poses.shape != (len(knots_s), 4, 4) or len(knots_s) < 2:
        raise ValueError(f"interpolate: got poses {poses.shape} at {len(knots_s)} knots, allowed: (k, 4, 4), k >= 2")
    check_increasing(knots_s, where="interpolate knots_s")
    if np.any((times_s < knots_s[0]) | (times_s > knots_s[-1])):
        raise ValueError(
            f"interpolate: got times {times_s.min():g} to {times_s.max():g} s, "
            f"allowed: {knots_s[0]:g} to {knots_s[-1]:g} s (the knots)"
        )
    twists = twist(inverse(poses[:-1]) @ poses[1:])
    piece = np.clip(np.searchsorted(knots_s, times_s, side="right") - 1, 0, len(knots_s) - 2)
    share = (times_s - knots_s[piece]) / (knots_s[piece + 1] - knots_s[piece])
    return poses[piece] @ screw(share[:, None] * twists[piece])


def check_increasing(times_s, *, where: str) -> None:
    """Raise ValueError that names the first two times that do not increase."""
    times_s = np.asarray(times_s, float)
    for index in np.flatnonzero(~(np.diff(times_s) > 0))[:1]:
        raise ValueError(
            f"{where}: got {times_s[index]:g} s before {times_s[index + 1]:g} s, allowed: strictly increasing times"
        )


def inverse(pose: Pose) -> Pose:
    """Return source_from_target of rigid transforms (..., 4, 4)."""
    result = np.zeros_like(pose)
    result[..., :3, :3] = np.swapaxes(pose[..., :3, :3], -1, -2)
    result[..., :3, 3] = -np.einsum("...ji,...j->...i", pose[..., :3, :3], pose[..., :3, 3])
    result[..., 3, 3] = 1.0
    return result


def apply(pose: Pose, points_m: np.ndarray) -> np.ndarray:
    """Transform points (..., 3)."""
    return points_m @ pose[:3, :3].T + pose[:3, 3]


def apply_each(poses: np.ndarray, points_m: np.ndarray) -> np.ndarray:
    """Transform points (..., 3), each by its own pose (..., 4, 4)."""
    return np.einsum("...ij,...j->...i", poses[..., :3, :3], points_m) + poses[..., :3, 3]
