"""Lamps and daylight as formation models see them: where light comes from, how much, and how far in the water."""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from uwsim.optics.beam_profile import Profile
from uwsim.optics.window import Calibration, DomeWindow, FlatWindow
from uwsim.optics.window_field import exact_field


class Arriving(NamedTuple):
    """Unscattered light of a lamp at points (...), before the water takes its share.

    `irradiance_per_intensity` (...): irradiance normal to the ray per radiant intensity on the lamp's axis [1/m^2];
    times `Lamp.spectrum` it is spectral irradiance. `towards` (..., 3): unit vector from the point to where the light
    comes from. `path_m` (...): length of the ray in the water.
    """

    irradiance_per_intensity: np.ndarray
    towards: np.ndarray
    path_m: np.ndarray


@dataclass(frozen=True)
class CosinePower:
    """cos^order of the angle to the axis, 0 behind the lamp: `beam_profile.lambertian`, known by its order."""

    order: float

    def __call__(self, angle_rad: np.ndarray, azimuth_rad: np.ndarray) -> np.ndarray:
        return np.maximum(np.cos(angle_rad), 0.0) ** self.order + 0.0 * azimuth_rad


@dataclass(frozen=True, kw_only=True, eq=False)
class Lamp:
    """One LED, bare in the water or behind a window; an array of LEDs is as many of these.

    `spectrum` (61,): radiant intensity of this LED on its own axis, as calibrated [W sr^-1 nm^-1]. `world_from_lamp`
    (4, 4): the lamp's frame, +z the window's normal. `lamp_from_led` (4, 4): the LED in it, its beam along its own +z.
    `profile`: intensity relative to the axis. `window`: None, `FlatWindow` or `DomeWindow` (concentric with the LED).
    Valid: a point (a die's radius is left out: relative error about (radius / distance)^2, behind a window the distance
    to its face); a window without scattering; housings cast no shadow.
    """

    name: str
    spectrum: np.ndarray
    world_from_lamp: np.ndarray
    profile: Profile
    lamp_from_led: np.ndarray
    window: FlatWindow | DomeWindow | None = None
    calibration: Calibration = "bare"

    def arriving(self, points_m: np.ndarray) -> Arriving:
        """Return the light at points (..., 3) in the world [m]; none behind a window's outer face or inside a dome.

        Where there is none, direction and path are those to the LED.
        Source: `uwsim.optics.window_field.exact_field` behind a flat window; I f(angle) / r^2 otherwise.
        """
        local = (np.asarray(points_m, float) - self.world_from_lamp[:3, 3]) @ self.world_from_lamp[:3, :3]
        offset = local - self.lamp_from_led[:3, 3]
        distance = np.maximum(np.sqrt(np.einsum("...k,...k->...", offset, offset)), 1e-9)
        direction = offset / distance[..., None]
        if isinstance(self.window, FlatWindow):
            found, direction, path = self._through_flat(local, direction, distance)
        else:
            found = self.intensity(direction) / distance**2
            path = distance
            if self.window is not None:
                found, path = self._through_dome(found, direction, distance)
        return Arriving(found, -direction @ self.world_from_lamp[:3, :3].T, path)

    def intensity(self, directions: np.ndarray) -> np.ndarray:
        """Return the intensity relative to the axis along unit directions (..., 3) of the lamp's frame, (...)."""
        if isinstance(self.profile, CosinePower):
            return np.maximum(np.asarray(directions, float) @ self.lamp_from_led[:3, 2], 0.0) ** self.profile.order
        x, y, z = np.moveaxis(np.asarray(directions, float) @ self.lamp_from_led[:3, :3], -1, 0)
        across = np.hypot(x, y)
        # an azimuth has no meaning on the axis; rounding must not choose one there
        azimuth = np.where(across > 1e-12, np.arctan2(y, x), 0.0)
        return self.profile(np.arctan2(across, z), azimuth)

    def _through_flat(self, local, direction, distance):
        """Return irradiance, direction and path behind the flat window, of points in the lamp's frame."""
        depth = local[..., 2] - self.front_m
        lit = depth > 0
        place = self.lamp_from_led[:2, 3]
        # no light behind the face: the ray to a point before it stands in
        lateral = np.where(lit[..., None], local[..., :2], place)
        field = exact_field(
            self, self.window, lateral_m=lateral, depth_m=np.where(lit, depth, 1.0),
            emitter_m=(float(place[0]), float(place[1])), calibration=self.calibration,
        )  # fmt: skip
        cosine, sine = np.cos(field.water_angle_rad), np.sin(field.water_angle_rad)
        x, y = np.moveaxis(lateral - place, -1, 0)
        across = np.maximum(np.hypot(x, y), 1e-300)
        ray = np.stack([sine * x / across, sine * y / across, cosine], axis=-1)
        return (
            np.where(lit, field.irradiance_w_per_m2 / cosine, 0.0),
            np.where(lit[..., None], ray, direction),
            np.where(lit, field.path_m, distance),
        )

    def _through_dome(self, found, direction, distance):
        radius = self.window.outer_radius_m
        lit = (distance > radius) & (direction[..., 2] >= np.cos(self.window.half_aperture_rad))
        return np.where(lit, found * self._dome_transmittance, 0.0), np.where(lit, distance - radius, distance)

    @cached_property
    def _dome_transmittance(self) -> float:
        in_water = self.window.transmittance
        if self.calibration == "bare":
            return in_water
        given = {name: getattr(self.window, name) for name in self.window.__dataclass_fields__}
        return in_water / DomeWindow(**given | {"n_water": self.window.n_air}).transmittance

    @property
    def front_m(self) -> float:
        """Distance of the outer face of a flat window from the LED's plane, along the lamp's axis; 0 without one."""
        return self.window.air_gap_m + self.window.thickness_m if isinstance(self.window, FlatWindow) else 0.0

    @cached_property
    def apparent_m(self) -> np.ndarray:
        """Where the LED seems to be from the water, near the axis: behind a flat window its paraxial image, (3,)."""
        place = self.lamp_from_led[:3, 3].copy()
        if isinstance(self.window, FlatWindow):
            place[2] = self.front_m - self.window.virtual_distance_m
        return self.world_from_lamp[:3, :3] @ place + self.world_from_lamp[:3, 3]

    @cached_property
    def axis(self) -> np.ndarray:
        """Unit vector of the LED's beam in the world, (3,)."""
        return self.world_from_lamp[:3, :3] @ self.lamp_from_led[:3, 2]


