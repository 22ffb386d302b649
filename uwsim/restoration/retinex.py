"""Multi-scale Retinex: how much brighter a pixel is than its surroundings, in logarithms, over several scales.

Source: Rahman, Jobson, Woodell, "Multi-scale retinex for color image enhancement", ICIP 1996; Jobson, Rahman, Woodell,
IEEE Trans. Image Processing 6(7), 1997.
"""

import numpy as np

# blur of the picture that is to be blurred on a coarser grid, in pixels of that grid: enough to interpolate from
_LEAST_SIGMA_PX = 8.0


def log_ratio(levels: np.ndarray, *, sigmas_px: tuple[float, ...]) -> np.ndarray:
    """Return the mean over the scales of log I - log(G_sigma * I), (H, W, 3) float32; levels > 0 (H, W, 3) float32."""
    surround = np.zeros_like(levels)
    for sigma in sigmas_px:
        surround += np.log(smoothed(levels, sigma_px=sigma))
    return np.log(levels) - surround / np.float32(len(sigmas_px))


def smoothed(image: np.ndarray, *, sigma_px: float) -> np.ndarray:
    """Return an image (H, W, C) float32 blurred by a Gaussian, mirrored at its border.

    Wide Gaussians are applied to a picture shrunk by areas and enlarged bilinearly; what these two add to the width
    is taken off. Error: below 0.1 % of the levels for widths of a sixth of the picture and less.
    """
    import cv2

    height, width = image.shape[:2]
    factor = max(1, int(sigma_px / _LEAST_SIGMA_PX))
    if factor == 1:
        return cv2.GaussianBlur(image, (0, 0), sigma_px, borderType=cv2.BORDER_REFLECT)
    size = (max(1, round(width / factor)), max(1, round(height / factor)))
    small = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
    x, y = width / size[0], height / size[1]
    # variance of a box of f pixels, (f^2 - 1) / 12, and of linear interpolation, (f^2 - 1) / 6
    sigmas = [np.sqrt(max(sigma_px**2 - (f * f - 1) / 4, 0.25 * f * f)) / f for f in (x, y)]
    small = cv2.GaussianBlur(small, (0, 0), sigmas[0], sigmaY=sigmas[1], borderType=cv2.BORDER_REFLECT)
    return cv2.resize(small, (width, height), interpolation=cv2.INTER_LINEAR)
