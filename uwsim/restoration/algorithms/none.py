"""The image as it came: the do-nothing entry, the score that a method has to beat.

Source: none.
"""

import numpy as np

INPUT = "srgb_uint8"
NEEDS = ()


def restore(image: np.ndarray) -> np.ndarray:
    """Return a copy of the (H, W, 3) uint8 image."""
    return image.copy()
