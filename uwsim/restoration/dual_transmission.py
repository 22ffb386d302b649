"""Restoration with two maps of the transmission: a bound from the range of radiances, and local contrast.

I = J t + A (1 - t), solved for the object J on the 8-bit sRGB values as in the literature. As that holds in linear
light, t is a weight of the restoration rather than a physical transmission.

Source: the dissertation, chapter 3, eqs 3.1-3.14; each step has its own source and errata at its function.
"""

from dataclasses import dataclass

import numpy as np

from uwsim.restoration import ambient_light, colour_constancy, guided_filter
from uwsim.restoration.dark_channel import local_minimum
from uwsim.restoration.dim_channels import held_channels
from uwsim.restoration.levels import LUMA, check_picture, lightness_equalised

# t varies slowly: it is found on a copy with a shorter side of at most this, in windows of that copy
WORKING_SIDE_PX = 240
WINDOW_PX = 7
REFINEMENT = {"radius_px": 20, "epsilon": 1e-3, "subsample": 2}
# possible radiances, of white (Meng et al., 20 and 300 of 255)
DARKEST, BRIGHTEST = 20 / 255, 300 / 255
GAINS = (0.3, 3.0)
# the darkest places, the brightness over the mean at which all is veil, and what is left of the exponent without any
_DARKEST_SHARE, _FULL_VEIL, _LEAST_VEIL = 0.005, 0.6, 0.07


@dataclass(frozen=True)
class Steps:
    """Which steps are taken, and their numbers; the defaults are the method.

    colour      channels scaled by the ambient light, then Shades of Gray as ambient light; without: nothing scaled,
                the ambient light is that of the dark channel
    share       of the pixels, those of highest dark channel, whose mean is the ambient light to scale by, (0, 1]
    boundary, contrast  the two maps of the transmission; at least one of them
    exponent    of their fusion in a picture full of veil, (0, 1]
    adaptive    the exponent falls with the veil (`veil`): a clear picture stays what it is
    refine      guided filter of the transmission
    floor       t0, the least transmission to divide by, (0, 1]
    clip_limit  of CLAHE on the lightness; 0: no CLAHE
    monochrome  channels that the water has emptied are left out, and shown as the mean of the others
    norm        p of Shades of Gray, >= 1

    The printed chapter leaves exponent, clip limit and p open; these were chosen on layouts of restoration_tank and
    tank_small, by PSNR, as was `share`, of which it prints 0.1 %: in the light of lamps those pixels are the brightest
    body, not the water. `adaptive` is not in the chapter.
    Raises ValueError on other values.
    """

    colour: bool = True
    boundary: bool = True
    contrast: bool = True
    exponent: float = 0.3
    adaptive: bool = True
    refine: bool = True
    floor: float = 0.1
    clip_limit: float = 0.3
    monochrome: bool = True
    norm: float = 1.0
    share: float = 1.0

    def __post_init__(self):
        for name in ("colour", "boundary", "contrast", "adaptive", "refine", "monochrome"):
            if not isinstance(getattr(self, name), bool):
                raise ValueError(f"dual transmission: {name} = {getattr(self, name)!r}, allowed: true or false")
        if not (self.boundary or self.contrast):
            raise ValueError("dual transmission: boundary and contrast are both off, allowed: at least one on")
        for name in ("exponent", "floor", "share"):
            if not 0 < getattr(self, name) <= 1:
                raise ValueError(f"dual transmission: {name} = {getattr(self, name)}, allowed: above 0, at most 1")
        if not 0 <= self.clip_limit < np.inf:
            raise ValueError(f"dual transmission: clip_limit = {self.clip_limit}, allowed: 0 or more")


def restored(image: np.ndarray, steps: Steps) -> np.ndarray:
    """Return the restored picture (H, W, 3) uint8 of an sRGB picture (H, W, 3) uint8; ValueError on anything else."""
    import cv2

    check_picture(image)
    small = working_copy(image)
    held = held_channels(small) if steps.monochrome else (0, 1, 2)
    gains, ambient = light(small, held, colour=steps.colour, norm=steps.norm, share=steps.share)
    corrected = {channel: _scaled(small[channel], gains[channel]) for channel in held}
    coarse = fused(corrected, ambient, steps, strength=veil(small) if steps.adaptive else 1.0)

    levels = np.arange(256, dtype=np.float32) / 255
    planes = {channel: cv2.LUT(cv2.extractChannel(image, channel), _scaled(levels, gains[channel])) for channel in held}
    transmission = enlarged(coarse, corrected, planes, refine=steps.refine)
    # below t0 it would lift noise alone, and above 1 it would be no restoration
    transmission = np.clip(transmission, np.float32(steps.floor), np.float32(1), out=transmission)
    result = joined({channel: _solved(plane, transmission, ambient[channel]) for channel, plane in planes.items()})
    if steps.clip_limit == 0:
        return result
    # eq. 3.14 states neither colour space nor numbers
    return lightness_equalised(result, clip_limit=steps.clip_limit)


