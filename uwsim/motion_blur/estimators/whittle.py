"""Maximum likelihood: the spectrum of a blurred power-law texture with noise, fitted to that of the picture.

The power spectrum is that of the sharp texture (a power law with curvature, roll-off and anisotropy) times sinc^2 of
the frequency along the motion, plus white noise; a static share and a fill of the zeros take up what is not quite one
uniform motion. All are found together, from several starts, by Fisher scoring of Whittle's likelihood.

Source: Whittle, Arkiv foer Matematik 2, 1953; Dahlhaus and Kuensch, Biometrika 74(4), 1987 (tapers).
Valid: linear light, noise that is white; lengths from about 1.5 px, where a lens and a blur begin to differ; pictures
whose blur differs by less than about a tenth over the frame ("not uniform" else: see `uwsim.motion_blur.whittle.tiles`).
"""

import numpy as np

from uwsim.motion_blur.estimate import Estimate, grey_from_image, refuse_saturated
from uwsim.motion_blur.whittle.picture import find

INPUT = "linear_float32"
NEEDS = ()


def estimate(image: np.ndarray, *, lens_std_px: float = 0.0) -> Estimate:
    """Return the blur of a linear image (H, W, 3) with covariance, verdict and the picture's spectrum.

    Searches lengths up to 40 px (less than half a side of small images). `lens_std_px`: standard deviation of the
    lens's spot, where it is known. "no blur": shorter than 1.5 px, or explained as well by a texture that is smoother
    in one direction; length and angle are the best fit all the same, their covariance says how little they are worth.
    ValueError for images that are constant, not finite, under 16 px, or saturated in more than a tenth of their pixels.
    """
    if not (np.isfinite(lens_std_px) and lens_std_px >= 0):
        raise ValueError(f"whittle: got lens_std_px {lens_std_px}, allowed: finite, >= 0")
    grey = grey_from_image(image, where="whittle")
    refuse_saturated(image, where="whittle")
    found = find(grey, lens_std_px=lens_std_px)
    return Estimate(0.0, 0.0, verdict="no blur") if found is None else found.estimate()
