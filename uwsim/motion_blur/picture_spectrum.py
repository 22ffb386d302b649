"""White noise and texture of a blurred picture whose blur is known: what a deconvolution weighs against each other.

Frequencies u (columns, x right) and v (rows, y down) are in cycles per pixel; densities are in squared image units, so
that white noise of standard deviation s has the density s^2.
"""

from dataclasses import dataclass

import numpy as np

from uwsim.motion_blur.kernels import otf

_REFERENCE_FREQUENCY = 0.1
_ORDERS = (2, 4)
# ln S_f a priori: 1 / r^2.8, mildly curved and uneven in direction; the level and the noise are free. Exponents of
# natural pictures lie between 2 and 4: Tolhurst, Tadmor and Chao, Ophthalmic and Physiological Optics 12, 1992
_PRIOR_MEAN = np.array([0.0, 2.8, 0.0, 0.0] + [0.0] * 8)
_PRIOR_STD = np.array([np.inf, 1.0, 0.3, 1.0] + [0.6, 0.6, 0.3, 0.3] + [0.4, 0.4, 0.2, 0.2])
# the prior has to stand against tens of thousands of bins, which real textures fit only roughly
_PRIOR_WEIGHT = 30.0
_TAPER_SHARE = 0.25
_LEAKAGE_REACH = 2
_FIRST_BIN = 3
_MOST_BINS = 40_000
_OUTLIER = 8.0
_STEPS = 40
# noise below this share of the standard deviation is none: less than the rounding of 12 bits
_LEAST_NOISE_SHARE = 1e-4


@dataclass(frozen=True)
class PictureSpectrum:
    """Noise and texture of a picture; `texture` holds the factors of `_terms`, flat below `lowest_frequency`."""

    noise_std: float
    texture: tuple[float, ...]
    lowest_frequency: float

    def texture_psd(self, u: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Return the power spectral density of the sharp texture at frequencies of any (broadcast) shape."""
        return np.exp(_terms(u, v, self.lowest_frequency) @ np.asarray(self.texture))


def fitted_spectrum(picture: np.ndarray, *, length_px: float, angle_deg: float) -> PictureSpectrum:
    """Return noise and texture of an (H, W) picture blurred by a uniform straight motion, known to be this one.

    Maximises the Whittle likelihood, with weak priors, of |H|^2 S_f + noise^2 over the periodogram of the tapered
    picture; ln S_f is a power law with curvature, roll-off and dependence on direction.

    Source: Whittle, J. Royal Statistical Society B 15, 1953 (likelihood of a spectrum); Fisher scoring.
    Valid: texture much the same all over the picture, noise white.
    """
    height, width = picture.shape
    tapers = [_taper(side) for side in (height, width)]
    window = tapers[0][:, None] * tapers[1][None, :]
    centred = picture - (window * picture).sum() / window.sum()
    density = np.abs(np.fft.rfft2(window * centred)) ** 2 / (window**2).sum()
    u, v = np.fft.rfftfreq(width)[None, :], np.fft.fftfreq(height)[:, None]
    gain = otf((height, width), length_px=length_px, angle_deg=angle_deg) ** 2
    gain = _leaked(_leaked(gain, tapers[0], axis=0), tapers[1], axis=1)[:, : width // 2 + 1]
    # each pair of conjugate bins once; the lowest belong to shading, not to texture
    half = np.hypot(u, v) >= _FIRST_BIN / min(height, width)
    half[:, 0] &= v[:, 0] > 0
    chosen = np.flatnonzero(half)
    chosen = chosen[:: -(-chosen.size // _MOST_BINS)]
    u, v = (np.broadcast_to(axis, half.shape).ravel()[chosen] for axis in (u, v))
    lowest = 1 / max(height, width)
    least_noise = (_LEAST_NOISE_SHARE * centred.std()) ** 2
    texture, noise = _fit(
        density.ravel()[chosen], gain.ravel()[chosen], _terms(u, v, lowest), np.hypot(u, v) > 0.6, least_noise
    )
    return PictureSpectrum(float(np.sqrt(noise)), tuple(float(factor) for factor in texture), lowest)


def _terms(u: np.ndarray, v: np.ndarray, lowest_frequency: float) -> np.ndarray:
    """Return the terms of ln S_f, (..., 12): level, power law, curvature, roll-off, and direction (orders 2 and 4)."""
    u, v = np.broadcast_arrays(u, v)
    r = np.maximum(np.hypot(u, v), lowest_frequency)
    x = np.log(r / _REFERENCE_FREQUENCY)
    phi = np.arctan2(-v, u)
    terms = [np.ones_like(x), -x, x**2, -((r / 0.5) ** 2)]
    for order in _ORDERS:
        cosine, sine = np.cos(order * phi), np.sin(order * phi)
        terms += [cosine, sine, x * cosine, x * sine]
    return np.stack(terms, axis=-1)


def _fit(density, gain, terms, high, least_noise) -> tuple[np.ndarray, float]:
    """Return (factors of the terms, noise density) of greatest posterior probability, by damped Fisher scoring."""
    precision = np.append(_PRIOR_WEIGHT / _PRIOR_STD**2, 0.0)
    centre = np.append(_PRIOR_MEAN, 0.0)

    def model(factors):
        texture = gain * np.exp(terms @ factors[:-1])
        return texture, texture + np.exp(factors[-1])

    def loss(factors):
        total = model(factors)[1]
        prior = precision * (factors - centre) ** 2
        return float(np.sum(np.log(total) + np.minimum(density / total, _OUTLIER)) + prior.sum() / 2)

    # the 25th percentile of an exponential density is 0.2877 of its mean
    noise = max(np.percentile(density[high] if high.any() else density, 25) / 0.2877, least_noise)
    factors = np.append(_PRIOR_MEAN, np.log(noise))
    shape = gain * np.exp(terms @ _PRIOR_MEAN)
    factors[0] = np.log(max(density.mean() - noise, 0.1 * density.mean()) / shape.mean())
    best, damping = loss(factors), 1e-3
    for _ in range(_STEPS):
        texture, total = model(factors)
        slopes = np.column_stack([terms * (texture / total)[:, None], np.exp(factors[-1]) / total])
        excess = np.minimum(density / total, _OUTLIER) - 1
        gradient = slopes.T @ excess - precision * (factors - centre)
        curvature = slopes.T @ slopes + np.diag(precision)
        step = np.linalg.solve(curvature + damping * np.diag(np.diag(curvature) + 1e-9), gradient)
        trial = factors + np.clip(step, -2, 2)
        trial[-1] = max(trial[-1], np.log(least_noise))
        value = loss(trial)
        if value < best:
            done = best - value < 1e-2
            factors, best, damping = trial, value, damping / 5
            if done:
                break
        else:
            damping *= 10
            if damping > 1e6:
                break
    return factors[:-1], float(np.exp(factors[-1]))


def _taper(side: int) -> np.ndarray:
    from scipy.signal.windows import tukey

    return tukey(side, _TAPER_SHARE)


def _leaked(gain: np.ndarray, taper: np.ndarray, axis: int) -> np.ndarray:
    """Return the transfer as the tapered picture shows it: averaged over neighbours with the taper's power."""
    from scipy.ndimage import convolve1d

    power = np.abs(np.fft.fft(taper)) ** 2
    near = np.concatenate([power[-_LEAKAGE_REACH:], power[: _LEAKAGE_REACH + 1]])
    return convolve1d(gain, near / near.sum(), axis=axis, mode="wrap")
