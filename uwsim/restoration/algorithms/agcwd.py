"""Adaptive gamma correction with weighting distribution: each brightness gets its own gamma, 1 - cdf.

Hue and saturation (HSV) stay. Only brightens.

Source: Huang, Cheng, Chiu, "Efficient contrast enhancement using adaptive gamma correction with weighting
distribution", IEEE Trans. Image Processing 22(3), 2013, alpha 0.5.
"""

import numpy as np

INPUT = "srgb_uint8"
NEEDS = ()

ALPHA = 0.5


def restore(image: np.ndarray) -> np.ndarray:
    """Return the (H, W, 3) uint8 sRGB image with V of HSV brightened by a table of its 256 levels."""
    value = image.max(axis=2)
    table = brightened(np.bincount(value.ravel(), minlength=256))
    gain = (table / np.maximum(np.arange(256), 1)).astype(np.float32)
    return np.rint(np.minimum(image * gain[value][..., None], 255)).astype(np.uint8)


def brightened(counts: np.ndarray) -> np.ndarray:
    """Return the new levels (256,) float64 of the levels 0 ... 255 of a picture with a histogram (256,)."""
    share = counts / counts.sum()
    low, high = share.min(), share.max()
    # all levels alike often: nothing to weight
    weighted = high * ((share - low) / (high - low)) ** ALPHA if high > low else share
    cumulative = np.cumsum(weighted) / weighted.sum()
    return 255 * (np.arange(256) / 255) ** (1 - np.minimum(cumulative, 1))
