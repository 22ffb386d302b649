"""The lamps' light computed and taken out: modelled backscatter subtracted, modelled illumination divided by.

A robot knows its lamps, camera and port, can measure its water, and has a range map from stereo or a map. With these
the Jaffe-McGlamery model gives the backscatter of every pixel and what a white surface there would send to the camera.
The image without its noise, less the backscatter, over that, is the surface; light that was scattered forwards on its
way to the camera is given back to where it came from. The surface is shown as the same lamps would light it without
water.

Shading and shadows are seen in the picture as long as light arrives straight; where most of it is scattered they are
washed out, and are taken from the shape that the range map has (`relief`). The two pictures are mixed by how much of
the light was scattered nowhere. Where little light reaches the camera straight, the model does not know how much
contrast is left of detail: the picture's own is shown instead, with that of an everyday picture (`local_contrast`).

Source: our own; the layers: McGlamery 1980, Jaffe 1990 (`formation.models.jaffe_mcglamery`); corrections: Van Cittert
1931, Z. Physik 69:298; noise: Yu and Sapiro 2011 (`restoration.sliding_dct`), what is left of it: Lee 1980
(`restoration.noise_aware`).
Valid: light of the lamps alone, no daylight; water, lamps and range as given (no layer of the truth).
Where the water hides the body, what is shown is the usual reflectance in the lamps' light at the given range: such
shapes come from the range map, not from the picture. Where contrast is the usual one, brightness is no measurement.
"""

import numpy as np

from uwsim.images import srgb_decode, srgb_encode
from uwsim.restoration.lamp_view import LampLight, backscatter, excess, lamp_light, white_view
from uwsim.restoration.local_contrast import with_usual_contrast
from uwsim.restoration.noise_aware import believed_colour, noise_excess
from uwsim.restoration.sliding_dct import denoised

INPUT = "linear_float32"
NEEDS = ("range_m", "rig")

CORRECTIONS = 1
# Chosen on training layouts of restoration_tank, on tank_small, and on views of tank and tank_charts that are in no
# benchmark; lengths are shares of the picture's width.
# Detail finer than this is given back by the light that arrived straight.
_DETAIL = 0.01
# of all that arrives: where less arrives straight, its detail is that of the model's errors
_LEAST_STRAIGHT = 0.04
# where this much arrives straight, the model's contrast of detail and the usual one count alike
_EQUALLY_SURE, _STEEP = 0.2, 4
# of the variance of noise, about what denoising leaves
_NOISE_LEFT = 0.1
# reflectance is usually about this
_USUAL, _USUAL_STD = 0.18, 0.12
# errors of the model per excess of multiple scattering, of the backscatter and of the light on bodies; how smooth
_BACKSCATTER_ERROR, _ILLUMINATION_ERROR, _SMOOTH = 0.2, 1.2, 0.06
_POSSIBLE = (-0.5, 2.0)
_ABOUT_PX = 5
# variance of rounding to 8 bit, in units of the encoded value
_ROUNDING = 1 / 12 / 255**2
# of the brightest white: less light says nothing
_DARKEST = 1e-4


def restore(
    image: np.ndarray, *, range_m: np.ndarray, rig: dict, corrections: int = CORRECTIONS, shaped: bool = True,
    usual_contrast: bool = True,
) -> np.ndarray:  # fmt: skip
    """Return the linear image (H, W, 3) float32 in [0, 1] as it would be without the water; 0 where no body is seen.

    `range_m` (H, W) [m], +inf where no body is seen; `rig`: see `uwsim.bench.restoration`. `corrections`: how often
    forward scatter is given back; each adds detail and noise. `shaped`: shading and shadows also from the range map.
    `usual_contrast`: whether detail is shown with the usual contrast where the model does not know it.
    Raises ValueError for a range map of another size or not above 0, a rig without lamps, and a negative number of
    corrections.
    """
    if corrections < 0:
        raise ValueError(f"lamp_model: corrections = {corrections}, allowed: 0 or more")
    view = white_view(range_m, rig)
    back, noise = backscatter(view, rig), measured_variance(image, rig["noise"])
    seen = denoised(image, noise)
    given = {"signal": seen - back, "noise": _NOISE_LEFT * noise, "back": back, "more": excess(view, rig)}
    light = lamp_light(view, rig)
    shown = believed_surface(light=light, corrections=corrections, **given) * light.water_free
    lit = lamp_light(view, rig, shaped=True) if shaped else light
    if shaped:
        by_shape = believed_surface(light=lit, corrections=corrections, **given) * lit.water_free
        shown = by_shape + _share(light.unscattered, light) * (shown - by_shape)
    shown = np.clip(shown, 0, 1)
    if usual_contrast:
        behind = srgb_encode(believed_surface(light=lit, corrections=0, **given) * lit.water_free)
        sure = _sure(light)
        encoded = sure * srgb_encode(shown) + (1 - sure) * with_usual_contrast(behind, seen, noise)
        shown = np.where(view.has_body[..., None], srgb_decode(np.clip(encoded, 0, 1)), 0)
    return shown.astype(np.float32)


