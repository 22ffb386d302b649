"""8-bit pictures as numbers from 0 to 1 and back, in their own encoding; brightness, stretching, equalising."""

import numpy as np

LUMA = np.array([0.299, 0.587, 0.114], np.float32)
"""Weights of R, G, B in the brightness of an encoded picture (ITU-R BT.601)."""


def check_picture(image: np.ndarray) -> None:
    """Raise ValueError unless the image is (H, W, 3) uint8 with pixels."""
    if image.dtype != np.uint8 or image.ndim != 3 or image.shape[2] != 3 or image.size == 0:
        raise ValueError(f"restoration: image {image.dtype} {image.shape}, allowed: uint8 (H, W, 3), not empty")


def unit(image: np.ndarray) -> np.ndarray:
    """Return an 8-bit picture (H, W, 3) as float32 in [0, 1], still sRGB; ValueError as `check_picture`."""
    check_picture(image)
    return image.astype(np.float32) * np.float32(1 / 255)


def to_uint8(values: np.ndarray) -> np.ndarray:
    """Return values clipped to [0, 1] as 8-bit levels, rounded."""
    return np.rint(np.clip(values, 0, 1) * np.float32(255)).astype(np.uint8)


def luma(image: np.ndarray) -> np.ndarray:
    """Return the brightness (H, W) float32 of an encoded picture (H, W, 3) float."""
    return image @ LUMA


def stretched(channel: np.ndarray, low_percent: float, high_percent: float) -> np.ndarray:
    """Return values so scaled that two percentiles become 0 and 1; not clipped. All 0 where both are the same."""
    low, high = np.percentile(channel, [low_percent, high_percent])
    if high == low:
        return np.zeros_like(channel)
    return (channel - channel.dtype.type(low)) * channel.dtype.type(1 / (high - low))


def lightness_equalised(image: np.ndarray, *, clip_limit: float, tiles: tuple[int, int] = (8, 8)) -> np.ndarray:
    """Return the picture (H, W, 3) uint8 sRGB with L of CIELab (8 bit, D65) equalised in tiles, contrast limited.

    Source: Zuiderveld, Graphics Gems IV, 1994, pages 474-485; `cv2.createCLAHE`.
    """
    import cv2

    lab = cv2.cvtColor(np.ascontiguousarray(image), cv2.COLOR_RGB2Lab)
    equaliser = cv2.createCLAHE(clipLimit=clip_limit, tileGridSize=tiles)
    cv2.insertChannel(equaliser.apply(cv2.extractChannel(lab, 0)), lab, 0)
    return cv2.cvtColor(lab, cv2.COLOR_Lab2RGB)
