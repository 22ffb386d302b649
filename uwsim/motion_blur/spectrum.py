"""What a spectrum fit found of a picture: white noise and the power spectral density of its sharp texture.

Frequencies u (columns, x right) and v (rows, y **down**) are in cycles per pixel, as `numpy.fft.fftfreq` gives
them; densities are in squared image units, so that white noise of standard deviation s has the density s^2.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

REFERENCE_FREQUENCY = 0.1  # cycles per pixel: where the amplitude of the power law is quoted
NYQUIST_FREQUENCY = 0.5
TEXTURE_TERMS = 14


def texture_terms(u: np.ndarray, v: np.ndarray, *, lowest_frequency: float) -> np.ndarray:
    """Return the terms of ln S_f at frequencies u, v of any (broadcast) shape (...): (..., 14) float64.

    With r the distance from frequency 0, at least `lowest_frequency` (> 0), phi its direction (x right, y up) and
    x = ln(r / 0.1): 1, -x, x^2, -(r / 0.5)^2, then cos m phi, sin m phi, x cos m phi, x sin m phi for m = 2 and 4, then
    -(r / 0.5)^2 times cos 2 phi and sin 2 phi: with the fourth, a Gaussian roll-off that is an ellipse.
    """
    return np.stack(list(_terms(u, v, lowest_frequency)), axis=-1)


def _terms(u: np.ndarray, v: np.ndarray, lowest_frequency: float) -> Iterator[np.ndarray]:
    """Yield the terms of `texture_terms` one by one."""
    u, v = np.broadcast_arrays(np.asarray(u, float), np.asarray(v, float))
    distance = np.hypot(u, v)
    # the direction of frequency 0 is taken to be x
    right = np.divide(u, distance, out=np.ones_like(distance), where=distance > 0)
    up = np.divide(-v, distance, out=np.zeros_like(distance), where=distance > 0)
    r = np.maximum(distance, lowest_frequency)
    x = np.log(r / REFERENCE_FREQUENCY)
    roll_off = -((r / NYQUIST_FREQUENCY) ** 2)
    yield from (np.ones_like(x), -x, x**2, roll_off)
    twice = right**2 - up**2, 2 * right * up
    # orders 2 and 4; odd ones cannot be: a real picture's spectrum is even
    for cosine, sine in (twice, (twice[0] ** 2 - twice[1] ** 2, 2 * twice[0] * twice[1])):
        yield from (cosine, sine, x * cosine, x * sine)
    yield from (roll_off * twice[0], roll_off * twice[1])


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
        terms = _terms(u, v, self.lowest_frequency)
        return np.exp(sum(factor * term for factor, term in zip(self.texture, terms, strict=True)))

    def noise_psd(self) -> float:
        """Return the power spectral density of the noise, the same at all frequencies."""
        return self.noise_std**2
