"""Colour transferred until the channels' means agree, blended in where the water took most, then local contrast.

The channel with the largest mean, stretched, is added to the other two in steps, I <- I + (mean L - mean I) L, until
the means agree. Each step leaves (1 - mean L) of the difference, so that the steps have the limit
I + (mean L - mean I) / mean L x L, which is what is computed here.

Source: Zhang, Zhuang, Sun, Li, Kwong, Li, "Underwater image enhancement via minimal color loss and locally adaptive
contrast enhancement", IEEE Trans. Image Processing 31, 2022: exponent 1.2 of the attenuation map, limit of the gain.
Valid: a reading: the paper leaves open how blocks meet (a window about each pixel here), the width of the blur, and in
what scale the two colour means are balanced (8-bit a and b here, grey 128); its guided filter of the lightness,
whose strength it does not fix, is left out.
"""

import numpy as np

from uwsim.restoration.levels import to_uint8, unit

INPUT = "srgb_uint8"
NEEDS = ()

EXPONENT = 1.2
DETAIL_SIGMA_PX = 1.4
WINDOW_PX = 25
LARGEST_GAIN = 1.5


def restore(image: np.ndarray) -> np.ndarray:
    """Return the (H, W, 3) uint8 sRGB image, recoloured and with more local contrast."""
    return _with_contrast(to_uint8(_blended(unit(image))))


def transferred(image: np.ndarray) -> np.ndarray:
    """Return the image (H, W, 3) float32 with the stretched strongest channel added to the others: equal means."""
    means = image.mean(axis=(0, 1), dtype=np.float64)
    strongest = int(np.argmax(means))
    found = image.copy()
    low, high = image[..., strongest].min(), image[..., strongest].max()
    if high == low:
        return found
    found[..., strongest] = (image[..., strongest] - low) / (high - low)
    goal = found[..., strongest].mean(dtype=np.float64)
    for channel in {0, 1, 2} - {strongest}:
        found[..., channel] += np.float32((goal - means[channel]) / goal) * found[..., strongest]
    return found


def _blended(image: np.ndarray) -> np.ndarray:
    """Return detail + a x transferred + (1 - a) x image, a the largest attenuation 1 - I^1.2 of the channels."""
    import cv2

    attenuated = (1 - image.min(axis=2) ** np.float32(EXPONENT))[..., None]
    detail = image - cv2.GaussianBlur(image, (0, 0), DETAIL_SIGMA_PX)
    return detail + attenuated * transferred(image) + (1 - attenuated) * image


def _with_contrast(image: np.ndarray) -> np.ndarray:
    import cv2

    lab = cv2.cvtColor(image, cv2.COLOR_RGB2Lab).astype(np.float32)
    lab[..., 0] = local_contrast(lab[..., 0])
    mean_a, mean_b = lab[..., 1].mean(), lab[..., 2].mean()
    # the weaker of the two is raised by a share of their difference
    weaker = 2 if mean_a > mean_b else 1
    lab[..., weaker] *= 1 + abs(mean_a - mean_b) / (mean_a + mean_b)
    return cv2.cvtColor(np.rint(np.clip(lab, 0, 255)).astype(np.uint8), cv2.COLOR_Lab2RGB)


def local_contrast(lightness: np.ndarray) -> np.ndarray:
    """Return m + min(V / v, 1.5) (L - m) with mean m and variance v of the window about the pixel, V of the picture."""
    import cv2

    window, border = (WINDOW_PX, WINDOW_PX), cv2.BORDER_REFLECT
    wide = lightness.astype(np.float64)
    mean = cv2.blur(wide, window, borderType=border)
    variance = np.maximum(cv2.blur(wide * wide, window, borderType=border) - mean * mean, 0)
    ratio = np.minimum(wide.var(), LARGEST_GAIN * variance) / np.maximum(variance, 1e-9)
    return (mean + np.where(variance > 1e-9, ratio, 1) * (wide - mean)).astype(np.float32)
