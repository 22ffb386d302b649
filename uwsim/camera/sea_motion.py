"""Irregular motion of a vehicle in water: sums of harmonics with seeded phases, smooth in every derivative."""

import numpy as np

from uwsim.camera.imu import STANDARD_GRAVITY_M_PER_S2
from uwsim.camera.kinematics import Harmonics

COMPONENTS = 64
_HIGHEST = 5.0  # times the peak frequency; above it lie 0.2 % of the variance


def irregular(*, rms: float, peak_period_s: float, rng: np.random.Generator) -> Harmonics:
    """Return an irregular motion of root mean square `rms` (over long times), of any unit, with a spectrum of one peak.

    S(f) ~ f^-5 exp(-1.25 (f_p / f)^4), in components of equal variance: frequencies drawn one in each of as many
    equal shares of the variance, phases uniform. Raises ValueError unless rms >= 0 and the period is above 0.
    Source: Bretschneider 1959 (of the shape of Pierson & Moskowitz 1964, doi:10.1029/JZ069i024p05181); its integral
    up to f is rms^2 exp(-1.25 (f_p / f)^4).
    Valid: waves of a sea; for anything else the shape is an assumption.
    """
    if rms < 0 or peak_period_s <= 0:
        raise ValueError(f"irregular motion: got rms {rms:g}, peak period {peak_period_s:g} s, allowed: >= 0 and > 0")
    most = np.exp(-1.25 / _HIGHEST**4)
    shares = most * (np.arange(COMPONENTS) + rng.uniform(size=COMPONENTS)) / COMPONENTS
    frequencies_hz = (1.25 / -np.log(np.maximum(shares, 1e-9))) ** 0.25 / peak_period_s
    amplitudes = np.full(COMPONENTS, rms * np.sqrt(2 / COMPONENTS))
    return Harmonics(amplitudes, frequencies_hz, rng.uniform(0, 2 * np.pi, COMPONENTS))


def waves(
    *, significant_height_m: float, peak_period_s: float, water_depth_m: float, rng: np.random.Generator
) -> tuple[Harmonics, Harmonics]:
    """Return how water at `water_depth_m` moves under a sea: along the direction in which waves run, and upwards. [m]

    Circles of radius a exp(-k depth), k = (2 pi f)^2 / g, forwards under the crest; the surface has
    significant height 4 sqrt(variance). Raises ValueError for a height below 0 or a depth that is not above 0.
    Source: linear waves on deep water, Dean & Dalrymple 1991, Water Wave Mechanics for Engineers and Scientists, 4.2.
    Valid: depth of the bottom above half a wavelength; waves low against their length.
    """
    if significant_height_m < 0 or water_depth_m <= 0:
        raise ValueError(
            f"waves: got a height of {significant_height_m:g} m, {water_depth_m:g} m deep, allowed: >= 0 and > 0"
        )
    surface = irregular(rms=significant_height_m / 4, peak_period_s=peak_period_s, rng=rng)
    wavenumber_per_m = (2 * np.pi * surface.frequencies_hz) ** 2 / STANDARD_GRAVITY_M_PER_S2
    radii_m = surface.amplitudes * np.exp(-wavenumber_per_m * water_depth_m)
    forwards = Harmonics(radii_m, surface.frequencies_hz, surface.phases_rad)
    upwards = Harmonics(radii_m, surface.frequencies_hz, surface.phases_rad + np.pi / 2)
    return forwards, upwards


def vibration(*, velocity_rms_m_per_s: float, shaft_hz: float, blades: int, rng: np.random.Generator) -> Harmonics:
    """Return the vibration along one axis that a propeller shakes its vehicle with. [m]

    Two harmonics of equal rms velocity and random phase: unbalance at the shaft's frequency and thrust that changes as
    the blades pass. Raises ValueError unless the velocity is >= 0, the frequency above 0 and there is a blade.
    Source: frequencies: Carlton 2012, Marine Propellers and Propulsion, 3rd ed., chapter 22.
    """
    if velocity_rms_m_per_s < 0 or shaft_hz <= 0 or blades < 1:
        raise ValueError(
            f"vibration: got {velocity_rms_m_per_s:g} m/s, {shaft_hz:g} Hz, {blades} blades, "
            "allowed: >= 0, > 0 and at least 1"
        )
    frequencies_hz = shaft_hz * np.array([1.0, blades])
    # two harmonics of equal rms velocity v / sqrt(2), each of peak velocity v
    return Harmonics(velocity_rms_m_per_s / (2 * np.pi * frequencies_hz), frequencies_hz, rng.uniform(0, 2 * np.pi, 2))
