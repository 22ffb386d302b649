"""Histogram equalisation of each channel by itself.

Source: Gonzalez, Woods, "Digital Image Processing", section 3.3; `cv2.equalizeHist`. (CLAHE, its variant in tiles, is
Zuiderveld 1994.)
"""

import numpy as np

INPUT = "srgb_uint8"
NEEDS = ()


def restore(image: np.ndarray) -> np.ndarray:
    """Return the (H, W, 3) uint8 image with the levels of each channel spread by their cumulative histogram.

    A channel of one level stays as it is.
    """
    import cv2

    return np.dstack([cv2.equalizeHist(np.ascontiguousarray(image[..., channel])) for channel in range(3)])
