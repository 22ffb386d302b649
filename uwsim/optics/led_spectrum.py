"""Spectrum of a white LED: a blue chip and its phosphor, each a Gaussian of two widths."""

from dataclasses import dataclass

import numpy as np

from uwsim.optics.checks import require
from uwsim.optics.sources import luminous_efficiency
from uwsim.optics.spectrum import WAVELENGTHS_NM

MAX_LUMINOUS_EFFICACY_LM_PER_W = 683.002
"""Lumens per watt at 555 nm (definition of the lumen: 683 at 540 THz)."""


@dataclass(frozen=True)
class SplitGaussian:
    """Peak with one standard deviation below and another above its wavelength."""

    amplitude: float
    peak_nm: float
    short_sigma_nm: float
    long_sigma_nm: float

    def __post_init__(self):
        require("LED peak amplitude", self.amplitude, least=0)
        for name in ("peak_nm", "short_sigma_nm", "long_sigma_nm"):
            require(f"LED peak {name}", getattr(self, name), above=0)

    def __call__(self, wavelength_nm: np.ndarray) -> np.ndarray:
        """Return the peak at wavelengths (...) -> (...)."""
        offset = np.asarray(wavelength_nm, float) - self.peak_nm
        sigma = np.where(offset < 0, self.short_sigma_nm, self.long_sigma_nm)
        return self.amplitude * np.exp(-0.5 * (offset / sigma) ** 2)


# amplitude, peak, short and long sigma of the blue chip, then of the phosphor
WHITE_LEDS = {
    "LED-B1": (SplitGaussian(0.3109, 450.1, 9.939, 14.82), SplitGaussian(0.96, 608.5, 63.73, 53.76)),
    "LED-B2": (SplitGaussian(0.4495, 451.1, 9.035, 11.72), SplitGaussian(0.9702, 605.2, 67.51, 55.73)),
    "LED-B3": (SplitGaussian(0.831, 448.1, 8.729, 8.88), SplitGaussian(0.8824, 589.7, 76.13, 59.32)),
    "LED-B4": (SplitGaussian(0.9232, 451.1, 11.09, 11.42), SplitGaussian(0.6493, 556.0, 41.2, 74.64)),
    "LED-B5": (SplitGaussian(0.9091, 451.7, 10.87, 11.11), SplitGaussian(0.5037, 553.2, 48.93, 70.82)),
}
"""Least-squares fits to the CIE illuminants of the same name, relative to their peak."""


def blue_phosphor(*, blue: SplitGaussian, phosphor: SplitGaussian) -> np.ndarray:
    """Return the relative power of a blue-plus-phosphor LED with unit integral over 400-700 nm, (61,). [1/nm]

    Raises ValueError if both amplitudes are 0.
    Source: sum of two split Gaussians, an empirical shape; parameters by least squares (`WHITE_LEDS`).
    """
    power = blue(WAVELENGTHS_NM) + phosphor(WAVELENGTHS_NM)
    total = np.trapezoid(power, WAVELENGTHS_NM)
    require("LED spectrum: power within 400-700 nm", total, above=0)
    return power / total


def white_led(name: str) -> np.ndarray:
    """Return the modelled relative power of a white LED named after a CIE illuminant, (61,). [1/nm]

    Source: `WHITE_LEDS`, fitted to CIE 15:2018.
    Valid: within an rms of 1.5 % (LED-B5) to 2.2 % (LED-B1) of the peak of the tabulated illuminant.
    """
    if name not in WHITE_LEDS:
        raise ValueError(f"white LED model: got {name!r}, allowed: {', '.join(WHITE_LEDS)}")
    blue, phosphor = WHITE_LEDS[name]
    return blue_phosphor(blue=blue, phosphor=phosphor)


def luminous_efficacy_lm_per_w(power: np.ndarray) -> float:
    """Return lumens per radiated watt of a spectrum on the grid, (61,).

    Source: CIE 15:2018, photopic luminous efficiency V(lambda) of the 1924 observer.
    Valid: power beyond 400-700 nm is neither counted as light nor as power.
    """
    power = require("spectrum", power, least=0)
    total = require("spectrum: power within 400-700 nm", np.trapezoid(power, WAVELENGTHS_NM), above=0)
    light = np.trapezoid(power * luminous_efficiency(), WAVELENGTHS_NM)
    return float(MAX_LUMINOUS_EFFICACY_LM_PER_W * light / total)


def radiant_flux_w(*, luminous_flux_lm: float, power: np.ndarray) -> float:
    """Return the radiated power within 400-700 nm of a lamp of this luminous flux and spectrum (61,). [W]"""
    require("luminous_flux_lm", luminous_flux_lm, least=0)
    return luminous_flux_lm / luminous_efficacy_lm_per_w(power)