def working_copy(image: np.ndarray) -> list[np.ndarray]:
    """Return the channels (h, w) float32 in [0, 1] of a picture (H, W, 3) uint8, shrunk to the working size."""
    import cv2

    height, width = image.shape[:2]
    factor = max(1.0, min(height, width) / WORKING_SIDE_PX)
    if factor > 1:
        size = (max(1, round(width / factor)), max(1, round(height / factor)))
        image = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
    return [cv2.extractChannel(image, channel).astype(np.float32) / 255 for channel in range(3)]


def light(
    planes: list[np.ndarray], held: tuple[int, ...], *, colour: bool, norm: float, share: float = ambient_light.SHARE
) -> tuple[np.ndarray, np.ndarray]:
    """Return the gains and the ambient light (3,) of a picture's channels (H, W) in [0, 1]; not held: 0.

    `colour`, `norm`, `share`: as in `Steps`.
    Source: the dissertation, eqs 3.9-3.11 and the text after them; Shades of Gray: `colour_constancy`.
    Errata: eq. 3.9 averages the maximum over the channels, so that S_c = 1 in eq. 3.10: here channel by channel.
    Eq. 3.10 has no bound where a channel is dark: here `GAINS`. Eq. 3.11 calls the corrected picture A: here I'.
    Neither p nor the A of eq. 3.12 is stated: here A is the light of I'. Its level lies within the picture's range, so
    that the restoration stretches about a mean.
    """
    import cv2

    least = planes[held[0]]
    for channel in held[1:]:
        least = cv2.min(least, planes[channel])
    gains, ambient, taken = np.zeros(3), np.zeros(3), list(held)
    image = cv2.merge(planes)
    dark = local_minimum(least, side_px=WINDOW_PX)
    if not colour:
        gains[taken], ambient[taken] = 1, ambient_light.from_dark_channel(image, dark)[taken]
        return gains, ambient
    seen = ambient_light.from_dark_channel(image, dark, share=share)[taken]
    gains[taken] = colour_constancy.gains(seen, least=GAINS[0], largest=GAINS[1])
    corrected = cv2.merge([_scaled(plane, gain) for plane, gain in zip(planes, gains, strict=True)])
    ambient[taken] = colour_constancy.light(corrected, norm=norm)[taken]
    return gains, ambient


def _scaled(plane: np.ndarray, gain: float) -> np.ndarray:
    return np.minimum(plane * np.float32(gain), np.float32(1))


def veil(planes: list[np.ndarray]) -> float:
    """Return how much veil lies over a picture of channels (H, W) in [0, 1]: 0 none, 1 that of turbid water or more.

    Somewhere in a clear picture is a shadow, which a veil brightens: the ratio of the darkest places' brightest channel
    to its mean, full where it is 0.6. Chosen as `Steps` are.
    """
    import cv2

    brightest = cv2.max(cv2.max(planes[0], planes[1]), planes[2])
    mean = float(brightest.mean())
    if mean == 0:
        return 0.0
    return float(np.clip(np.quantile(brightest, _DARKEST_SHARE) / mean / _FULL_VEIL, _LEAST_VEIL, 1))


def fused(planes: dict[int, np.ndarray], ambient: np.ndarray, steps: Steps, *, strength: float = 1.0) -> np.ndarray:
    """Return the transmission (H, W) float32 of a picture's planes {channel: (H, W) in [0, 1]}, not refined.

    t = max(bound, contrast)^(exponent strength).
    Source: the dissertation, eq. 3.8.
    Errata: printed as the maximum times gamma_1 < 1, which undoes the bound that eq. 3.1 demands; "gamma fusion", a
    power, keeps it, and is what the text describes.
    """
    import cv2

    maps = []
    if steps.boundary:
        maps.append(bound(planes, ambient))
    if steps.contrast:
        maps.append(local_contrast(grey(planes)))
    largest = maps[0] if len(maps) == 1 else cv2.max(*maps)
    return cv2.pow(largest, steps.exponent * strength)


