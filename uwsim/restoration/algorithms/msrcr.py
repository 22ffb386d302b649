"""Multi-scale Retinex with colour restoration; each channel is at last stretched between two percentiles.

R = C (mean over scales of log I - log(G * I)), C = beta (log(alpha I) - log(sum of the channels)).
The paper ends with G (R - b) and fixed constants of one display (192, -30); the stretch between percentiles is what
most published code does instead, and it sets the contrast of the result.

Source: Jobson, Rahman, Woodell, "A multiscale retinex for bridging the gap between color images and the human
observation of scenes", IEEE Trans. Image Processing 6(7), 1997: scales 15, 80, 250, alpha 125, beta 46.
"""

import numpy as np

from uwsim.restoration import retinex
from uwsim.restoration.levels import stretched, to_uint8, unit

INPUT = "srgb_uint8"
NEEDS = ()

SIGMAS_PX = (15.0, 80.0, 250.0)
ALPHA = 125.0
BETA = 46.0
LOW_PERCENT, HIGH_PERCENT = 1.0, 99.0


def restore(image: np.ndarray) -> np.ndarray:
    """Return the (H, W, 3) uint8 sRGB image after Retinex; level 0 counts as 1, for the logarithm.

    A channel of one value becomes 0.
    """
    found = colour_restored(np.maximum(255 * unit(image), 1))
    return to_uint8(np.dstack([stretched(found[..., k], LOW_PERCENT, HIGH_PERCENT) for k in range(3)]))


def colour_restored(levels: np.ndarray) -> np.ndarray:
    """Return R (H, W, 3) float32 of levels (H, W, 3) float32 from 1 to 255."""
    colour = BETA * (np.log(ALPHA * levels) - np.log(levels.sum(axis=2, keepdims=True)))
    return colour * retinex.log_ratio(levels, sigmas_px=SIGMAS_PX)
