"""Equations 2.13-2.28 of the dissertation as printed where they are wrong: for comparison, never for simulation.

Each function states what is wrong and names the corrected one. Symbols: d air gap, d_1 distance in the water from the
window, n = n_w/n_a. The thickness of the glass does not occur in them.
"""

import numpy as np

from uwsim.optics.beam_profile import Profile
from uwsim.optics.fresnel import normal_transmittance
from uwsim.optics.window import FlatWindow


def irradiance_2_13(
    *, reference_irradiance_w_per_m2: float, profile: Profile, reference_angle_rad: np.ndarray
) -> np.ndarray:
    """Return E(O') f(theta_1) cos^3 theta_1. [W/m^2]

    Errata: does not depend on the distance; `lamp_in_air.irradiance_from_reference`.
    """
    angle = np.asarray(reference_angle_rad, float)
    return reference_irradiance_w_per_m2 * profile(angle, np.zeros_like(angle)) * np.cos(angle) ** 3


def axis_irradiance_2_15(
    *, off_axis_irradiance_w_per_m2: np.ndarray, profile: Profile, angle_rad: np.ndarray
) -> np.ndarray:
    """Return E(d_1, 0) = E(d + d_1, theta) f(theta) cos^3 theta. [W/m^2]

    Errata: on-axis and off-axis irradiance change places; `lamp_in_air.off_axis_irradiance`.
    """
    angle = np.asarray(angle_rad, float)
    return off_axis_irradiance_w_per_m2 * profile(angle, np.zeros_like(angle)) * np.cos(angle) ** 3


def transmittance_ratio_2_18(window: FlatWindow) -> float:
    """Return t = t_w / t_a.

    Errata: for a bare lamp the product is needed; `FlatWindow.transmittance`.
    """
    air = normal_transmittance(n_from=window.n_air, n_to=window.n_glass)
    return normal_transmittance(n_from=window.n_glass, n_to=window.n_water) / air


def virtual_distance_2_19_m(window: FlatWindow) -> float:
    """Return d_w = d t_w / t_a. [m]

    Errata: transmittances for indices; `FlatWindow.virtual_distance_m`.
    """
    return window.air_gap_m * transmittance_ratio_2_18(window)


def radiance_ratio_2_20(window: FlatWindow) -> float:
    """Return (t_w / t_a)^2.

    Errata: transmittances for indices; `FlatWindow.radiance_ratio`.
    """
    return transmittance_ratio_2_18(window) ** 2


def window_irradiance_2_21(*, window_irradiance_w_per_m2: float, window: FlatWindow) -> float:
    """Return t n^2 L_a, where L_a is an irradiance (eqs. 2.11-2.14). [W/m^2]

    Errata: irradiance does not gain n^2; `window_field.axis_irradiance`.
    """
    return transmittance_ratio_2_18(window) * window.water_ratio**2 * window_irradiance_w_per_m2


def axis_irradiance_2_22(
    *, window_irradiance_w_per_m2: float, window: FlatWindow, distance_m: np.ndarray
) -> np.ndarray:
    """Return L_w (n d)^2 / (d_1 + n)^2, with d and d_1 in metres.

    Errata: adds a length and a number, so that it changes with the unit; `window_field.axis_irradiance`.
    """
    entering = window_irradiance_2_21(window_irradiance_w_per_m2=window_irradiance_w_per_m2, window=window)
    ratio = window.water_ratio
    return entering * (ratio * window.air_gap_m) ** 2 / (np.asarray(distance_m) + ratio) ** 2


def axis_irradiance_2_28(
    *,
    window_irradiance_w_per_m2: float,
    window: FlatWindow,
    distance_m: np.ndarray,
    attenuation_per_m: np.ndarray = 0.0,
) -> np.ndarray:
    """Return exp(-c d_1) L_w (n d)^2 / (d_1 + n d)^2. [W/m^2]

    Errata: counts n^2 twice, through L_w of eq. 2.21; `window_field.axis_irradiance`.
    """
    distance, virtual = np.asarray(distance_m, float), window.water_ratio * window.air_gap_m
    entering = window_irradiance_2_21(window_irradiance_w_per_m2=window_irradiance_w_per_m2, window=window)
    clear = entering * virtual**2 / (distance + virtual) ** 2
    return clear * np.exp(-np.asarray(attenuation_per_m) * distance)


def profile_2_25(*, profile: Profile, water_angle_rad: np.ndarray) -> np.ndarray:
    """Return f(arcsin(n_a/n_w sin theta_a)) = f(theta_w).

    Errata: takes the profile in air at the angle in the water; `window.water_intensity`. Right by accident, up to
    Fresnel losses, for a Lambertian profile alone.
    """
    angle = np.asarray(water_angle_rad, float)
    return profile(angle, np.zeros_like(angle))


def irradiance_2_27(
    *,
    window_irradiance_w_per_m2: float,
    profile: Profile,
    window: FlatWindow,
    distance_m: np.ndarray,
    water_angle_rad: np.ndarray,
    attenuation_per_m: np.ndarray = 0.0,
) -> np.ndarray:
    """Return L_w(d_1, 0) f(theta_w) cos^2 theta_w exp[-c d_1 / (cos theta_w - d_1)], with d_1 in metres.

    Errata: cos^2 for cos^3, f for f_w, and an exponent that is infinite where cos theta_w = d_1 and grows light
    beyond; `window_field.closed_form_irradiance`. Without attenuation it shows the first two errors alone.
    """
    on_axis = axis_irradiance_2_28(
        window_irradiance_w_per_m2=window_irradiance_w_per_m2,
        window=window,
        distance_m=distance_m,
        attenuation_per_m=attenuation_per_m,
    )
    cosine, distance, c = np.cos(water_angle_rad), np.asarray(distance_m, float), np.asarray(attenuation_per_m, float)
    spread = on_axis * profile_2_25(profile=profile, water_angle_rad=water_angle_rad) * cosine**2
    if not np.any(c):
        return spread
    with np.errstate(divide="ignore", over="ignore"):
        return spread * np.exp(-c * distance / (cosine - distance))
