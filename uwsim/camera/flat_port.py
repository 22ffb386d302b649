"""Camera behind a flat port: plane layers of air, glass and water at any tilt.

Source: Snell's law at each face; Agrawal et al., CVPR 2012, for the axial camera.
"""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from uwsim.camera.port import Status, check_port, unit_vectors
from uwsim.camera.refraction import Rays, cross_plane, dot
from uwsim.optics import fresnel

_STEPS = 60


def tilted_normal(*, tilt_rad: float, azimuth_rad: float = 0.0) -> tuple[float, float, float]:
    """Return the unit normal at `tilt_rad` from the camera's axis, towards x (azimuth 0) or y (azimuth pi / 2)."""
    return (
        math.sin(tilt_rad) * math.cos(azimuth_rad), math.sin(tilt_rad) * math.sin(azimuth_rad), math.cos(tilt_rad)
    )  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class FlatPort:
    """Flat window of uniform thickness; the pinhole is at the origin of the camera frame.

    `gap_m`: distance of the pinhole to the inner face along the normal, >= 0. `thickness_m` of the glass, >= 0.
    `n_air`, `n_glass`, `n_water`: indices at one wavelength, air the smallest. `normal` (3,): unit vector in the
    camera frame from the pinhole to the water. `glass_absorption_per_m` of power. Raises ValueError otherwise.
    Glass of the index of water acts as water: it moves the outer face, not the rays.
    Valid: a window that is wider than the field; the entrance pupil is a point.
    """

    gap_m: float
    thickness_m: float
    n_glass: float
    n_water: float
    n_air: float = 1.0
    normal: tuple[float, float, float] = (0.0, 0.0, 1.0)
    glass_absorption_per_m: float = 0.0

    def __post_init__(self):
        check_port(
            where="flat port", n_air=self.n_air, n_glass=self.n_glass, n_water=self.n_water,
            gap_m=self.gap_m, thickness_m=self.thickness_m,
            glass_absorption_per_m=self.glass_absorption_per_m,
        )  # fmt: skip
        normal = np.asarray(self.normal, float)
        if normal.shape != (3,) or not (abs(np.linalg.norm(normal) - 1) < 1e-9 and normal[2] > 0):
            raise ValueError(f"flat port normal: got {self.normal}, allowed: a unit vector (3,) with z > 0")

    @cached_property
    def axis(self) -> np.ndarray:
        """Normal through the pinhole, towards the water. (3,)"""
        normal = np.asarray(self.normal, float)
        return normal / np.linalg.norm(normal)

    @property
    def depth_m(self) -> float:
        """Distance of the pinhole to the outer face."""
        return self.gap_m + self.thickness_m

    def water_rays(self, directions: np.ndarray) -> Rays:
        """Return origins (..., 3) [m] on the outer face and unit directions (..., 3) in the water.

        `directions` (..., 3) in air from the pinhole; NaN for those that do not meet the port.
        """
        started = unit_vectors(directions)
        started = np.where(dot(started, self.axis) > 0, started, np.nan)
        rays = (np.zeros_like(started), started)
        rays = cross_plane(rays, normal=self.axis, offset_m=self.gap_m, n_from=self.n_air, n_to=self.n_glass)
        return cross_plane(rays, normal=self.axis, offset_m=self.depth_m, n_from=self.n_glass, n_to=self.n_water)

    def air_directions(self, points_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return unit directions (..., 3) from the pinhole towards points (..., 3) in the water, and `Status` (...).

        Solves r = d tan th_a + t tan th_g + h tan th_w in the plane of refraction, with u = tan th_a as the unknown:
        tan th_i = n_a u / sqrt(n_i^2 + (n_i^2 - n_a^2) u^2).
        """
        points = np.asarray(points_m, float)
        is_finite = np.all(np.isfinite(points), axis=-1, keepdims=True)
        points = np.where(is_finite, points, 0.0)
        height = dot(points, self.axis)
        across = points - height * self.axis
        radius = np.linalg.norm(across, axis=-1)
        water = height[..., 0] - self.depth_m
        is_in_water = is_finite[..., 0] & (water > 0)
        water = np.where(is_in_water, water, 1.0)
        layers = [(self.gap_m, self.n_air), (self.thickness_m, self.n_glass), (water, self.n_water)]
        tangent, is_reached = _tangent_in_air(radius, layers, n_air=self.n_air)
        towards = self.axis + (tangent / np.where(radius > 0, radius, 1.0))[..., None] * across
        status = np.where(is_in_water, np.where(is_reached, Status.SEEN, Status.NO_PATH), Status.NOT_IN_WATER)
        return np.where((status == Status.SEEN)[..., None], unit_vectors(towards), np.nan), status.astype(np.int8)

    @property
    def paraxial_crossing_m(self) -> float:
        """Where rays next to the axis meet it, from the pinhole towards the water; negative behind the pinhole. [m]"""
        return self.depth_m - self.n_water * (self.gap_m / self.n_air + self.thickness_m / self.n_glass)

    def paraxial_magnification(self, distance_m: np.ndarray) -> np.ndarray:
        """Return image size over that without port and water of small things on the axis. [1]

        `distance_m` (...) from the pinhole along the normal; NaN inside the port, n_water / n_air at infinity.
        """
        distance = np.asarray(distance_m, float)
        distance = np.where((distance >= self.depth_m) & (distance > 0), distance, np.nan)
        # reduced depth of the port beyond that of as much water
        excess = self.gap_m / self.n_air + self.thickness_m / self.n_glass - self.depth_m / self.n_water
        return 1 / (self.n_air * (excess / distance + 1 / self.n_water))

    def transmittance(self, directions: np.ndarray) -> np.ndarray:
        """Return the share of power (...) that passes along rays with `directions` (..., 3) in air, unpolarised."""
        directions = unit_vectors(directions)
        along = dot(directions, self.axis)
        sine = np.linalg.norm(directions - along * self.axis, axis=-1)
        meets = along[..., 0] > 0
        angle = np.where(meets, np.arctan2(sine, along[..., 0]), 0.0)
        shares = fresnel.slab(
            angle, n_in=self.n_air, n_slab=self.n_glass, n_out=self.n_water,
            absorption_per_m=self.glass_absorption_per_m, thickness_m=self.thickness_m,
        )  # fmt: skip
        return np.where(meets, shares.transmittance, np.nan)


def _tangent_in_air(radius_m: np.ndarray, layers: list[tuple], *, n_air: float) -> tuple[np.ndarray, np.ndarray]:
    """Return tan th_a (...) of the ray that gets `radius_m` (...) off the axis, and whether there is one (...).

    `layers`: (thickness [m], index) from the pinhole on. Newton's method from the axis: the radius is an increasing
    and concave function of the tangent where air has the smallest index, so that every step stays below the root.
    """
    # how far a ray at 90 degrees in air gets
    farthest = 0.0
    for depth, index in layers:
        sine = n_air / index
        full = np.inf if sine == 1 else sine / np.sqrt(1 - sine * sine)
        farthest = farthest + np.where(depth > 0, np.maximum(depth, 1e-300) * full, 0.0)
    is_reached = radius_m < farthest
    wanted = np.where(is_reached, radius_m, 0.0)
    tangent = np.zeros_like(wanted)
    for _ in range(_STEPS):
        reached, slope = 0.0, 0.0
        for depth, index in layers:
            squared = index**2 + (index**2 - n_air**2) * tangent**2
            ray = depth * n_air / np.sqrt(squared)
            reached, slope = reached + ray * tangent, slope + ray * index**2 / squared
        step = (wanted - reached) / slope
        tangent = tangent + step
        if np.all(np.abs(step) <= 1e-13 * tangent):
            break
    return tangent, is_reached
