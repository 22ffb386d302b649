"""Shades of gray: channels scaled so that their means of sixth power agree. Gains on sRGB values.

Source: Finlayson, Trezzi, "Shades of gray and colour constancy", 12th Color Imaging Conference, 2004 (p = 6).
"""

import numpy as np

from uwsim.restoration import colour_constancy
from uwsim.restoration.levels import to_uint8, unit

INPUT = "srgb_uint8"
NEEDS = ()


def restore(image: np.ndarray) -> np.ndarray:
    """Return the (H, W, 3) uint8 sRGB image under neutral light, gains up to 10; an empty channel stays empty."""
    return to_uint8(colour_constancy.shades_of_gray(unit(image)))