def bound(planes: dict[int, np.ndarray], ambient: np.ndarray) -> np.ndarray:
    """Return the least transmission (H, W) in [0, 1] with which all radiances stay possible, constant in patches.

    Source: Meng, Wang, Duan, Xiang, Pan, "Efficient image dehazing with boundary constraint and contextual
    regularization", ICCV 2013, eqs 7 and 9; the dissertation, eqs 3.1-3.5.
    Errata: eq. 3.2 of the dissertation repeats 3.3 in place of the bound, and has one bound per channel: by Meng one
    t, the largest over the channels. Where the ambient light is darker than C0 the bound changes sign: C0 is then
    half the ambient light.
    """
    import cv2

    lowest = None
    for channel, plane in planes.items():
        level = max(float(ambient[channel]), 1 / 255)
        darkest = min(DARKEST, level / 2)
        below = cv2.addWeighted(plane, -1 / (level - darkest), plane, 0, level / (level - darkest))
        above = cv2.addWeighted(plane, 1 / (BRIGHTEST - level), plane, 0, -level / (BRIGHTEST - level))
        here = cv2.max(below, above)
        lowest = here if lowest is None else cv2.max(lowest, here)
    window = np.ones((WINDOW_PX, WINDOW_PX), np.uint8)
    return cv2.morphologyEx(np.minimum(lowest, np.float32(1)), cv2.MORPH_CLOSE, window)


def local_contrast(image: np.ndarray) -> np.ndarray:
    """Return the Michelson contrast (H, W) in [0, 1] of the window around each pixel of a grey picture (H, W).

    Source: the dissertation, eq. 3.7. Errata: the text speaks of the red channel, which turbid water empties; the
    formula of the grey one. 0 where the window is black.
    """
    import cv2

    window = np.ones((WINDOW_PX, WINDOW_PX), np.uint8)
    largest, smallest = cv2.dilate(image, window), cv2.erode(image, window)
    return (largest - smallest) / np.maximum(largest + smallest, np.float32(1 / 255))


def grey(planes: dict[int, np.ndarray]) -> np.ndarray:
    """Return the weighted mean (H, W) of a picture's planes, by the weights of the luma, of the channels there are."""
    import cv2

    weights = LUMA[list(planes)].astype(float)
    share = weights / weights.sum()
    total = None
    for weight, plane in zip(share, planes.values(), strict=True):
        total = plane * np.float32(weight) if total is None else cv2.scaleAdd(plane, weight, total)
    return total


def enlarged(coarse, corrected, planes, *, refine: bool) -> np.ndarray:
    """Return the transmission (H, W) float32 at the size of `planes`, its edges on theirs if `refine`.

    Source: He and Sun, fast guided filter, 2015 (`guided_filter`). Errata: chapter 3 has no refinement, the conclusion
    of chapter 6 names guided filtering.
    """
    import cv2

    if not refine:
        height, width = next(iter(planes.values())).shape
        return cv2.resize(coarse, (width, height), interpolation=cv2.INTER_LINEAR)
    return guided_filter.guided_enlarged(grey(planes), grey(corrected), coarse, **REFINEMENT)


def _solved(plane: np.ndarray, transmission: np.ndarray, ambient: float) -> np.ndarray:
    """Return J = (I - A) / t + A of one channel, (H, W) uint8.

    Source: the dissertation, eq. 3.12, with the floor t0 of He et al. 2011.
    Errata: eq. 3.13 divides I - A + A t by the floor, which turns pixels black below t0: here they go towards A.
    """
    import cv2

    # sums with a number by addWeighted: cv2.add takes small arrays for numbers
    ratio = cv2.divide(cv2.addWeighted(plane, 1, plane, 0, -ambient), transmission, scale=255)
    return cv2.addWeighted(ratio, 1, ratio, 0, 255 * ambient, dtype=cv2.CV_8U)


def joined(planes: dict[int, np.ndarray]) -> np.ndarray:
    """Return the picture (H, W, 3) uint8 of its planes; a missing one is the mean of the others: grey stays grey."""
    import cv2

    if len(planes) < 3:
        given = list(planes.values())
        rest = given[0] if len(given) == 1 else cv2.addWeighted(given[0], 0.5, given[1], 0.5, 0)
        planes = {channel: planes.get(channel, rest) for channel in range(3)}
    return cv2.merge([planes[channel] for channel in range(3)])
