"""The dissertation's estimator: shape of the cepstrum of an equalised and filtered picture, whole pixels.

Square crop, histogram equalisation, Hann window, 3 x 3 median, ln(1 + |F|), inverse transform; zoom, threshold,
opening, contour, least-squares ellipse; six highest negative peaks, the first of them in the brightest region of the
ellipse's window; length and angle of the line from the peak to its mirror image. Numbers that the source leaves open
stand in `uwsim.motion_blur.cepstrum_morphology`.

Source: the dissertation, chapter 4, section "Small-scale Physics-Model-Based Method", eqs 4.1-4.3 and pseudo-code.
Errata: eq. 4.1, theta = alpha + delta, counts the direction twice, as 4.2 measures delta from the X axis already and
not from the ellipse; 4.2 has no value for a vertical line and does not say that rows go down. Here theta is the
direction of the line itself. The test that the line passes through the centre is always met: a cepstrum is even. The
text describes the logarithm of the spectrum and no second transform, which "negative peaks" need. Equalisation and
median act on the picture after the blur and fill the zeros of its spectrum: `cepstrum_morphology_mended` leaves them
out. A grid of whole pixels cannot hold a blur of 2 px at 15 degrees.
"""

import numpy as np

from uwsim.motion_blur import cepstrum as of
from uwsim.motion_blur.cepstrum_morphology import chosen_peak, ellipse_of_ridge
from uwsim.motion_blur.estimate import Estimate, estimate_from_vector, grey_from_image

INPUT = "srgb_uint8"
NEEDS = ()

MEDIAN_SIDE_PX = 3


def estimate(image: np.ndarray, *, as_printed: bool = False) -> Estimate:
    """Return the blur of an 8-bit image (H, W, 3) or (H, W); a number always, also where there is no blur.

    `as_printed`: the angle by eqs 4.1 and 4.2 as they stand, alpha + delta. Where no peak passes the test, the deepest
    one is taken. ValueError for images that are not uint8, constant or under 16 px.
    """
    image = np.asarray(image)
    if image.dtype != np.uint8:
        raise ValueError(f"cepstrum_morphology: got {image.dtype}, allowed: uint8 (histogram equalisation)")
    grey = np.rint(_square(grey_from_image(image, where="cepstrum_morphology"))).astype(np.uint8)
    reach = of.reach_px(grey.shape)
    values = of.centre(np.fft.ifft2(np.log1p(_amplitude(grey))).real, reach)
    ellipse = ellipse_of_ridge(values)
    row, column = chosen_peak(values, of.searched(grey.shape), ellipse, both_of_a_pair=True, by="sum")
    found = estimate_from_vector(column - reach, reach - row)
    if as_printed and ellipse is not None:
        return found._replace(angle_deg=(ellipse.angle_deg + found.angle_deg) % 180)
    return found


def _square(grey: np.ndarray) -> np.ndarray:
    """Return the square in the middle whose side is the shorter one."""
    side = min(grey.shape)
    top, left = ((length - side) // 2 for length in grey.shape)
    return grey[top : top + side, left : left + side]


def _amplitude(grey: np.ndarray) -> np.ndarray:
    """Return |F| of the equalised, windowed and filtered picture, in the order of the source; frequency 0 first."""
    import cv2

    windowed = of.hann(grey.shape) * cv2.equalizeHist(grey)
    return np.abs(np.fft.fft2(cv2.medianBlur(windowed.astype(np.float32), MEDIAN_SIDE_PX)))
