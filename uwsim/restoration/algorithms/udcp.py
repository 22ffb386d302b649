"""Underwater dark channel prior: the dark channel of green and blue alone, for water empties the red one.

Source: Drews, Nascimento, Moraes, Botelho, Campos, "Transmission estimation in underwater single images", ICCV
Workshops 2013; the other steps as in `dcp`.
"""

import numpy as np

from uwsim.restoration import dark_channel
from uwsim.restoration.levels import to_uint8, unit

INPUT = "srgb_uint8"
NEEDS = ()


def restore(image: np.ndarray) -> np.ndarray:
    """Return the (H, W, 3) uint8 sRGB image without haze."""
    colours = unit(image)
    ambient = dark_channel.haze_light(colours, dark_channel.dark_channel(colours[..., 1:]))
    transmission = dark_channel.haze_transmission(colours[..., 1:], ambient[1:])
    return to_uint8(dark_channel.without_haze(colours, ambient, dark_channel.refined(transmission, colours)))
