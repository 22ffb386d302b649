"""The dissertation's dual-transmission restoration, corrected: two transmission maps, ambient light, colour, CLAHE.

Source: the dissertation, chapter 3, eqs 3.1-3.14, in the corrected form of `uwsim.restoration.dual_transmission`.
"""

import numpy as np

from uwsim.restoration import dual_transmission

INPUT = "srgb_uint8"
NEEDS = ()


def restore(image: np.ndarray, **steps: bool | float) -> np.ndarray:
    """Return the restored (H, W, 3) uint8 sRGB image; `steps` switch single ones off (`dual_transmission.Steps`)."""
    return dual_transmission.restored(image, dual_transmission.Steps(**steps))
