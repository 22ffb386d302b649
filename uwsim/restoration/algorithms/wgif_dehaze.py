"""Dark channel prior with its transmission refined by the weighted guided filter.

Source: Li, Zheng, Zhu, Yao, Wu, "Weighted guided image filtering", IEEE Trans. Image Processing 24(1), 2015:
radius 60, lambda 1/1000; the other steps as in `dcp`.
"""

import numpy as np

from uwsim.restoration import dark_channel
from uwsim.restoration.levels import luma, to_uint8, unit
from uwsim.restoration.weighted_guided_filter import weighted_guided

INPUT = "srgb_uint8"
NEEDS = ()

RADIUS_PX = 60
PENALTY = 1 / 1000


def restore(image: np.ndarray) -> np.ndarray:
    """Return the (H, W, 3) uint8 sRGB image without haze."""
    colours = unit(image)
    ambient = dark_channel.haze_light(colours, dark_channel.dark_channel(colours))
    transmission = weighted_guided(
        luma(colours), dark_channel.haze_transmission(colours, ambient), radius_px=RADIUS_PX, penalty=PENALTY,
        subsample=dark_channel.SUBSAMPLE,
    )  # fmt: skip
    return to_uint8(dark_channel.without_haze(colours, ambient, transmission))
