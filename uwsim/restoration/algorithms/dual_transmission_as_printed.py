"""The dissertation's dual-transmission restoration as its formulas are printed, for comparison with the corrected one.

Source: the dissertation, chapter 3, eqs 3.1-3.14, without the corrections that stand at the functions of
`uwsim.restoration.dual_transmission`. What is not printed: the bound, for which eq. 3.2 repeats 3.3 (Meng et al., ICCV
2013, eq. 7, one per channel as the index c says, with their radiances 20 and 300 of 255), window, gamma_1, p, CLAHE's
numbers, and which picture's ambient light enters: the usual values, and the one that the text names last.
Errata: as listed there; eq. 3.9 gives all channels one light, so that eqs 3.10 and 3.11 change nothing; eq. 3.8 pushes
the transmission below its own bound; eq. 3.13 turns what lies below t0 black.
"""

import numpy as np

from uwsim.restoration import ambient_light, colour_constancy
from uwsim.restoration.dark_channel import dark_channel
from uwsim.restoration.levels import lightness_equalised, luma, to_uint8, unit

INPUT = "srgb_uint8"
NEEDS = ()

SIDE_PX = 15
GAMMA_1 = 0.9
SMALLEST_TRANSMISSION = 0.1
DARKEST, BRIGHTEST = 20 / 255, 300 / 255
CLIP_LIMIT = 2.0


def restore(image: np.ndarray) -> np.ndarray:
    """Return the (H, W, 3) uint8 sRGB image restored by the printed formulas; ValueError on anything else."""
    picture = unit(image)
    corrected, ambient = colour_corrected(picture)
    transmission = np.maximum(bound(corrected, ambient), local_contrast(corrected)[..., None]) * GAMMA_1
    return lightness_equalised(to_uint8(solved(corrected, transmission, ambient)), clip_limit=CLIP_LIMIT)


def colour_corrected(picture: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the picture (H, W, 3) and its ambient light (3,) by eqs 3.9-3.11 and Shades of Gray."""
    brightest = ambient_light.brightest(dark_channel(picture, side_px=SIDE_PX), picture)
    of_all_channels = picture.max(axis=2)[brightest].mean()
    scale = np.ones(3) if of_all_channels == 0 else np.full(3, of_all_channels) / of_all_channels
    corrected = picture * scale.astype(np.float32)
    return corrected, colour_constancy.light(corrected)


def bound(picture: np.ndarray, ambient: np.ndarray) -> np.ndarray:
    """Return the transmission (H, W, 3) in [0, 1] of eq. 3.3, channel by channel; 0 where the bound has no value."""
    import cv2

    level = ambient.astype(np.float32)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.fmax((level - picture) / (level - DARKEST), (level - picture) / (level - BRIGHTEST))
    lowest = np.clip(np.nan_to_num(ratio, nan=0.0), 0, 1).astype(np.float32)
    return cv2.morphologyEx(lowest, cv2.MORPH_CLOSE, np.ones((SIDE_PX, SIDE_PX), np.uint8))


def local_contrast(picture: np.ndarray) -> np.ndarray:
    """Return the Michelson contrast (H, W) of the grey picture in each window, eq. 3.7; 0 where it is black."""
    import cv2

    grey, window = luma(picture), np.ones((SIDE_PX, SIDE_PX), np.uint8)
    largest, smallest = cv2.dilate(grey, window), cv2.erode(grey, window)
    total = largest + smallest
    return np.divide(largest - smallest, total, out=np.zeros_like(total), where=total > 0)


def solved(picture: np.ndarray, transmission: np.ndarray, ambient: np.ndarray) -> np.ndarray:
    """Return (I - A + A t) / max(t0, t), eq. 3.13; not clipped."""
    level = ambient.astype(np.float32)
    return (picture - level + level * transmission) / np.maximum(transmission, np.float32(SMALLEST_TRANSMISSION))
