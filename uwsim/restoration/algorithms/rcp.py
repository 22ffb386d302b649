"""Red channel prior: the dark channel of inverted red, green and blue, for red falls with the distance.

Where a lamp shines, surfaces are grey rather than blue: their least saturation says that haze is little there.

Source: Galdran, Pardo, Picon, Alvarez-Gila, "Automatic red-channel underwater image restoration", J. Visual
Communication and Image Representation 26, 2015; their saturation term for artificial light is off unless
asked for. Transmission refined by the guided filter instead of matting.
"""

import numpy as np

from uwsim.restoration import ambient_light, dark_channel
from uwsim.restoration.levels import to_uint8, unit

INPUT = "srgb_uint8"
NEEDS = ()

AMBIENT_SHARE = 0.1
# of A and 1 - A: a light that is saturated or empty says nothing of its share
_LEAST = 1 / 255


def restore(image: np.ndarray, *, saturation_weight: float | None = None) -> np.ndarray:
    """Return the (H, W, 3) uint8 sRGB image with (I - A) / max(t, 0.1) + (1 - A) A.

    `saturation_weight` (0 to 1; None: no such term) is lambda of the least saturation in the minimum for t.
    Raises ValueError for a weight out of range.
    """
    if saturation_weight is not None and not 0 <= saturation_weight <= 1:
        raise ValueError(f"rcp: saturation_weight = {saturation_weight}, allowed: 0 to 1 or None")
    colours = unit(image)
    ambient = _ambient(colours)
    transmission = red_transmission(colours, ambient, saturation_weight=saturation_weight)
    transmission = dark_channel.refined(transmission, colours)
    clear = dark_channel.without_haze(colours, ambient, transmission)
    return to_uint8(clear - ambient + (1 - ambient) * ambient)


def red_transmission(image: np.ndarray, ambient: np.ndarray, *, saturation_weight: float | None = None) -> np.ndarray:
    """Return 1 - min of the local minima of (1 - R) / (1 - A_R), G / A_G, B / A_B, (H, W) float32."""
    share = np.minimum(
        (1 - image[..., 0]) / (1 - ambient[0]), np.minimum(image[..., 1] / ambient[1], image[..., 2] / ambient[2])
    )
    if saturation_weight is not None:
        most = image.max(axis=2)
        saturation = (most - image.min(axis=2)) / np.maximum(most, _LEAST)
        share = np.minimum(share, np.float32(saturation_weight) * saturation)
    return 1 - dark_channel.local_minimum(share)


def _ambient(image: np.ndarray) -> np.ndarray:
    """Return A (3,): the pixel with the least red among the tenth of the picture with the largest red channel prior."""
    inverted = np.dstack([1 - image[..., 0], image[..., 1:]])
    pixels = image[ambient_light.brightest(dark_channel.dark_channel(inverted), image, share=AMBIENT_SHARE)]
    return np.clip(pixels[np.argmin(pixels[:, 0])], _LEAST, 1 - _LEAST)
