"""What a spectrum fit found of a picture: white noise and the power spectral density of its sharp texture.

Frequencies u (columns, x right) and v (rows, y **down**) are in cycles per pixel, as `numpy.fft.fftfreq` gives
them; densities are in squared image units, so that white noise of standard deviation s has the density s^2.
"""

from dataclasses import dataclass

import numpy as np

REFERENCE_FREQUENCY = 0.1  # cycles per pixel: where the amplitude of the power law is quoted
NYQUIST_FREQUENCY = 0.5
TEXTURE_TERMS = 14
# orders of the periodic terms in the direction of the frequency; odd ones cannot be: a real picture's spectrum is even
_ORDERS = (2, 4)


def texture_terms(u: np.ndarray, v: np.ndarray, *, lowest_frequency: float) -> np.ndarray:
    """Return the terms of ln S_f at frequencies u, v of any (broadcast) shape (...): (..., 14) float64.

    With r the distance from frequency 0, at least `lowest_frequency` (> 0), phi its direction (x right, y up) and
    x = ln(r / 0.1): 1, -x, x^2, -(r / 0.5)^2, then cos m phi, sin m phi, x cos m phi, x sin m phi for m = 2 and 4, then
    -(r / 0.5)^2 times cos 2 phi and sin 2 phi: with the fourth, a Gaussian roll-off that is an ellipse.
    """
    u, v = np.broadcast_arrays(np.asarray(u, float), np.asarray(v, float))
    r = np.maximum(np.hypot(u, v), lowest_frequency)
    x = np.log(r / REFERENCE_FREQUENCY)
    phi = np.arctan2(-v, u)
    roll_off = -((r / NYQUIST_FREQUENCY) ** 2)
    terms = [np.ones_like(x), -x, x**2, roll_off]
    for order in _ORDERS:
        cosine, sine = np.cos(order * phi), np.sin(order * phi)
        terms += [cosine, sine, x * cosine, x * sine]
    terms += [roll_off * np.cos(2 * phi), roll_off * np.sin(2 * phi)]
    return np.stack(terms, axis=-1)


@dataclass(frozen=True)
class Spectrum:
    """Noise and texture of a picture blurred by uniform straight motion, in the units of the picture.

    The picture's density is S_f |H|^2 + noise_std^2, |H|^2 = (1 - k0) (sinc^2(L s) + k1 / (1 + (pi L s)^2)) + k0
    with s the frequency along the motion, k0 the `static_share` (what does not move) and k1 the `zero_fill` (motion
    that is not quite uniform fills the zeros of sinc^2 in).
    """

    noise_std: float
    texture: tuple[float, ...]  # factors of `texture_terms`
    lowest_frequency: float  # cycles per pixel; the texture is flat below
    static_share: float = 0.0
    zero_fill: float = 0.0

    @property
    def amplitude(self) -> float:
        """S_f at 0.1 cycles per pixel, mean over directions (of the logarithm) and without roll-off."""
        return float(np.exp(self.texture[0]))

    @property
    def exponent(self) -> float:
        """Exponent of the power law at 0.1 cycles per pixel: S_f ~ r^-exponent."""
        return self.texture[1]

    def texture_psd(self, u: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Return S_f, the power spectral density of the sharp texture, at frequencies of any (broadcast) shape."""
        return np.exp(texture_terms(u, v, lowest_frequency=self.lowest_frequency) @ np.asarray(self.texture))

    def noise_psd(self) -> float:
        """Return the power spectral density of the noise, the same at all frequencies."""
        return self.noise_std**2
