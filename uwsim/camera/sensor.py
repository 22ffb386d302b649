"""From band radiance to the 8-bit picture that the camera stores.

Chain: radiance -> mean electrons -> shot noise -> full well -> read noise -> white balance -> sRGB, 8 bit.
"""

import math

import numpy as np

from uwsim.images import srgb_uint8_from_linear

_PLANCK_J_S = 6.62607015e-34
_LIGHT_M_PER_S = 299792458.0


def electrons_per_radiance(
    *, exposure_time_s: float, f_number: float, pixel_pitch_m: float, peak_quantum_efficiency: float,
    response: np.ndarray, wavelengths_nm: np.ndarray, lens_transmittance: float = 1.0,
) -> np.ndarray:  # fmt: skip
    """Return the mean number of photo-electrons per unit of band radiance, (3,) [e- / (W m^-2 sr^-1 nm^-1)].

    `response` (N, 3): relative energy response of the bands on the uniform grid `wavelengths_nm` (N,).
    Irradiance on the sensor is pi L T / (4 N^2) (thin lens focused far away, no vignetting); the quantum
    efficiency is `peak_quantum_efficiency` where response / wavelength is largest over all bands.
    Band radiance is the mean of the spectral radiance weighted by the response.

    Source: EMVA 1288 release 4.0, eq. 2 (photons from irradiance); dissertation eq. 2.30 (pi / 4 N^2).
    """
    response = np.asarray(response, dtype=float)
    photon_response = response / wavelengths_nm[:, None]
    quantum_efficiency = peak_quantum_efficiency * photon_response / photon_response.max()
    photons_per_joule = wavelengths_nm * 1e-9 / (_PLANCK_J_S * _LIGHT_M_PER_S)
    electrons_per_joule = np.trapezoid(quantum_efficiency * photons_per_joule[:, None], wavelengths_nm, axis=0)
    joule_per_radiance = math.pi * lens_transmittance / (4 * f_number**2) * pixel_pitch_m**2 * exposure_time_s
    return joule_per_radiance * electrons_per_joule


def linear_from_radiance(
    radiance: np.ndarray, *, electrons_per_radiance: np.ndarray, full_well_e: float, white_balance: np.ndarray
) -> np.ndarray:
    """Return the noise-free linear image (..., 3) float32, 1 = white, not clipped."""
    scale = np.asarray(electrons_per_radiance) / full_well_e * np.asarray(white_balance)
    return (np.asarray(radiance) * scale).astype(np.float32)


def expose(
    radiance: np.ndarray, *, electrons_per_radiance: np.ndarray, full_well_e: float, read_noise_e: float,
    white_balance: np.ndarray, rng: np.random.Generator,
) -> np.ndarray:  # fmt: skip
    """Return what the camera stores, (H, W, 3) uint8 sRGB, with shot and read noise.

    `radiance` (H, W, 3) [W m^-2 sr^-1 nm^-1]. Negative radiance is refused (ValueError).
    """
    if not np.all(radiance >= 0):
        raise ValueError(f"sensor: radiance has {np.sum(~(radiance >= 0))} negative or NaN values, allowed: >= 0")
    # beyond ten full wells the pixel is white whatever the noise; keeps the Poisson sampler in range
    mean = np.minimum(np.asarray(radiance, dtype=float) * electrons_per_radiance, 10 * full_well_e)
    electrons = np.minimum(rng.poisson(mean), full_well_e)
    electrons = electrons + read_noise_e * rng.standard_normal(mean.shape)
    return srgb_uint8_from_linear(electrons / full_well_e * np.asarray(white_balance))


def expose_without_noise(radiance: np.ndarray, **sensor) -> np.ndarray:
    """Return the 8-bit sRGB picture (H, W, 3) of the same camera without noise; same keywords as above."""
    return srgb_uint8_from_linear(np.clip(linear_from_radiance(radiance, **sensor), 0, 1))
