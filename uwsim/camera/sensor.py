"""From band radiance to what the camera stores, in the terms of EMVA 1288 (release 4.0).

Chain: radiance x vignetting -> mean photo-electrons -> mosaic -> PRNU -> + dark current -> shot noise -> full well ->
+ DSNU + read noise -> gain K, black level, ADC -> raw DN -> black and dark level off, demosaic, white balance ->
sRGB, 8 bit. Without `adc_bits` the electrons become the picture without a step in between.
"""

import math
from dataclasses import dataclass

import numpy as np

from uwsim import seeds
from uwsim.camera import mosaic as bayer
from uwsim.images import srgb_uint8_from_linear

ADC_BITS = (8, 10, 12, 14, 16)
MOST_PRNU = 0.1  # beyond it some pixel's sensitivity would come near zero
_PLANCK_J_S = 6.62607015e-34
_LIGHT_M_PER_S = 299792458.0
_VARIANCE_OF_ROUNDING = 1 / 12  # [DN^2]


def electrons_per_radiance(
    *, exposure_time_s: float, f_number: float, pixel_pitch_m: float, peak_quantum_efficiency: float,
    response: np.ndarray, wavelengths_nm: np.ndarray, lens_transmittance: float = 1.0,
) -> np.ndarray:  # fmt: skip
    """Return the mean number of photo-electrons per unit of band radiance, (3,) [e- / (W m^-2 sr^-1 nm^-1)].

    `response` (N, 3): relative energy response of the bands on the uniform grid `wavelengths_nm` (N,).
    Irradiance on the sensor is pi L T / (4 N^2) (thin lens focused far away, on the axis; `vignetting` has the rest);
    the quantum efficiency is `peak_quantum_efficiency` where response / wavelength is largest over all bands.
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


@dataclass(frozen=True, kw_only=True)
class Constants:
    """The sensor during one exposure; every function below takes these fields as keywords, `**sensor`.

    electrons_per_radiance  (3,) mean photo-electrons per band radiance on the optical axis
    full_well_e             saturation capacity [e-]
    white_balance           (3,) factor of each band
    read_noise_e            temporal dark noise without dark current, sigma_d0 [e-]
    dark_e                  mean dark electrons of the exposure: dark current x time [e-]
    prnu, dsnu_e            spatial standard deviations of the sensitivity [1] and of the dark signal [e-]
    pattern_seed            which sensor: names the fixed pattern of PRNU and DSNU
    gain                    1: the full well just fills the range of the output; larger: white is reached before
    adc_bits                8, 10, 12, 14 or 16; None: no ADC
    black_level_dn          DN without any electron
    mosaic, demosaic        Bayer pattern as in `mosaic.PATTERNS` or None (three ideal bands per pixel), and method
    relative_illumination   (H, W) vignetting, 1 on the axis; None: 1 everywhere

    Raises ValueError on values that no sensor has.
    """

    electrons_per_radiance: np.ndarray
    full_well_e: float
    white_balance: np.ndarray
    read_noise_e: float = 0.0
    dark_e: float = 0.0
    prnu: float = 0.0
    dsnu_e: float = 0.0
    pattern_seed: int = 0
    gain: float = 1.0
    adc_bits: int | None = None
    black_level_dn: int = 0
    mosaic: str | None = None
    demosaic: str = "bilinear"
    relative_illumination: np.ndarray | None = None

    def __post_init__(self):
        for name in ("electrons_per_radiance", "white_balance"):
            values = np.asarray(getattr(self, name))
            if values.shape != (3,) or not np.all(values > 0):
                raise ValueError(f"sensor: {name} = {values.tolist()}, allowed: three numbers > 0")
        if not self.full_well_e > 0:
            raise ValueError(f"sensor: full_well_e = {self.full_well_e}, allowed: > 0")
        if not self.gain > 0:
            raise ValueError(f"sensor: gain = {self.gain}, allowed: > 0")
        for name in ("read_noise_e", "dark_e", "dsnu_e"):
            if not getattr(self, name) >= 0:
                raise ValueError(f"sensor: {name} = {getattr(self, name)}, allowed: >= 0")
        if not 0 <= self.prnu <= MOST_PRNU:
            raise ValueError(f"sensor: prnu = {self.prnu}, allowed: 0 to {MOST_PRNU}")
        if not self.dark_e < self.saturation_e:
            raise ValueError(
                f"sensor: the dark current makes {self.dark_e:g} e- in the exposure, "
                f"allowed: less than the {self.saturation_e:g} e- that make white"
            )
        self._check_output()

    def _check_output(self) -> None:
        if self.adc_bits is None:
            if self.black_level_dn != 0 or self.mosaic is not None or self.gain < 1:
                raise ValueError("sensor: black_level_dn, mosaic and a gain below 1 need adc_bits, got none")
            return
        if self.adc_bits not in ADC_BITS:
            raise ValueError(f"sensor: adc_bits = {self.adc_bits}, allowed: {', '.join(map(str, ADC_BITS))}")
        if not 0 <= self.black_level_dn < self.most_dn:
            raise ValueError(f"sensor: black_level_dn = {self.black_level_dn}, allowed: 0 to {self.most_dn - 1}")
        if self.mosaic is not None:
            bayer.check(self.mosaic, self.demosaic, adc_bits=self.adc_bits)

    @property
    def most_dn(self) -> int:
        """The largest output of the ADC. [DN]"""
        return 2**self.adc_bits - 1

    @property
    def saturation_e(self) -> float:
        """Electrons, dark ones included, at which the full well or the output saturates. [e-]"""
        return self.full_well_e / max(self.gain, 1.0)

    @property
    def white_e(self) -> float:
        """Photo-electrons that make 1 in the linear picture, before white balance. [e-]"""
        return self.saturation_e - self.dark_e

    @property
    def gain_dn_per_e(self) -> float | None:
        """The system gain K of EMVA 1288, None without ADC. [DN / e-]"""
        return None if self.adc_bits is None else self.gain * (self.most_dn - self.black_level_dn) / self.full_well_e

    @property
    def dark_variance_e2(self) -> float:
        """Temporal variance without light: read noise, dark current, quantisation. [e-^2]"""
        quantisation = 0.0 if self.adc_bits is None else _VARIANCE_OF_ROUNDING / self.gain_dn_per_e**2
        return self.read_noise_e**2 + self.dark_e + quantisation

    @property
    def linear_per_radiance(self) -> np.ndarray:
        """The factor from radiance to the linear picture, (3,), or (H, W, 3) with vignetting."""
        scale = np.asarray(self.electrons_per_radiance) / self.white_e * np.asarray(self.white_balance)
        return self._vignetted(scale)

    @property
    def electrons_per_radiance_of_pixel(self) -> np.ndarray:
        """Mean photo-electrons per band radiance, (3,), or (H, W, 3) with vignetting."""
        return self._vignetted(np.asarray(self.electrons_per_radiance))

    def _vignetted(self, scale: np.ndarray) -> np.ndarray:
        return scale if self.relative_illumination is None else self.relative_illumination[..., None] * scale

    def check(self, radiance: np.ndarray) -> None:
        """Raise ValueError unless an image (..., 3) has the size of the vignetting map, if there is one."""
        expected = np.shape(self.relative_illumination)
        if self.relative_illumination is not None and np.shape(radiance)[:-1] != expected:
            raise ValueError(
                f"sensor: image of shape {np.shape(radiance)}, allowed: {(*expected, 3)} as the vignetting"
            )


def linear_from_radiance(radiance: np.ndarray, **sensor) -> np.ndarray:
    """Return the linear picture (..., 3) float32, 1 = white, not clipped: no noise, mosaic or quantisation."""
    constants = Constants(**sensor)
    constants.check(radiance)
    return (np.asarray(radiance) * constants.linear_per_radiance).astype(np.float32)


def radiance_from_linear(linear: np.ndarray, **sensor) -> np.ndarray:
    """Return the band radiance (..., 3) that makes a linear picture: the inverse of `linear_from_radiance`."""
    constants = Constants(**sensor)
    constants.check(linear)
    return np.asarray(linear, dtype=float) / constants.linear_per_radiance


def noise_std_e(radiance: np.ndarray, **sensor) -> np.ndarray:
    """Return the standard deviation of the temporal noise of one raw sample, (..., 3) [e-].

    Shot noise, dark current, read noise and quantisation: sigma^2 = mu_e + dark_e + sigma_d0^2 + 1 / (12 K^2).

    Raises ValueError on negative radiance.

    Source: EMVA 1288 release 4.0, the linear signal model (variance of the grey value over K^2).
    Valid: below saturation; no fixed pattern, no 8-bit encoding; with a mosaic for the raw sample of each band, where a
    demosaiced picture has less noise, correlated between neighbours.
    """
    constants = Constants(**sensor)
    return np.sqrt(_mean_electrons(radiance, constants) + constants.dark_variance_e2)


def noise_std_radiance(radiance: np.ndarray, **sensor) -> np.ndarray:
    """Return the noise of `noise_std_e` as standard deviation of the radiance read, (..., 3), in radiance units."""
    return noise_std_e(radiance, **sensor) / Constants(**sensor).electrons_per_radiance_of_pixel


def expose(radiance: np.ndarray, *, rng: np.random.Generator, **sensor) -> np.ndarray:
    """Return what the camera stores, (H, W, 3) uint8 sRGB.

    `radiance` (H, W, 3) [W m^-2 sr^-1 nm^-1]. Negative radiance is refused (ValueError).
    """
    constants = Constants(**sensor)
    if constants.adc_bits is not None:
        return picture_from_dn(raw_dn(radiance, rng=rng, **sensor), **sensor)
    electrons = _read_electrons(radiance, rng, constants) - constants.dark_e
    return srgb_uint8_from_linear(electrons / constants.white_e * np.asarray(constants.white_balance))


def expose_without_noise(radiance: np.ndarray, **sensor) -> np.ndarray:
    """Return the 8-bit sRGB picture (H, W, 3) of the same camera without noise, mosaic or quantisation by the ADC."""
    return srgb_uint8_from_linear(np.clip(linear_from_radiance(radiance, **sensor), 0, 1))


def raw_dn(radiance: np.ndarray, *, rng: np.random.Generator, **sensor) -> np.ndarray:
    """Return the output of the ADC, uint16 [DN]: (H, W) with a mosaic, (H, W, 3) without.

    `radiance` (H, W, 3). Raises ValueError on negative radiance and for a sensor without ADC.
    """
    constants = _digital(sensor)
    electrons = _read_electrons(radiance, rng, constants)
    dn = np.rint(constants.black_level_dn + constants.gain_dn_per_e * electrons)
    return np.clip(dn, 0, constants.most_dn).astype(np.uint16)


def linear_from_dn(dn: np.ndarray, **sensor) -> np.ndarray:
    """Return the linear picture (H, W, 3), 1 = white, not clipped, of raw DN (H, W) or (H, W, 3).

    Black level and mean dark current are taken off, the mosaic is interpolated, the white balance applied.
    Vignetting and fixed pattern stay in. Raises ValueError if the shape does not fit the mosaic or DN exceed the ADC.
    """
    constants = _digital(sensor)
    dn = np.asarray(dn)
    channels = 2 if constants.mosaic else 3
    if dn.ndim != channels or (channels == 3 and dn.shape[2] != 3):
        raise ValueError(f"sensor: raw DN of shape {dn.shape}, allowed: {'(H, W)' if channels == 2 else '(H, W, 3)'}")
    if dn.size and not (dn.min() >= 0 and dn.max() <= constants.most_dn):
        raise ValueError(f"sensor: raw DN from {dn.min()} to {dn.max()}, allowed: 0 to {constants.most_dn}")
    if constants.mosaic:
        dn = bayer.demosaic(dn, pattern=constants.mosaic, method=constants.demosaic, adc_bits=constants.adc_bits)
    dark_dn = constants.black_level_dn + constants.gain_dn_per_e * constants.dark_e
    return (dn - dark_dn) / (constants.gain_dn_per_e * constants.white_e) * np.asarray(constants.white_balance)


def picture_from_dn(dn: np.ndarray, **sensor) -> np.ndarray:
    """Return the 8-bit sRGB picture (H, W, 3) of raw DN (H, W) or (H, W, 3)."""
    return srgb_uint8_from_linear(linear_from_dn(dn, **sensor))


def fixed_pattern(name: str, shape: tuple[int, ...], *, pattern_seed: int) -> np.ndarray:
    """Return the pattern `prnu` or `dsnu` of a sensor: normal numbers of mean 0 and variance 1, the same each time."""
    return seeds.generator(pattern_seed, 0, f"sensor {name}").standard_normal(shape)


def _digital(sensor: dict) -> Constants:
    constants = Constants(**sensor)
    if constants.adc_bits is None:
        raise ValueError("sensor: raw DN need adc_bits, got none")
    return constants


def _read_electrons(radiance: np.ndarray, rng: np.random.Generator, constants: Constants) -> np.ndarray:
    """Return the electrons read out, (H, W, 3), or (H, W) with a mosaic: noise included, limited by the full well."""
    # beyond ten full wells the pixel is white whatever the noise; keeps the Poisson sampler in range
    mean = np.minimum(_mean_electrons(radiance, constants), 10 * constants.full_well_e)
    if constants.mosaic:
        mean = bayer.mosaic(mean, pattern=constants.mosaic)
    if constants.prnu > 0:
        mean = mean * (1 + constants.prnu * fixed_pattern("prnu", mean.shape, pattern_seed=constants.pattern_seed))
    electrons = np.minimum(rng.poisson(mean + constants.dark_e), constants.full_well_e)
    electrons = electrons + constants.read_noise_e * rng.standard_normal(mean.shape)
    if constants.dsnu_e > 0:
        electrons += constants.dsnu_e * fixed_pattern("dsnu", mean.shape, pattern_seed=constants.pattern_seed)
    return electrons


def _mean_electrons(radiance: np.ndarray, constants: Constants) -> np.ndarray:
    """Return the mean photo-electrons (..., 3) of a radiance image, not limited by the full well. [e-]"""
    constants.check(radiance)
    if not np.all(radiance >= 0):
        raise ValueError(f"sensor: radiance has {np.sum(~(radiance >= 0))} negative or NaN values, allowed: >= 0")
    return np.asarray(radiance, dtype=float) * constants.electrons_per_radiance_of_pixel
