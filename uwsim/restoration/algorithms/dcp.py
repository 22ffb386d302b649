"""Dark channel prior: what is dark in no channel is haze.

Source: He, Sun, Tang, "Single image haze removal using dark channel prior", IEEE Trans. PAMI 33(12), 2011; refined by
the guided filter of the same authors (IEEE Trans. PAMI 35(6), 2013) instead of matting. On sRGB values, as there.
"""

import numpy as np

from uwsim.restoration import dark_channel
from uwsim.restoration.levels import to_uint8, unit

INPUT = "srgb_uint8"
NEEDS = ()


def restore(image: np.ndarray) -> np.ndarray:
    """Return the (H, W, 3) uint8 sRGB image without haze."""
    colours = unit(image)
    ambient = dark_channel.haze_light(colours, dark_channel.dark_channel(colours))
    transmission = dark_channel.refined(dark_channel.haze_transmission(colours, ambient), colours)
    return to_uint8(dark_channel.without_haze(colours, ambient, transmission))
