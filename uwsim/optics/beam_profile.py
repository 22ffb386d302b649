"""Beam profiles f(theta, azimuth) relative to the axis, and lamps with an axis intensity and a direction."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from uwsim.optics import ies, lamp
from uwsim.optics.checks import require

Profile = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""(angle to the axis (...), azimuth (...)) [rad] -> intensity relative to the axis (...), measured in air."""


def lambertian(*, half_angle_deg: float) -> Profile:
    """Return cos^m theta, 0 behind the lamp, whose intensity falls to one half at `half_angle_deg` (60: Lambert)."""
    order = lamp.lambertian_order(half_angle_deg=half_angle_deg)

    def profile(angle_rad: np.ndarray, azimuth_rad: np.ndarray) -> np.ndarray:
        return np.maximum(np.cos(angle_rad), 0.0) ** order + 0.0 * azimuth_rad

    return profile


def from_table(*, angles_deg: np.ndarray, values: np.ndarray) -> Profile:
    """Return a measured profile, linear between its angles, 0 beyond the last, the same at every azimuth."""
    lamp.profile_from_table(angles_deg=angles_deg, values=values)  # refuses bad tables
    angles, relative = np.asarray(angles_deg, float), np.asarray(values, float) / values[0]

    def profile(angle_rad: np.ndarray, azimuth_rad: np.ndarray) -> np.ndarray:
        return np.interp(np.degrees(angle_rad), angles, relative, right=0.0) + 0.0 * azimuth_rad

    return profile


def from_ies(path: Path) -> Profile:
    """Return the profile of an IES LM-63 file; its vertical angle 0 is the axis.

    Raises ValueError for a bad file or one without intensity on the axis.
    """
    photometry = ies.read(path)
    # at vertical angle 0 all planes meet
    axis_cd = float(np.mean(photometry.intensity(0.0, np.arange(360.0))))
    require(f"{Path(path).name}: intensity on the axis (vertical angle 0)", axis_cd, above=0)

    def profile(angle_rad: np.ndarray, azimuth_rad: np.ndarray) -> np.ndarray:
        return photometry.intensity(np.degrees(angle_rad), np.degrees(azimuth_rad)) / axis_cd

    return profile


def tabulated(profile: Profile) -> np.ndarray:
    """Return the mean of a profile over the azimuth on `lamp.PROFILE_ANGLES_DEG`, (1801,)."""
    angles = np.radians(lamp.PROFILE_ANGLES_DEG)
    azimuths = np.radians(np.arange(0.5, 360.0))
    return profile(angles[:, None], azimuths[None]).mean(axis=1)


def axis_intensity_w_per_sr(*, radiant_flux_w: float, profile: Profile) -> float:
    """Return the intensity on the axis of a lamp that emits this flux, I_0 = flux / integral of f. [W/sr]"""
    require("lamp radiant_flux_w", radiant_flux_w, least=0)
    return lamp.intensity_from_flux(radiant_flux_w=radiant_flux_w, profile=tabulated(profile))


@dataclass(frozen=True)
class Beam:
    """A point lamp in a frame whose +z axis leaves through the window (or along the reference direction in air).

    `tilt_rad` turns the beam from +z towards the azimuth `tilt_azimuth_rad`, `roll_rad` the profile about its axis.
    Raises ValueError for a negative intensity and for a tilt of 90 degrees or more, away from the window.
    """

    axis_intensity_w_per_sr: float
    profile: Profile
    tilt_rad: float = 0.0
    tilt_azimuth_rad: float = 0.0
    roll_rad: float = 0.0

    def __post_init__(self):
        require("lamp axis_intensity_w_per_sr", self.axis_intensity_w_per_sr, least=0)
        require("lamp tilt_rad (beyond it no ray of the axis meets the window)", self.tilt_rad, least=0,
                below=math.pi / 2)  # fmt: skip
        require("lamp tilt_azimuth_rad", self.tilt_azimuth_rad)
        require("lamp roll_rad", self.roll_rad)

    @property
    def window_from_beam(self) -> np.ndarray:
        """Rotation from the beam's frame, z along its axis, (3, 3)."""
        return _turn_z(self.tilt_azimuth_rad) @ _turn_y(self.tilt_rad) @ _turn_z(self.roll_rad)

    def intensity(self, direction: np.ndarray) -> np.ndarray:
        """Return the radiant intensity along unit directions (..., 3) -> (...). [W/sr]

        Source: dissertation, eq. 2.9, I(theta) = I(0) f(theta).
        Errata: the medium is not stated; f and I are those in air.
        """
        x, y, z = np.moveaxis(np.asarray(direction, float) @ self.window_from_beam, -1, 0)
        # an azimuth has no meaning on the axis; rounding must not choose one there
        azimuth = np.where(np.hypot(x, y) > 1e-12, np.arctan2(y, x), 0.0)
        return self.axis_intensity_w_per_sr * self.profile(np.arctan2(np.hypot(x, y), z), azimuth)


def _turn_z(angle_rad: float) -> np.ndarray:
    c, s = math.cos(angle_rad), math.sin(angle_rad)
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])


def _turn_y(angle_rad: float) -> np.ndarray:
    c, s = math.cos(angle_rad), math.sin(angle_rad)
    return np.array([[c, 0, s], [0, 1.0, 0], [-s, 0, c]])
