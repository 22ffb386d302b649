"""The lamps' light computed and taken out: modelled backscatter subtracted, modelled illumination divided by.

A robot knows its lamps, camera and port, can measure its water, and has a range map from stereo or a map. With these
the Jaffe-McGlamery model gives the backscatter of every pixel and what a white surface there would send to the camera.
The image less the backscatter, over that, is the surface; light that was scattered forwards on its way to the camera is
given back to where it came from by a few corrections, and noise is averaged out where it is all there is. The surface
is shown as the same lamps would light it without water.

Source: our own; the layers: McGlamery 1980, Jaffe 1990 (`formation.models.jaffe_mcglamery`); corrections: Van Cittert
1931, Z. Physik 69:298; noise: Lee 1980 (`restoration.noise_aware`).
Valid: light of the lamps alone, no daylight; water, lamps and range as given (no layer of the truth).
Where the water hides the body, what is shown is the mean reflectance in the lamps' light at the given range: such
shapes come from the range map, not from the picture.
"""

import numpy as np

from uwsim.restoration.lamp_view import LampLight, lamp_light
from uwsim.restoration.noise_aware import believed, noise_excess

INPUT = "linear_float32"
NEEDS = ("range_m", "rig")

CORRECTIONS = 3
# variance of rounding to 8 bit, in units of the encoded value
_ROUNDING = 1 / 12 / 255**2
# of the brightest white: less light says nothing
_DARKEST = 1e-4


def restore(image: np.ndarray, *, range_m: np.ndarray, rig: dict, corrections: int = CORRECTIONS) -> np.ndarray:
    """Return the linear image (H, W, 3) float32 in [0, 1] as it would be without the water; 0 where no body is seen.

    `range_m` (H, W) [m], +inf where no body is seen; `rig`: see `uwsim.bench.restoration`. `corrections`: how often
    forward scatter is given back; each adds detail and noise. Raises ValueError for a range map of another size or not
    above 0, a rig without lamps, and a negative number of corrections.
    """
    if corrections < 0:
        raise ValueError(f"lamp_model: corrections = {corrections}, allowed: 0 or more")
    light = lamp_light(range_m, rig)
    surface, amplified = reflected(image - light.backscatter, light, corrections)
    white = white_signal(light)
    lit = white > _DARKEST * white.max()
    noise = measured_variance(image, rig["noise"]) * (amplified / np.where(lit, white, 1)) ** 2
    noise = np.where(lit, noise, np.inf)
    shown = np.dstack([believed(np.where(lit, surface, 0)[..., k], noise[..., k]) for k in range(3)])
    return np.clip(shown * light.water_free, 0, 1)


def reflected(signal: np.ndarray, light: LampLight, corrections: int = CORRECTIONS) -> tuple[np.ndarray, np.ndarray]:
    """Return the reflectance (H, W, 3) seen in an image without backscatter, and how much more its fine noise is.

    u <- u + q (S - H u) / (H 1) with H u = direct u + blur(scattered u) and q = direct / (H 1): where little arrives
    unscattered there is no detail to give back. The noise of single pixels, which the blur does not reach, is thereby
    multiplied by a <- a (1 - q^2) + q. Pixels without light stay 0.
    """
    white = white_signal(light)
    lit = white > _DARKEST * white.max()
    per_white = np.where(lit, 1 / np.where(lit, white, 1), 0).astype(np.float32)
    found, amplified = signal * per_white, np.ones_like(white)
    sharp = light.direct * per_white
    for _ in range(corrections):
        again = light.direct * found + light.spread.blur(light.scattered * found)
        found = found + sharp * (signal - again) * per_white
        amplified = amplified * (1 - sharp * sharp) + sharp
    return found, amplified


def white_signal(light: LampLight) -> np.ndarray:
    """Return what a white surface sends to the camera, (H, W, 3), forward scatter spread."""
    return light.direct + light.spread.blur(light.scattered)


def measured_variance(image: np.ndarray, noise: dict) -> np.ndarray:
    """Return `noise_variance`, each band raised to the noise that the image itself shows where that is more."""
    expected = noise_variance(image, noise)
    excess = np.dstack([noise_excess(image[..., k], expected[..., k]) for k in range(3)])
    return expected * np.square(np.maximum(excess, 1))


def noise_variance(image: np.ndarray, noise: dict) -> np.ndarray:
    """Return the variance (H, W, 3) of shot noise, dark noise and 8-bit rounding of a linear image.

    `noise`: {"electrons": photo-electrons that make 1 (3,), "dark_variance_e2"}.
    """
    electrons = np.asarray(noise["electrons"], np.float64)
    counted = np.maximum(image, 0) * electrons
    # slope of the linear value over the encoded one (IEC 61966-2-1)
    slope = np.where(image <= 0.0031308, 1 / 12.92, 2.4 / 1.055 * np.maximum(image, 0.0031308) ** (1.4 / 2.4))
    return (counted + noise["dark_variance_e2"]) / electrons**2 + _ROUNDING * slope**2
