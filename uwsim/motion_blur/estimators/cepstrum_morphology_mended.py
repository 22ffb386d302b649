"""The dissertation's estimator with its avoidable errors taken out: linear light, nothing filtered, sub-pixel.

As `cepstrum_morphology`, but: the whole picture and no crop (quefrencies are pixels on both axes), linear intensities,
no equalisation and no median (both fill the zeros of the spectrum), ln |F|^2 (does not depend on the intensity scale),
six independent peaks and not three mirrored ones, the region with the deepest point as the brightest, and the centroid
of the peak. The ellipse is left as a gate.

Source: the dissertation, chapter 4, eqs 4.1-4.3, corrected as said at `cepstrum_morphology`.
"""

import numpy as np

from uwsim.motion_blur import cepstrum as of
from uwsim.motion_blur.cepstrum_morphology import chosen_peak, ellipse_of_ridge
from uwsim.motion_blur.estimate import Estimate, estimate_from_vector, grey_from_image

INPUT = "linear_float32"
NEEDS = ()


def estimate(image: np.ndarray) -> Estimate:
    """Return the blur of a linear image (H, W, 3); a number always, also where there is no blur.

    Searches lengths from 1.5 px to 40 px (less than half a side of small images). Where no peak passes the test, the
    deepest one is taken. ValueError for images that are constant, not finite or under 16 px.
    """
    grey = grey_from_image(image, where="cepstrum_morphology_mended")
    values = of.centre(of.cepstrum(grey), of.reach_px(grey.shape))
    ellipse = ellipse_of_ridge(values)
    row, column = chosen_peak(values, of.searched(grey.shape), ellipse, both_of_a_pair=False, by="peak")
    down, right = of.sub_pixel(values, row, column)
    return estimate_from_vector(right, -down)