@dataclass(frozen=True, kw_only=True, eq=False)
class Daylight:
    """Sun and sky just below a flat surface at z = 0.

    `towards_sun` (3,): unit vector in the water. `sun_irradiance` (61,): normal to the sun's rays in the water,
    `sky_irradiance` (61,): of a horizontal plane, both just below the surface [W m^-2 nm^-1].
    """

    towards_sun: np.ndarray
    sun_irradiance: np.ndarray
    sky_irradiance: np.ndarray

    def __post_init__(self):
        if abs(np.linalg.norm(self.towards_sun) - 1) > 1e-6 or self.towards_sun[2] <= 0:
            raise ValueError(f"daylight: towards_sun is {self.towards_sun}, allowed: a unit vector that points up")
        for name in ("sun_irradiance", "sky_irradiance"):
            values = np.asarray(getattr(self, name))
            if values.shape != (61,) or not np.all(np.isfinite(values) & (values >= 0)):
                raise ValueError(f"daylight: {name} has shape {values.shape}, allowed: (61,), finite and >= 0")

    def sun_path_m(self, points_m: np.ndarray) -> np.ndarray:
        """Return the way of the sun's rays in the water to points (..., 3), (...); 0 above the surface. [m]"""
        return np.maximum(-points_m[..., 2], 0) / self.towards_sun[2]
