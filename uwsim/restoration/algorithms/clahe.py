"""CLAHE on the lightness: contrast-limited histogram equalisation in tiles. Colours a and b are kept.

Source: Zuiderveld, Graphics Gems IV, 1994, pages 474-485; with the common clip limit 2 and 8 x 8 tiles.
"""

import numpy as np

from uwsim.restoration.levels import lightness_equalised

INPUT = "srgb_uint8"
NEEDS = ()

CLIP_LIMIT = 2.0


def restore(image: np.ndarray) -> np.ndarray:
    """Return the (H, W, 3) uint8 sRGB image with L of CIELab equalised."""
    return lightness_equalised(image, clip_limit=CLIP_LIMIT)
