"""No motion: the do-nothing entry, the score that an estimator has to beat.

Source: none; the sharp image is the limit of length 0.
"""

import numpy as np

from uwsim.motion_blur.estimate import Estimate, grey_from_image

INPUT = "linear_float32"
NEEDS = ()


def estimate(image: np.ndarray) -> Estimate:
    """Return length 0 and angle 0; ValueError for images that the other estimators refuse as well."""
    grey_from_image(image, where="none")
    return Estimate(0.0, 0.0)
