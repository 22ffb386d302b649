"""Projections of the log spectrum: the one along its stripes varies most, and their pitch is 1 / length.

The direction is that of the projection with the greatest variance, the length the deepest point of the one-dimensional
cepstrum of that projection. The spectrum is flattened, clipped and reduced to 128 x 128 first. A blur of 2 px or less
has no stripe inside of the spectrum and is missed.

Source: Moghaddam and Jamzad, EURASIP J. Advances in Signal Processing 2007, 68985 (direction by the Radon transform);
Krahmer et al., "Blind image deconvolution: motion blur estimation", IMA, 2006 (length by the cepstrum of
the projection).
"""

import numpy as np

from uwsim.motion_blur.estimate import Estimate, grey_from_image, longest_length_px
from uwsim.motion_blur.log_spectrum import flat_log_spectrum, length_from_profile, profiles

INPUT = "linear_float32"
NEEDS = ()

SIDE = 128
SMOOTHING_PX = 63
COARSE_DEG, FINE_DEG = 2.0, 0.25


def estimate(image: np.ndarray) -> Estimate:
    """Return the blur of a linear image (H, W, 3); a number always, also where there is no blur.

    Searches lengths from 1.5 px to 40 px (less than half a side of small images). ValueError for images that are
    constant, not finite or under 16 px.
    """
    grey = grey_from_image(image, where="radon")
    flat = flat_log_spectrum(grey, longest_px=SMOOTHING_PX, side=SIDE)
    coarse_deg, _ = _most_varied(flat, np.arange(0, 180, COARSE_DEG))
    around_deg = np.arange(-COARSE_DEG + FINE_DEG, COARSE_DEG, FINE_DEG)
    angle_deg, length_px = _most_varied(flat, coarse_deg + around_deg, longest_px=longest_length_px(grey.shape))
    return Estimate(length_px, angle_deg % 180)


def _most_varied(flat: np.ndarray, angles_deg: np.ndarray, longest_px: float | None = None) -> tuple[float, float]:
    """Return the direction [deg] whose profile has the greatest variance, and the length [px] from it where asked."""
    found, weight = profiles(flat, angles_deg)
    variance = weight @ (found - weight @ found) ** 2
    best = int(np.argmax(variance))
    length_px = length_from_profile(found[:, best], weight, longest_px=longest_px) if longest_px is not None else 0.0
    return float(angles_deg[best]), length_px
