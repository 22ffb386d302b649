"""LED in air or in the water without a window: beam profile and radiant intensity (dissertation eq. 2.9)."""

import math

import numpy as np

PROFILE_ANGLES_DEG = np.linspace(0.0, 180.0, 1801)
"""Grid of tabulated beam profiles. [deg]"""


def lambertian_order(*, half_angle_deg: float) -> float:
    """Return m of the profile cos^m whose intensity falls to one half at `half_angle_deg`.

    Source: generalised Lambertian, m = -ln 2 / ln cos(half angle).
    """
    # below 1 degree a table in steps of 0.1 degree no longer holds the beam: its flux is off by 0.1 %, soon by far more
    if not 1 <= half_angle_deg < 90:
        raise ValueError(f"lamp half_angle_deg: got {half_angle_deg}, allowed: at least 1 and below 90")
    return -math.log(2) / math.log(math.cos(math.radians(half_angle_deg)))


def profile_from_half_angle(*, half_angle_deg: float) -> np.ndarray:
    """Return intensity relative to the axis on PROFILE_ANGLES_DEG, (1801,); 0 behind the lamp."""
    cosine = np.maximum(np.cos(np.radians(PROFILE_ANGLES_DEG)), 0.0)
    return cosine ** lambertian_order(half_angle_deg=half_angle_deg)


def profile_from_table(*, angles_deg: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return a measured beam profile on PROFILE_ANGLES_DEG relative to its axis; 0 beyond its last angle.

    Raises ValueError unless angles start at 0, increase and stay within 180, and values are >= 0, > 0 on the axis.
    """
    angles, values = np.asarray(angles_deg, float), np.asarray(values, float)
    if angles.shape != values.shape or len(angles) < 2 or angles[0] != 0 or angles[-1] > 180:
        raise ValueError("lamp beam table: allowed: equally many angles and values, at least 2, from 0 to 180 deg")
    if not np.all(np.diff(angles) > 0):
        raise ValueError("lamp beam table: angles_deg must increase strictly")
    if not (np.all(np.isfinite(values)) and np.all(values >= 0) and values[0] > 0):
        raise ValueError("lamp beam table: values must be finite and >= 0, and > 0 on the axis")
    return np.interp(PROFILE_ANGLES_DEG, angles, values / values[0], right=0.0)


def intensity_from_flux(*, radiant_flux_w: float, profile: np.ndarray) -> float:
    """Return the radiant intensity on the axis, I_0 = flux / (2 pi integral f sin). [W/sr]"""
    angles = np.radians(PROFILE_ANGLES_DEG)
    return radiant_flux_w / (2 * math.pi * np.trapezoid(profile * np.sin(angles), angles))
