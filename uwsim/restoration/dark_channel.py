"""Steps that the dark channel prior and its kin for water share: minima, the light of the haze, its removal.

Source: He, Sun, Tang, "Single image haze removal using dark channel prior", IEEE Trans. PAMI 33(12), 2011;
transmission refined by the guided filter: He, Sun, Tang, IEEE Trans. PAMI 35(6), 2013.
"""

import numpy as np

from uwsim.restoration import ambient_light, guided_filter
from uwsim.restoration.levels import luma

SIDE_PX = 15
HAZE_KEPT = 0.95
SMALLEST_TRANSMISSION = 0.1
REFINED_RADIUS_PX = 60
REFINED_EPSILON = 1e-3
# coefficients of the refinement on every fourth pixel: its windows are 121 pixels wide
SUBSAMPLE = 4
# one level: a channel that is empty even in the haze says nothing of its share
_LEAST_AMBIENT = 1 / 255


def dark_channel(image: np.ndarray, *, side_px: int = SIDE_PX) -> np.ndarray:
    """Return the least value of all channels in the square about each pixel, (H, W); image (H, W, C) float."""
    return local_minimum(image.min(axis=2), side_px=side_px)


def local_minimum(values: np.ndarray, *, side_px: int = SIDE_PX) -> np.ndarray:
    """Return the least value in the square of `side_px` about each pixel, (H, W); what lies outside does not count."""
    import cv2

    return cv2.erode(np.ascontiguousarray(values), np.ones((side_px, side_px), np.uint8))


def haze_light(image: np.ndarray, dark: np.ndarray) -> np.ndarray:
    """Return the light of the haze (3,): the brightest pixel among those with the largest `dark` (`ambient_light`).

    Channels are at least 1/255.
    """
    pixels = image[ambient_light.brightest(dark, image)]
    return np.maximum(pixels[np.argmax(pixels.sum(axis=1))], _LEAST_AMBIENT)


def haze_transmission(image: np.ndarray, ambient: np.ndarray, *, side_px: int = SIDE_PX) -> np.ndarray:
    """Return 1 - 0.95 min min I/A, (H, W) float32; image (H, W, C), ambient (C,)."""
    return 1 - np.float32(HAZE_KEPT) * dark_channel(image / ambient.astype(np.float32), side_px=side_px)


def refined(transmission: np.ndarray, image: np.ndarray) -> np.ndarray:
    """Return the transmission (H, W) smoothed along the edges of the picture's brightness."""
    return guided_filter.guided(
        luma(image), transmission, radius_px=REFINED_RADIUS_PX, epsilon=REFINED_EPSILON, subsample=SUBSAMPLE
    )


def without_haze(image: np.ndarray, ambient: np.ndarray, transmission: np.ndarray) -> np.ndarray:
    """Return (I - A) / max(t, t0) + A, (H, W, 3) float32; not clipped."""
    ambient = ambient.astype(np.float32)
    return (image - ambient) / np.maximum(transmission, SMALLEST_TRANSMISSION)[..., None] + ambient
