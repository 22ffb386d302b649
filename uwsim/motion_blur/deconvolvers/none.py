"""The image as it came: the do-nothing entry, the row that a deconvolution has to beat.

Source: none.
"""

import numpy as np

from uwsim.motion_blur.deconvolution import leaves_unchanged
from uwsim.motion_blur.estimate import Estimate

INPUT = "linear_float32"
NEEDS = ("blur",)


def deblur(image: np.ndarray, *, blur: Estimate) -> np.ndarray:
    """Return a copy of the image; ValueError for what the other deconvolvers refuse as well."""
    leaves_unchanged(image, blur, where="none")
    return np.array(image)
