"""Derivatives: they are weakest along the motion, and their correlation along it is deepest at the length.

The direction is that in which the sum of |derivative| is smallest. Each point of the sharp picture leaves a step up at
one end of its smear and a step down at the other, so that the derivative along the motion correlates negatively with
itself at the distance L. Texture with a direction of its own deceives the first step, noise the second.

Source: Yitzhaky and Kopeika, Graphical Models and Image Processing 59(5), 1997. Here the derivative comes from Scharr's
3 x 3 operators instead of differences to bilinear neighbours, which smooth more the further they are from a pixel, and
the lines' correlations, averaged, are read from the two-dimensional one along the motion. The smoothing by 1 px before
it is an addition: without it, noise of 1 % hides nearly every blur of 15 px or more.
"""

import numpy as np

from uwsim.motion_blur.cepstrum import SHORTEST_PX, power_spectrum
from uwsim.motion_blur.estimate import Estimate, grey_from_image, longest_length_px

INPUT = "linear_float32"
NEEDS = ()

COARSE_DEG, FINE_DEG = 5.0, 0.5
SMOOTHING_PX = 1.0
LENGTH_STEP_PX = 0.1


def estimate(image: np.ndarray) -> Estimate:
    """Return the blur of a linear image (H, W, 3); a number always, also where there is no blur.

    Searches lengths from 1.5 px to 40 px (less than half a side of small images). ValueError for images that are
    constant, not finite or under 16 px.
    """
    grey = grey_from_image(image, where="derivative_autocorrelation")
    angle_deg = _direction_deg(grey)
    return Estimate(_length_px(grey, angle_deg), angle_deg)


def _direction_deg(grey: np.ndarray) -> float:
    """Return the direction [deg], y up, in which the mean of |derivative| is smallest."""
    import cv2

    right, down = (cv2.Scharr(grey, cv2.CV_64F, *axis)[1:-1, 1:-1] for axis in ((1, 0), (0, 1)))

    def smallest(angles_deg: np.ndarray) -> float:
        angles = np.radians(angles_deg)
        sums = [np.abs(right * np.cos(angle) - down * np.sin(angle)).sum() for angle in angles]
        return float(angles_deg[int(np.argmin(sums))])

    coarse_deg = smallest(np.arange(0, 180, COARSE_DEG))
    return smallest(coarse_deg + np.arange(-COARSE_DEG + FINE_DEG, COARSE_DEG, FINE_DEG)) % 180


def _length_px(grey: np.ndarray, angle_deg: float) -> float:
    """Return the distance [px] along the direction at which the derivative correlates most negatively with itself.

    The derivative across the motion is taken as well: it whitens the texture, which is smooth over many pixels.
    """
    from scipy.ndimage import map_coordinates

    cos, sin = np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))
    u, v = np.fft.fftfreq(grey.shape[1])[None, :], np.fft.fftfreq(grey.shape[0])[:, None]
    derivatives = np.ones(grey.shape)
    for frequency in (u * cos - v * sin, u * sin + v * cos):
        # power of a difference of neighbours, up to its own end at half a cycle per pixel
        derivatives *= np.sin(np.pi * np.clip(frequency, -0.5, 0.5)) ** 2
    smoothing = np.exp(-((2 * np.pi * SMOOTHING_PX) ** 2) * (u**2 + v**2))
    correlation = np.fft.ifft2(power_spectrum(grey) * derivatives * smoothing).real
    lengths = np.arange(SHORTEST_PX, longest_length_px(grey.shape) + 1e-9, LENGTH_STEP_PX)
    places = np.stack([-lengths * sin, lengths * cos])
    return float(lengths[np.argmin(map_coordinates(correlation, places, order=3, mode="grid-wrap"))])
