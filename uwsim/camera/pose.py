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
