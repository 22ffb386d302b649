"""Fusion of two versions of the white-balanced picture, a darker one and a sharpened one, at every scale.

Red (and blue, where it is weaker than green) is first raised by what green has more of, then the means are made equal.

Source: Ancuti, Ancuti, De Vleeschouwer, Bekaert, "Color balance and fusion for underwater image enhancement", IEEE
Trans. Image Processing 27(1), 2018: compensation (alpha 1), sharpening, weights (delta 0.1); saliency: Achanta et al.,
CVPR 2009. Gamma and the width of the sharpening's Gaussian are chosen here.
"""

import numpy as np

from uwsim.restoration import colour_constancy, pyramid
from uwsim.restoration.levels import luma, to_uint8, unit

INPUT = "srgb_uint8"
NEEDS = ()

ALPHA = 1.0
GAMMA = 1.2
SHARPENING_SIGMA_PX = 3.0
DELTA = 0.1


def restore(image: np.ndarray) -> np.ndarray:
    """Return the (H, W, 3) uint8 sRGB image, balanced and fused."""
    balanced = np.clip(colour_constancy.gray_world(compensated(unit(image))), 0, 1)
    inputs = [balanced ** np.float32(GAMMA), sharpened(balanced)]
    weights = [_weight(version) + np.float32(DELTA) for version in inputs]
    total = sum(weights)
    return to_uint8(pyramid.fused(inputs, [weight / total for weight in weights]))


def compensated(image: np.ndarray) -> np.ndarray:
    """Return I_c + alpha (mean G - mean I_c) (1 - I_c) G for red and blue where their mean is below that of green."""
    means = image.mean(axis=(0, 1))
    lack = np.float32(ALPHA) * np.maximum(means[1] - means, 0)
    return image + lack * (1 - image) * image[..., 1:2]


def sharpened(image: np.ndarray) -> np.ndarray:
    """Return (I + N{I - G * I}) / 2, N the linear map of all channels together to [0, 1]; the first half if flat."""
    import cv2

    detail = image - cv2.GaussianBlur(image, (0, 0), SHARPENING_SIGMA_PX)
    low, high = detail.min(), detail.max()
    return (image + (detail - low) / (high - low)) / 2 if high > low else image / 2


def _weight(image: np.ndarray) -> np.ndarray:
    """Return the sum (H, W) of local contrast, saliency and saturation."""
    import cv2

    bright = luma(image)
    contrast = np.abs(cv2.Laplacian(bright, cv2.CV_32F))
    lab = cv2.cvtColor(image, cv2.COLOR_RGB2Lab)
    saliency = np.linalg.norm(cv2.GaussianBlur(lab, (5, 5), 0) - lab.mean(axis=(0, 1)), axis=2) / np.float32(100)
    saturation = np.sqrt(np.mean((image - bright[..., None]) ** 2, axis=2))
    return contrast + saliency + saturation
