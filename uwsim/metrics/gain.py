"""One gain between a picture and the truth: the exposure, which a picture alone does not tell."""

import numpy as np

from uwsim.images import linear_from_srgb_uint8, srgb_uint8_from_linear
from uwsim.metrics.image import check_pair

_LINEAR = linear_from_srgb_uint8(np.arange(256, dtype=np.uint8)).astype(float)


def global_gain(reference: np.ndarray, image: np.ndarray) -> float:
    """Return the one factor for all bands that brings an image nearest to a reference in linear light.

    Both (H, W, 3) uint8 sRGB of one shape, else ValueError. Least squares over all pixels and bands: sum(x y) over
    sum(x^2) of the image x and the reference y. 1 for a black image, which every gain leaves black.

    Valid: exposure only; a wrong colour or veil stays wrong. Bright pixels decide.
    """
    check_pair(reference, image, where="global_gain")
    x, y = (_LINEAR[one].ravel() for one in (image, reference))
    power = x @ x
    return float(x @ y / power) if power > 0 else 1.0


def with_gain(reference: np.ndarray, image: np.ndarray) -> np.ndarray:
    """Return the image (H, W, 3) uint8 sRGB times its `global_gain`, clipped and rounded to 8 bits."""
    return srgb_uint8_from_linear(global_gain(reference, image) * _LINEAR)[image]