def _share(part: np.ndarray, light: LampLight) -> np.ndarray:
    """Return a part of a white surface's light over all of it, (H, W, 3) in [0, 1]; 0 where there is none."""
    return np.clip(part / np.maximum(light.white, np.finfo(np.float32).tiny), 0, 1)


def _sure(light: LampLight) -> np.ndarray:
    """Return how far the model knows the contrast of detail, (H, W, 1) in [0, 1]: by the light that comes straight."""
    import cv2

    straight = _share(light.direct, light).mean(axis=2)
    power = (straight / _EQUALLY_SURE) ** _STEEP
    return cv2.GaussianBlur(power / (1 + power), (0, 0), _DETAIL * straight.shape[1])[..., None]


def believed_surface(*, signal, light: LampLight, noise, back, more, corrections: int) -> np.ndarray:
    """Return the reflectance (H, W, 3) as far as it can be believed, of an image less its backscatter `back`.

    `noise`: variance of the image (H, W, 3); `more` (3,): the model's excess of multiple scattering, by which it errs.
    """
    lit = _lit(light)
    found = reflected(signal, light, corrections)
    found = tempered(found, np.where(lit, back / np.where(lit, light.white, 1), 0), lit, more)
    doubted = np.maximum(light.direct, _LEAST_STRAIGHT * light.white)
    variance = np.where(lit, noise / np.where(lit, np.square(doubted), 1), np.inf)
    return believed_colour(np.where(lit, found, 0), variance)


def reflected(signal: np.ndarray, light: LampLight, corrections: int = CORRECTIONS) -> np.ndarray:
    """Return the reflectance (H, W, 3) seen in an image without backscatter; pixels without light stay 0.

    r = S - H u with H u = direct u + blur(scattered u). What is coarse in r is given back to u over H 1; what is fine,
    which the blur does not reach, over what arrives straight, D: u <- u + smooth(r) / (H 1) + (r - smooth(r)) / D.
    Where D is but a small part e of all, 1 / D falls to 0 again, as D / (D^2 + (e H 1)^2).
    """
    import cv2

    lit = _lit(light)
    least = np.square(_LEAST_STRAIGHT * light.white)
    per_white = np.where(lit, 1 / np.where(lit, light.white, 1), 0).astype(np.float32)
    per_straight = np.where(lit, light.direct / np.where(lit, np.square(light.direct) + least, 1), 0)
    found = (signal * per_white).astype(np.float32)
    for _ in range(corrections):
        left = signal - light.direct * found - light.spread.blur(light.scattered * found)
        coarse = cv2.GaussianBlur(left, (0, 0), _DETAIL * left.shape[1])
        found = np.clip(found + coarse * per_white + (left - coarse) * per_straight, *_POSSIBLE).astype(np.float32)
    return found


def _lit(light: LampLight) -> np.ndarray:
    return light.white > _DARKEST * light.white.max()


def tempered(found: np.ndarray, veil: np.ndarray, lit: np.ndarray, more: np.ndarray) -> np.ndarray:
    """Return a reflectance (H, W, 3) whose coarse part is drawn to the usual by as much as the model may err there.

    `veil`: backscatter over the light of a white surface; `lit` (H, W, 3) bool. The mean-square estimate of a mean of
    known spread from a value of known error.
    """
    drawn = np.empty_like(found)
    for k in range(3):
        here = _smooth(lit[..., k]) + np.float32(1e-6)
        mean = _smooth(np.where(lit[..., k], found[..., k], 0)) / here
        of_veil = _BACKSCATTER_ERROR * more[k] * _smooth(veil[..., k]) / here
        of_light = _ILLUMINATION_ERROR * more[k] * np.maximum(mean, _USUAL)
        trust = _USUAL_STD**2 / (_USUAL_STD**2 + of_veil**2 + of_light**2)
        drawn[..., k] = found[..., k] - (1 - trust) * (mean - _USUAL)
    return drawn


def _smooth(image: np.ndarray) -> np.ndarray:
    import cv2

    return cv2.GaussianBlur(image.astype(np.float32), (0, 0), _SMOOTH * image.shape[1])


def measured_variance(image: np.ndarray, noise: dict) -> np.ndarray:
    """Return the variance (H, W, 3) of an image's noise, raised to what the image itself shows where that is more.

    `noise` as in `noise_variance`, which is of the mean about each pixel: taken of the pixel itself it would be small
    where noise made it dark, and a mean weighted with it too dark.
    """
    import cv2

    expected = noise_variance(cv2.blur(np.asarray(image, np.float32), (_ABOUT_PX, _ABOUT_PX)), noise)
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
