"""Lines in the log spectrum: the motion is across the straightest edge of its stripes, their pitch is 1 / length.

Canny edges of the flattened, smoothed log spectrum; the normal of the line with most votes is the direction, the
deepest point of the one-dimensional cepstrum of the projection along that line the length. A blur of 2 px or less has
no stripe inside of the spectrum and is missed.

Source: Lokhande, Arya and Gupta, "Identification of parameters and restoration of motion blurred images", ACM Symposium
on Applied Computing 2006 (direction by the Hough transform of the spectrum); length as in `radon`. Thresholds are free
there: here shares of the gradients, which do not depend on contrast.
"""

import numpy as np

from uwsim.motion_blur import cepstrum as of
from uwsim.motion_blur.estimate import Estimate, estimate_from_vector, grey_from_image, longest_length_px
from uwsim.motion_blur.log_spectrum import DEEPEST, HIGHEST, flat_log_spectrum, length_from_profile, profiles

INPUT = "linear_float32"
NEEDS = ()

SIDE = 256
SMOOTHING_PX = 40
ANGLE_STEP_DEG = 0.5
# quantiles of the gradient between which Canny takes edges that hang on stronger ones
WEAK_QUANTILE, STRONG_QUANTILE = 0.7, 0.95
FEWEST_VOTES = 20
# the disc's own rim is no stripe
RIM = 4


def estimate(image: np.ndarray) -> Estimate:
    """Return the blur of a linear image (H, W, 3); a number always, also where there is no blur.

    Searches lengths from 1.5 px to 40 px (less than half a side of small images). Where no line has 20 votes, the
    direction is that of the deepest point of the cepstrum. ValueError for images that are constant, not finite or
    under 16 px.
    """
    grey = grey_from_image(image, where="hough")
    flat = flat_log_spectrum(grey, longest_px=SMOOTHING_PX, side=SIDE)
    angle_deg = _normal_of_strongest_line(flat)
    if angle_deg is None:
        angle_deg = _of_deepest_point(grey)
    found, weight = profiles(flat, np.array([angle_deg]))
    longest_px = longest_length_px(grey.shape)
    return Estimate(length_from_profile(found[:, 0], weight, longest_px=longest_px), angle_deg)


def _normal_of_strongest_line(flat: np.ndarray) -> float | None:
    """Return the direction [deg] across the line with most votes, None if there is none."""
    import cv2

    levels = np.clip(255 * (flat - DEEPEST) / (HIGHEST - DEEPEST), 0, 255).astype(np.uint8)
    right, down = cv2.Sobel(levels, cv2.CV_16S, 1, 0), cv2.Sobel(levels, cv2.CV_16S, 0, 1)
    inside = of.distance_px(flat.shape[0] // 2) < flat.shape[0] // 2 - RIM
    weak, strong = np.quantile(np.hypot(right[inside], down[inside]), (WEAK_QUANTILE, STRONG_QUANTILE))
    edges = cv2.Canny(right, down, weak, strong, L2gradient=True) * inside.astype(np.uint8)
    lines = cv2.HoughLines(edges, 1, np.radians(ANGLE_STEP_DEG), FEWEST_VOTES)
    if lines is None:
        return None
    # (rho, theta): theta turns clockwise on the screen; lines come by votes
    return float(-np.degrees(lines.reshape(-1, lines.shape[-1])[0, 1])) % 180


def _of_deepest_point(grey: np.ndarray) -> float:
    reach = of.reach_px(grey.shape)
    values = of.centre(of.cepstrum(grey), reach)
    row, column = of.deepest(values, of.searched(grey.shape) & of.upper_half(reach))
    return estimate_from_vector(column - reach, reach - row).angle_deg
