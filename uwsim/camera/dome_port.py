"""Camera behind a dome port: two concentric spheres, the pinhole in their centre or beside it."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from uwsim.camera.port import Status, check_port, unit_vectors
from uwsim.camera.refraction import Rays, dot, leave_sphere
from uwsim.optics import fresnel

_STEPS = 60


@dataclass(frozen=True, kw_only=True)
class DomePort:
    """Spherical shell of glass around the pinhole, which is at the origin of the camera frame.

    `inner_radius_m` > 0; `thickness_m` >= 0. `decentring_m` (3,): the pinhole as seen from the centre of the
    spheres, in the camera frame, shorter than the inner radius. `n_air`, `n_glass`, `n_water`: indices at one
    wavelength, air the smallest. `glass_absorption_per_m` of power. Raises ValueError otherwise.
    Valid: glass in every direction (the rim of a real dome is not modelled); the entrance pupil is a point.
    """

    inner_radius_m: float
    thickness_m: float
    n_glass: float
    n_water: float
    n_air: float = 1.0
    decentring_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    glass_absorption_per_m: float = 0.0

    def __post_init__(self):
        check_port(
            where="dome port", n_air=self.n_air, n_glass=self.n_glass, n_water=self.n_water,
            inner_radius_m=self.inner_radius_m, thickness_m=self.thickness_m,
            glass_absorption_per_m=self.glass_absorption_per_m,
        )  # fmt: skip
        shift = np.asarray(self.decentring_m, float)
        if shift.shape != (3,) or not np.linalg.norm(shift) < self.inner_radius_m:
            raise ValueError(
                f"dome port decentring_m: got {self.decentring_m}, "
                f"allowed: a vector (3,) shorter than inner_radius_m ({self.inner_radius_m})"
            )

    @cached_property
    def axis(self) -> np.ndarray:
        """Line through centre and pinhole, the way that looks forward; the camera's axis if they coincide. (3,)"""
        shift = np.asarray(self.decentring_m, float)
        length = np.linalg.norm(shift)
        if length == 0:
            return np.array([0.0, 0.0, 1.0])
        return shift / length * (-1.0 if shift[2] < 0 else 1.0)

    @cached_property
    def shift_m(self) -> float:
        """Position of the pinhole on the axis, from the centre; negative if the pinhole is behind the centre."""
        return float(np.dot(self.decentring_m, self.axis))

    @property
    def outer_radius_m(self) -> float:
        """Radius of the outer face."""
        return self.inner_radius_m + self.thickness_m

    def water_rays(self, directions: np.ndarray) -> Rays:
        """Return origins (..., 3) [m] on the outer face and unit directions (..., 3) in the water.

        `directions` (..., 3) in air from the pinhole.
        """
        started = unit_vectors(directions)
        centre = -np.asarray(self.decentring_m, float)
        rays = leave_sphere(
            (np.zeros_like(started), started),
            centre_m=centre, radius_m=self.inner_radius_m, n_from=self.n_air, n_to=self.n_glass,
        )  # fmt: skip
        return leave_sphere(rays, centre_m=centre, radius_m=self.outer_radius_m, n_from=self.n_glass, n_to=self.n_water)

    def _bends(self, radius_m: np.ndarray) -> list[tuple]:
        """Return (sign, n r / n_a [m]) of the angles to the radius that a ray has on its way out to `radius_m` [m]."""
        glass, water = self.n_glass / self.n_air, self.n_water / self.n_air
        inner, outer = self.inner_radius_m, self.outer_radius_m
        return [(-1, inner), (1, glass * inner), (-1, glass * outer), (1, water * outer), (-1, water * radius_m)]

    def _polar_angle(self, angle_rad: np.ndarray, radius_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the polar angle about the centre at which a ray gets to `radius_m`, and its derivative, each (...).

        `angle_rad` (...): between ray and axis at the pinhole, 0 to pi; both angles from the positive axis.
        Source: n r sin i is the same all along a ray in spherical layers (Bouguer), and in one layer the polar angle
        grows by what i falls.
        Valid: strictly increasing from 0 to pi for |shift| < inner radius and air the smallest index.
        """
        invariant, change = self.shift_m * np.sin(angle_rad), self.shift_m * np.cos(angle_rad)
        polar, slope = angle_rad, np.ones_like(angle_rad)
        for sign, reduced in self._bends(radius_m):
            polar = polar + sign * np.arcsin(invariant / reduced)
            slope = slope + sign * change / np.sqrt(reduced**2 - invariant**2)
        return polar, slope

    def air_directions(self, points_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return unit directions (..., 3) from the pinhole towards points (..., 3) in the water, and `Status` (...).

        One root per point, by Newton's method inside a bracket, in the plane of centre, pinhole and point.
        """
        from_centre = np.asarray(points_m, float) + np.asarray(self.decentring_m, float)
        radius = np.linalg.norm(from_centre, axis=-1)
        is_in_water = np.isfinite(radius) & (radius > self.outer_radius_m)
        from_centre = np.where(is_in_water[..., None], from_centre, (2 * self.outer_radius_m) * self.axis)
        radius = np.where(is_in_water, radius, 2 * self.outer_radius_m)
        along = dot(from_centre, self.axis)
        across = from_centre - along * self.axis
        off_axis = np.linalg.norm(across, axis=-1)
        angle = self._angle_in_air(np.arctan2(off_axis, along[..., 0]), radius)
        sideways = (np.sin(angle) / np.where(off_axis > 0, off_axis, 1.0))[..., None] * across
        towards = np.cos(angle)[..., None] * self.axis + sideways
        status = np.where(is_in_water, Status.SEEN, Status.NOT_IN_WATER).astype(np.int8)
        return np.where(is_in_water[..., None], unit_vectors(towards), np.nan), status

    def _angle_in_air(self, polar_rad: np.ndarray, radius_m: np.ndarray) -> np.ndarray:
        low, high = np.zeros_like(polar_rad), np.full_like(polar_rad, np.pi)
        angle = polar_rad
        for _ in range(_STEPS):
            polar, slope = self._polar_angle(angle, radius_m)
            low, high = np.where(polar <= polar_rad, angle, low), np.where(polar >= polar_rad, angle, high)
            trial = angle + (polar_rad - polar) / slope
            trial = np.where((trial >= low) & (trial <= high), trial, (low + high) / 2)
            change, angle = np.abs(trial - angle), trial
            if np.all(change <= 1e-13):
                break
        return angle

    def _far_slope(self) -> float:
        """Derivative of the polar angle of far points by the angle at the pinhole, on the axis. [1]"""
        return 1 + self.shift_m * sum(sign / reduced for sign, reduced in self._bends(np.inf))

    @property
    def paraxial_crossing_m(self) -> float:
        """Where rays next to the axis meet it, from the pinhole along the axis. [m]"""
        return self.shift_m * (self.n_air / self.n_water / self._far_slope() - 1)

    def paraxial_magnification(self, distance_m: np.ndarray) -> np.ndarray:
        """Return image size over that without port and water of small things on the axis. [1]

        `distance_m` (...) from the pinhole along the axis; NaN inside the port.
        """
        distance = np.asarray(distance_m, float)
        distance = np.where(distance + self.shift_m >= self.outer_radius_m, distance, np.nan)
        offset = self.shift_m / distance
        return 1 / (self._far_slope() * (1 + offset) - offset * self.n_air / self.n_water)

    def transmittance(self, directions: np.ndarray) -> np.ndarray:
        """Return the share of power (...) that passes along rays with `directions` (..., 3) in air, unpolarised.

        Source: the sum over inter-reflections of a slab, each face at its own angle; in spherical layers every
        passage through the glass has the same angles and the same length.
        Valid: light that was reflected twice in the glass leaves by another direction and is counted here.
        """
        directions = unit_vectors(directions)
        along = dot(directions, self.axis)
        # n r sin i over n_air
        invariant = abs(self.shift_m) * np.linalg.norm(directions - along * self.axis, axis=-1)
        is_ray = np.isfinite(invariant)
        in_air, glass_in, glass_out, _ = (
            np.arcsin(np.where(is_ray, invariant, 0.0) / reduced) for _, reduced in self._bends(np.inf)[:4]
        )
        path_m = self.outer_radius_m * np.cos(glass_out) - self.inner_radius_m * np.cos(glass_in)
        passed = np.exp(-self.glass_absorption_per_m * path_m)
        inner = fresnel.interface_reflectance(in_air, n_from=self.n_air, n_to=self.n_glass)
        outer = fresnel.interface_reflectance(glass_out, n_from=self.n_glass, n_to=self.n_water)
        shares = [(1 - a) * (1 - b) * passed / (1 - a * b * passed**2) for a, b in zip(inner, outer, strict=True)]
        return np.where(is_ray, np.mean(shares, axis=0), np.nan)
