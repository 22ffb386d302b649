"""The logarithm of the spectrum as a picture of stripes, and its projections.

A blur of length L draws dark stripes across the direction of the motion, 1 / L cycles per pixel apart.

Source: Moghaddam and Jamzad, EURASIP J. Advances in Signal Processing 2007, 68985 (projections of the spectrum).
"""

import numpy as np

from uwsim.motion_blur.cepstrum import SHORTEST_PX, centre, cepstrum

# a periodic texture is a few strong points, the zeros of any spectrum are deep ones: neither may draw a line alone
DEEPEST, HIGHEST = -4.0, 2.0
LENGTH_STEP_PX = 0.05


def flat_log_spectrum(grey: np.ndarray, *, longest_px: int, side: int) -> np.ndarray:
    """Return ln of the power spectrum minus its mean over rings, (side + 1, side + 1); frequency 0 in the middle.

    Smoothed by a taper of the cepstrum that ends at `longest_px`, so that the cost does not depend on the picture's
    size and bins are equal on both axes of any picture. Pixels are 1 / side cycles per pixel apart. `side` even,
    above 2 `longest_px`. Zero outside of the disc up to half a cycle per pixel, mean 0 in it.
    """
    reach = min(longest_px, min(grey.shape) // 2 - 1)
    taper = np.cos(np.pi * np.arange(-reach, reach + 1) / (2 * (reach + 1))) ** 2
    padded = np.zeros((side, side))
    places = np.arange(-reach, reach + 1) % side
    padded[np.ix_(places, places)] = centre(cepstrum(grey), reach) * taper[:, None] * taper[None, :]
    logarithm = centre(np.fft.fft2(padded).real, side // 2)

    offsets = np.arange(-(side // 2), side // 2 + 1)
    radius = np.hypot(offsets[:, None], offsets[None, :])
    ring = np.rint(radius).astype(int).ravel()
    mean = np.bincount(ring, logarithm.ravel()) / np.maximum(np.bincount(ring), 1)
    flat = np.clip(logarithm - mean[ring].reshape(radius.shape), DEEPEST, HIGHEST)
    disc = radius <= side // 2
    return np.where(disc, flat - flat[disc].mean(), 0)


def profiles(flat: np.ndarray, angles_deg: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the means along the lines across each direction, (n, angles), and the weight (n,) of each line; sum 1.

    `flat` (n, n), zero outside of the disc. Angles: x right, y up. The weight is the length of the line in the disc,
    to which the variance of its mean is inverse.
    """
    from skimage.transform import radon

    radius = flat.shape[0] // 2
    offset = np.arange(-radius, radius + 1)
    chord = 2 * np.sqrt(radius**2 - offset**2) + 1
    return radon(flat, theta=angles_deg, circle=True) / chord[:, None], chord / chord.sum()


def length_from_profile(profile: np.ndarray, weight: np.ndarray, *, longest_px: float) -> float:
    """Return the length [px] at which the cepstrum of a profile (n,) along the motion is deepest.

    The profile covers one cycle per pixel; a parabola is taken out first, for the texture falls to both sides.
    """
    frequency = np.linspace(-0.5, 0.5, len(profile))
    root = np.sqrt(weight)
    trend = np.stack([np.ones_like(frequency), frequency**2], axis=1)
    coefficients = np.linalg.lstsq(trend * root[:, None], profile * root, rcond=None)[0]
    weighted = weight * (profile - trend @ coefficients)
    lengths = np.arange(SHORTEST_PX, longest_px + 1e-9, LENGTH_STEP_PX)
    return float(lengths[np.argmin(np.cos(2 * np.pi * lengths[:, None] * frequency) @ weighted)])
