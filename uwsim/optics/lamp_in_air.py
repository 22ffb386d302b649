"""Irradiance of a point lamp in air, from its position or from a reference point on its surface (eqs. 2.10-2.15).

Irradiances [W/m^2] are on a plane normal to the beam axis at an axial distance, unless a name says otherwise.
"""

import math

import numpy as np

from uwsim.optics.beam_profile import Profile
from uwsim.optics.checks import require


def _forward(angle_rad: np.ndarray) -> np.ndarray:
    return require("lamp field: angle_rad", angle_rad, least=0, below=math.pi / 2)


def _distance(name: str, value: np.ndarray) -> np.ndarray:
    return require(f"lamp field: {name}", value, above=0)


def plane_irradiance(
    *, intensity_w_per_sr: np.ndarray, axial_distance_m: np.ndarray, angle_rad: np.ndarray
) -> np.ndarray:
    """Return the irradiance on the plane, from the intensity along the ray (...) -> (...). [W/m^2]

    Source: dissertation, eq. 2.10, E = I(theta) cos^3 theta / d^2.
    Valid: point lamp (distance above 5 lamp sizes), clear air.
    Errata: the text says that it decreases exponentially and calls it L; it falls as the inverse square, and d is the
    distance along the axis, not along the ray.
    """
    distance = _distance("axial_distance_m", axial_distance_m)
    intensity = require("lamp field: intensity_w_per_sr", intensity_w_per_sr, least=0)
    return intensity * np.cos(_forward(angle_rad)) ** 3 / distance**2


def ray_irradiance(*, intensity_w_per_sr: np.ndarray, range_m: np.ndarray) -> np.ndarray:
    """Return the irradiance on a surface normal to the ray at a range along it, I / r^2. [W/m^2]"""
    return require("lamp field: intensity_w_per_sr", intensity_w_per_sr, least=0) / _distance("range_m", range_m) ** 2


def axis_irradiance(*, axis_intensity_w_per_sr: float, axial_distance_m: np.ndarray) -> np.ndarray:
    """Return the irradiance on the axis. [W/m^2]

    Source: dissertation, eq. 2.11, first half, E = I(0) / d^2.
    Errata: the second half divides "L(0,0)", an irradiance at distance 0, by d^2: infinite, and W/m^4 in its unit.
    """
    return ray_irradiance(intensity_w_per_sr=axis_intensity_w_per_sr, range_m=axial_distance_m)


def off_axis_irradiance(*, axis_irradiance_w_per_m2: np.ndarray, profile: Profile, angle_rad: np.ndarray) -> np.ndarray:
    """Return the irradiance off the axis from that on the axis of the same plane. [W/m^2]

    Source: dissertation, eqs. 2.12 and 2.15, E(d, theta) = E(d, 0) f(theta) cos^3 theta.
    Errata: 2.12 is called radiance; 2.15 has the angles of the two sides swapped, E(d_1, 0) = E(d + d_1, theta) ...
    (`lamp_as_printed.axis_irradiance_2_15`).
    """
    angle = _forward(angle_rad)
    return axis_irradiance_w_per_m2 * profile(angle, np.zeros_like(angle)) * np.cos(angle) ** 3


def axis_irradiance_from_reference(
    *, reference_irradiance_w_per_m2: float, reference_distance_m: float, distance_m: np.ndarray
) -> np.ndarray:
    """Return the irradiance on the axis at a distance from the reference point O'. [W/m^2]

    `reference_distance_m` d is from the lamp to O', where the irradiance was measured.
    Source: dissertation, eq. 2.14, E(d_1, 0) = E(O') d^2 / (d + d_1)^2.
    Valid: d above 5 lamp sizes.
    Errata: none; the printed form is right.
    """
    reference = _distance("reference_distance_m", reference_distance_m)
    distance = require("lamp field: distance_m", distance_m, least=0)
    return reference_irradiance_w_per_m2 * reference**2 / (reference + distance) ** 2


def irradiance_from_reference(
    *,
    reference_irradiance_w_per_m2: float,
    reference_distance_m: float,
    distance_m: np.ndarray,
    reference_angle_rad: np.ndarray,
    profile: Profile,
) -> np.ndarray:
    """Return the irradiance on the plane at an axial distance and angle, both seen from the reference point. [W/m^2]

    Source: dissertation, eqs. 2.13-2.15: E = E(O') [d / (d + d_1)]^2 f(theta) cos^3 theta with
    tan theta = d_1 tan theta_1 / (d + d_1).
    Errata: 2.13 has no distance factor and uses theta_1 for theta, right only where d_1 is far above d
    (`lamp_as_printed.irradiance_2_13`).
    """
    on_axis = axis_irradiance_from_reference(
        reference_irradiance_w_per_m2=reference_irradiance_w_per_m2,
        reference_distance_m=reference_distance_m,
        distance_m=distance_m,
    )
    distance = np.asarray(distance_m, float)
    angle = np.arctan(distance * np.tan(_forward(reference_angle_rad)) / (reference_distance_m + distance))
    return off_axis_irradiance(axis_irradiance_w_per_m2=on_axis, profile=profile, angle_rad=angle)
