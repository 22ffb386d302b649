"""Pose problems with known answers: layouts of markers, poses of a target before a camera, and noisy images.

Layouts and boxes after the dissertation's section 5.4 (its millimetres in metres); readings where it leaves a choice:
the box starts 0.58 m before the camera, and noise is a standard deviation in pixels per coordinate.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

K_PRINTED = np.array([[1301.473508, 0, 653], [0, 1300.926193, 508], [0, 0, 1]])
"""Camera matrix [px] of dissertation 5.32."""
BOX_M = np.array([[-0.5, -0.5, 0.58], [0.5, 0.5, 1.58]])
"""Corners of the box that the target's origin, or each random point, lies in."""

_APEX = np.sqrt(0.5)
_BASE = np.array([[0.5, 0.5, 0], [-0.5, 0.5, 0], [-0.5, -0.5, 0], [0.5, -0.5, 0]])
_TOPS = np.array([[0, 0, _APEX], [0, 0, -_APEX]])

LAYOUTS = {
    "bi6": np.concatenate([_BASE, _TOPS]),
    "py5": np.concatenate([_BASE, _TOPS[:1]]),
    "st4": np.concatenate([_BASE[:2], _TOPS]),
    "pl4": _BASE,
}
"""Edge 1: octahedron (square bipyramid), pyramid on its square, two adjacent base corners and both apices, square."""


class Placed(NamedTuple):
    """Targets (B, n, 3) [m] and where they stand: rotation (B, 3, 3), translation_m (B, 3), camera_from_target."""

    points_m: np.ndarray
    rotation: np.ndarray
    translation_m: np.ndarray


def layout(name: str, *, edge_m: float) -> np.ndarray:
    """Return the points (n, 3) [m] of a layout of LAYOUTS; ValueError for another name or edge."""
    if name not in LAYOUTS:
        raise ValueError(f"layout: got {name!r}, allowed: {', '.join(LAYOUTS)}")
    if not edge_m > 0:
        raise ValueError(f"layout {name}: edge_m is {edge_m}, allowed: above 0 m")
    return edge_m * LAYOUTS[name]


def random_rotations(count: int, *, rng: np.random.Generator) -> np.ndarray:
    """Return rotations (count, 3, 3), uniform over all."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_quat(rng.standard_normal((count, 4))).as_matrix()


def rotation_zxz(angles_rad: np.ndarray) -> np.ndarray:
    """Return rotations (..., 3, 3) by Euler angles alpha, beta, theta (..., 3) about z, the new x and the new z.

    Source: dissertation 5.33.
    Errata: as printed its entries (1, 2) and (2, 2) lack a term each, -cos alpha sin theta and -sin alpha sin theta,
    and the matrix is no rotation.
    """
    from scipy.spatial.transform import Rotation

    angles_rad = np.asarray(angles_rad, float)
    return Rotation.from_euler("ZXZ", angles_rad.reshape(-1, 3)).as_matrix().reshape(*angles_rad.shape[:-1], 3, 3)


def random_euler_rotations(count: int, *, rng: np.random.Generator) -> np.ndarray:
    """Return rotations (count, 3, 3) by three evenly drawn angles of `rotation_zxz`, more of them about z than even."""
    return rotation_zxz(rng.uniform(-np.pi, np.pi, (count, 3)))


def in_box(
    target_m: np.ndarray, *, count: int, rng: np.random.Generator, box_m: np.ndarray = BOX_M,
    nearest_m: float = 0.01, rotations: Callable[..., np.ndarray] = random_rotations,
) -> Placed:  # fmt: skip
    """Return a target (n, 3) [m] in `count` random rotations with its origin evenly in a box (2, 3) [m].

    Poses with a point nearer than `nearest_m` along the axis are drawn again; ValueError where that does not end.
    """
    low, high = np.asarray(box_m, float)
    rotation, translation_m = rotations(count, rng=rng), rng.uniform(low, high, (count, 3))
    for _ in range(100):
        depth_m = rotation[:, 2] @ np.asarray(target_m, float).T + translation_m[:, 2, None]
        near = np.flatnonzero(depth_m.min(axis=1) < nearest_m)
        if not len(near):
            return Placed(np.tile(target_m, (count, 1, 1)), rotation, translation_m)
        rotation[near], translation_m[near] = rotations(len(near), rng=rng), rng.uniform(low, high, (len(near), 3))
    raise ValueError(
        f"poses: {len(near)} of {count} keep a point nearer than {nearest_m} m, allowed: a target that fits there"
    )


def at_depth(
    target_m: np.ndarray, *, depth_m: float, count: int, rng: np.random.Generator, lateral_share: float = 0.4,
    nearest_m: float = 0.01,
) -> Placed:  # fmt: skip
    """Return as `in_box` with the origin at one depth and evenly within +-`lateral_share` of it off the axis."""
    side = lateral_share * depth_m
    box_m = np.array([[-side, -side, depth_m], [side, side, depth_m]])
    return in_box(target_m, count=count, rng=rng, box_m=box_m, nearest_m=nearest_m)


def at_place(
    target_m: np.ndarray, *, place_m: tuple[float, float, float], count: int, rng: np.random.Generator,
    nearest_m: float = 0.01,
) -> Placed:  # fmt: skip
    """Return as `in_box` with the origin at one place [m], for eccentricity."""
    return in_box(target_m, count=count, rng=rng, box_m=np.array([place_m, place_m]), nearest_m=nearest_m)


def at_angle(
    target_m: np.ndarray, *, angle_deg: float, depth_m: float, count: int, rng: np.random.Generator
) -> Placed:  # fmt: skip
    """Return a target on the axis, turned about the camera's y by one angle and about its own z by a random one."""
    from scipy.spatial.transform import Rotation

    about_y = Rotation.from_euler("y", angle_deg, degrees=True)
    about_z = Rotation.from_euler("z", rng.uniform(-180, 180, (count, 1)), degrees=True)
    return Placed(
        np.tile(target_m, (count, 1, 1)), (about_y * about_z).as_matrix(), np.tile([0, 0, float(depth_m)], (count, 1))
    )


def random_points(*, points: int, count: int, rng: np.random.Generator, box_m: np.ndarray = BOX_M) -> Placed:
    """Return targets of random points: evenly in a box (2, 3) [m] **of the camera**, as is the target's origin."""
    low, high = np.asarray(box_m, float)
    camera_m = rng.uniform(low, high, (count, points, 3))
    translation_m = rng.uniform(low, high, (count, 3))
    rotation = random_rotations(count, rng=rng)
    return Placed((camera_m - translation_m[:, None]) @ rotation, rotation, translation_m)


def images(placed: Placed, *, focal_px: float, noise_px: float, rng: np.random.Generator) -> np.ndarray:
    """Return image points (B, n, 2) on the plane z = 1, each coordinate with noise of `noise_px` by `focal_px`."""
    camera_m = placed.points_m @ np.swapaxes(placed.rotation, 1, 2) + placed.translation_m[:, None]
    if not np.all(camera_m[..., 2] > 0):
        raise ValueError(f"images: got {np.sum(camera_m[..., 2] <= 0)} points behind the camera, allowed: none")
    exact = camera_m[..., :2] / camera_m[..., 2:]
    return exact + noise_px / focal_px * rng.standard_normal(exact.shape)
