"""CLAHE on the lightness: contrast-limited histogram equalisation in tiles. Colours a and b are kept.

Source: Zuiderveld, Graphics Gems IV, 1994, pages 474-485; `cv2.createCLAHE` with the common clip limit 2 and
8 x 8 tiles.
"""

import numpy as np

INPUT = "srgb_uint8"
NEEDS = ()

CLIP_LIMIT = 2.0
TILES = (8, 8)


def restore(image: np.ndarray) -> np.ndarray:
    """Return the (H, W, 3) uint8 sRGB image with L of CIELab (8 bit, D65) equalised."""
    import cv2

    lab = cv2.cvtColor(np.ascontiguousarray(image), cv2.COLOR_RGB2Lab)
    equaliser = cv2.createCLAHE(clipLimit=CLIP_LIMIT, tileGridSize=TILES)
    lab[..., 0] = equaliser.apply(np.ascontiguousarray(lab[..., 0]))
    return cv2.cvtColor(lab, cv2.COLOR_Lab2RGB)
