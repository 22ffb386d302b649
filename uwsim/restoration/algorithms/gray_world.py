"""Gray world: channels scaled so that their means agree. Gains on sRGB values, as the literature has them.

Source: Buchsbaum, "A spatial processor model for object colour perception", J. Franklin Institute 310(1), 1980.
"""

import numpy as np

from uwsim.restoration import colour_constancy
from uwsim.restoration.levels import to_uint8, unit

INPUT = "srgb_uint8"
NEEDS = ()


def restore(image: np.ndarray) -> np.ndarray:
    """Return the (H, W, 3) uint8 sRGB image with equal channel means, gains up to 10; an empty channel stays empty."""
    return to_uint8(colour_constancy.gray_world(unit(image)))
