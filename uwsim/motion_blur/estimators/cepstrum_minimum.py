"""The deepest point of the cepstrum: the zeros of the blur's spectrum repeat with the pitch 1 / length.

log |sinc(L s)|^2 has a cepstrum that lives on the line of the motion and has negative peaks at L, 2 L, ...;
the peak at L is the deepest. Small blurs (under about 3 px) and noise hide it: a number is still returned,
and is then wrong.

Source: Rom, IEEE Trans. Information Theory 21(2), 1975 (cepstrum of motion blur); Gennery, J. Optical Society
of America 63, 1973.
"""

import numpy as np

from uwsim.motion_blur import cepstrum as of
from uwsim.motion_blur.estimate import Estimate, estimate_from_vector, grey_from_image

INPUT = "linear_float32"
NEEDS = ()


def estimate(image: np.ndarray) -> Estimate:
    """Return the blur of a linear image (H, W, 3); a number always, also where there is no blur.

    Searches lengths from 1.5 px to 40 px (less than half a side of small images). ValueError for images that
    are constant, not finite or under 16 px.
    """
    grey = grey_from_image(image, where="cepstrum_minimum")
    reach = of.reach_px(grey.shape)
    values = of.centre(of.cepstrum(grey), reach)
    row, column = of.deepest(values, of.searched(grey.shape) & of.upper_half(reach))
    down, right = of.sub_pixel(values, row, column)
    return estimate_from_vector(right, -down)
