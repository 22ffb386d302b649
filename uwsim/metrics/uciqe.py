"""UCIQE: a no-reference score of underwater colour. It ranks white noise above every photograph: no goal."""

import numpy as np

from uwsim.metrics.image import check_image

# Yang and Sowmya 2015: chroma, luminance contrast, saturation
WEIGHTS = (0.4680, 0.2745, 0.2576)


def uciqe_o(image: np.ndarray) -> float:
    """Return UCIQE, variant O (the authors' form), of an (H, W, 3) uint8 sRGB image.

    What the variant fixes: 8-bit CIELab (D65) divided by 255 **with the offset of 128 left in a and b**, so
    that neutral grey has chroma 0.71 and a flat grey image scores 0.2; spread of chroma c as sqrt(mean |1 -
    (mean c / c)^2|); saturation c / sqrt(c^2 + L^2); contrast between the 1 % and the 99 % level of the
    256-bin histogram of L. Values of other variants are not comparable. Other inputs raise ValueError.

    Source: Yang and Sowmya, IEEE Trans. Image Processing 24(12), 2015, 6062-6071 (form and weights).
    """
    import cv2

    check_image(image, where="uciqe_o")
    lab = cv2.cvtColor(np.ascontiguousarray(image), cv2.COLOR_RGB2Lab)
    lightness, a, b = (lab[..., channel] / 255.0 for channel in range(3))
    chroma = np.hypot(a, b)
    saturation = chroma / np.hypot(chroma, lightness)
    spread = np.sqrt(np.mean(np.abs(1 - (chroma.mean() / chroma) ** 2)))
    return float(np.dot(WEIGHTS, (spread, _contrast(lab[..., 0]), saturation.mean())))


def _contrast(lightness: np.ndarray) -> float:
    """Return the distance of the 1 % and the 99 % level of uint8 values, in units of 255."""
    share = np.cumsum(np.bincount(lightness.ravel(), minlength=256)) / lightness.size
    return float(np.argmax(share >= 0.99) - np.argmax(share > 0.01)) / 255
