"""The model of the power spectrum: sharp texture times the blur's transfer, plus white noise; and what is known before.

Parameters, in this order: displacement to the right and up [px], ln of the noise density, ln of the static share, ln of
the zero fill, the 14 factors of `texture_terms`. Densities are those of a picture scaled to standard deviation 1.
"""

import numpy as np

from uwsim.motion_blur.spectrum import TEXTURE_TERMS, Spectrum

RIGHT, UP, NOISE, STATIC, FILL = range(5)
TEXTURE = slice(5, 5 + TEXTURE_TERMS)
PARAMETERS = 5 + TEXTURE_TERMS
ROLL_OFF = TEXTURE.start + 3
ELLIPSE = [TEXTURE.stop - 2, TEXTURE.stop - 1]  # the roll-off's part in cos 2 phi, in sin 2 phi
LIMITS = {NOISE: (-28.0, 8.0), STATIC: (-12.0, -0.1), FILL: (-12.0, 8.0)}

# what the logarithm of a picture's spectrum looks like: mean and standard deviation of each factor, after the spectra of
# natural pictures; the amplitude is free
_EXPONENT = 2.8
_TEXTURE_STD = np.array([np.inf, 1, 0.3, 1] + [0.6, 0.6, 0.3, 0.3] + [0.4, 0.4, 0.2, 0.2] + [0.1, 0.1])
# the prior stands against this many frequencies at once, so that what the texture's form gets wrong does not bend it
TEXTURE_STRENGTH = 30.0
SHARE_STRENGTH = 30.0
_SHARE_LN = -8.0
# of motion that is not uniform
_LOOSE_SHARE_LN, _LOOSE_SHARE_STRENGTH = -5.0, 5.0
_ELLIPSE_FREE_STD = 10.0


def prior(
    *, lens_std_px: float = 0.0, uniform: bool = True, ellipse_free: bool = False
) -> tuple[np.ndarray, np.ndarray]:
    """Return (mean, precision) of the Gaussian prior of every parameter; precision 0 where nothing is known.

    `lens_std_px`: standard deviation of the lens's Gaussian spot, which rolls every spectrum off. `uniform`: static
    share and zero fill are small. `ellipse_free`: the roll-off may depend on the direction as much as it likes.
    """
    mean, precision = np.zeros(PARAMETERS), np.zeros(PARAMETERS)
    mean[TEXTURE.start + 1] = _EXPONENT
    mean[ROLL_OFF] = (np.pi * lens_std_px) ** 2
    precision[TEXTURE] = TEXTURE_STRENGTH / _TEXTURE_STD**2
    if ellipse_free:
        precision[ELLIPSE] = TEXTURE_STRENGTH / _ELLIPSE_FREE_STD**2
    mean[[STATIC, FILL]] = _SHARE_LN if uniform else _LOOSE_SHARE_LN
    precision[[STATIC, FILL]] = SHARE_STRENGTH if uniform else _LOOSE_SHARE_STRENGTH
    return mean, precision


def transfer(along: np.ndarray, zero_fill: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return, at length times frequency, the moving part's squared transfer, its slope, and the zero fill's form."""
    safe = np.where(np.abs(along) < 1e-3, np.asarray(1e-3, along.dtype), along)
    angle = np.asarray(np.pi, along.dtype) * safe
    sinc = np.sin(angle) / angle
    ramp = 1 / (1 + angle**2)
    slope = 2 * sinc * (np.cos(angle) - sinc) / safe - 2 * np.asarray(np.pi, along.dtype) * angle * zero_fill * ramp**2
    return sinc**2 + zero_fill * ramp, slope, ramp


def losses(power: np.ndarray, density: np.ndarray, clip: float) -> tuple[np.ndarray, np.ndarray]:
    """Return (loss, minus its derivative by ln density) of each frequency.

    The loss is Whittle's, ln P + I / P, but continues as a straight line in ln P where I / P exceeds `clip`: single
    strong lines of the texture would rule the fit else.
    """
    ratio = power / density
    clipped = np.minimum(ratio, clip)
    beyond = np.log(np.maximum(ratio, clip) / clip)
    return np.log(density) + clipped + clip * beyond, clipped - 1


def spectrum(parameters: np.ndarray, *, scale: float, lowest_frequency: float) -> Spectrum:
    """Return what the parameters say of a picture whose standard deviation is `scale`, in its units."""
    texture = parameters[TEXTURE].copy()
    texture[0] += 2 * np.log(scale)
    static, fill, noise = np.exp(parameters[[STATIC, FILL, NOISE]])
    return Spectrum(
        noise_std=float(scale * np.sqrt(noise)), texture=tuple(float(factor) for factor in texture),
        lowest_frequency=lowest_frequency, static_share=float(static), zero_fill=float(fill),
    )  # fmt: skip
