"""The colour of the light from the statistics of a picture, and the picture under neutral light.

Source: Finlayson, Trezzi, "Shades of gray and colour constancy", 12th Color Imaging Conference, 2004, eq. 8 and its
result p = 6; the mean itself (p = 1): Buchsbaum, J. Franklin Institute 310(1), 1980.
"""

import numpy as np

NORM = 6.0
# more would only lift the noise of a channel that the water has emptied
LARGEST_GAIN = 10.0


def light(image: np.ndarray, *, norm: float = NORM) -> np.ndarray:
    """Return the light's colour (3,) float64 of an image (H, W, 3) float >= 0, in its units: (mean I^p)^(1/p).

    `norm` is p >= 1. Raises ValueError for other shapes, types or norms, and for negative values or NaN.
    """
    import cv2

    image = np.asarray(image)
    if image.ndim != 3 or image.shape[2] != 3 or image.dtype not in (np.float32, np.float64):
        raise ValueError(f"colour constancy: image {image.dtype} {image.shape}, allowed: float32 or float64 (H, W, 3)")
    if image.size == 0:
        raise ValueError(f"colour constancy: image {image.shape}, allowed: with pixels")
    if not 1 <= norm < np.inf:
        raise ValueError(f"colour constancy: norm = {norm}, allowed: 1 to less than infinity")
    found = np.zeros(3)
    for channel in range(3):
        plane = cv2.extractChannel(image, channel)
        least, largest = float(plane.min()), float(plane.max())
        if not (least >= 0 and np.isfinite(plane).all()):
            raise ValueError("colour constancy: image has negative values, NaN or infinity, allowed: finite, >= 0")
        if largest > 0:
            # of the largest value, so that high powers neither overflow nor vanish; cv2 multiplies for whole powers
            powers = cv2.pow(plane * plane.dtype.type(1 / largest), norm)
            found[channel] = largest * np.mean(powers, dtype=np.float64) ** (1 / norm)
    return found


def shades_of_gray(image: np.ndarray, *, norm: float = NORM) -> np.ndarray:
    """Return the image (H, W, 3), same float type, with the light of norm p made neutral; not clipped.

    Each channel is multiplied by mean(light) / its light, at most by `LARGEST_GAIN`; an empty channel stays empty.
    ValueError as `light`.
    """
    return image * gains(light(image, norm=norm)).astype(np.asarray(image).dtype)


def gray_world(image: np.ndarray) -> np.ndarray:
    """Return the image (H, W, 3), same float type, with equal channel means (up to `LARGEST_GAIN`); not clipped."""
    return shades_of_gray(image, norm=1.0)


def gains(colour: np.ndarray, *, least: float = 0.0, largest: float = LARGEST_GAIN) -> np.ndarray:
    """Return mean(colour) / colour (3,), limited to [least, largest], which makes that colour neutral."""
    colour = np.asarray(colour, dtype=np.float64)
    ratio = np.divide(colour.mean(), colour, out=np.full(colour.shape, largest), where=colour > 0)
    return np.clip(ratio, least, largest)
