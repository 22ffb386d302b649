"""Bayer mosaic and its interpolation by OpenCV."""

import numpy as np

# bands of the pixels (0, 0), (0, 1), (1, 0), (1, 1): row, column
PATTERNS = ("RGGB", "BGGR", "GRBG", "GBRG")
# bilinear; edge aware (green along the smaller gradient); variable number of gradients (Chang, Cheung, Pang 1999)
METHODS = {"bilinear": "", "edge_aware": "_EA", "vng": "_VNG"}
LEAST_SIZE_PX = 4


def check(pattern: str, method: str, *, adc_bits: int) -> None:
    """Raise ValueError unless the pattern, the method and the method at this number of bits exist."""
    if pattern not in PATTERNS:
        raise ValueError(f"mosaic: got {pattern!r}, allowed: {', '.join(PATTERNS)}")
    if method not in METHODS:
        raise ValueError(f"demosaic: got {method!r}, allowed: {', '.join(METHODS)}")
    if method == "vng" and adc_bits != 8:
        raise ValueError(f"demosaic: 'vng' with adc_bits = {adc_bits}, allowed: 8 (OpenCV has it for 8 bits only)")


def mosaic(image: np.ndarray, *, pattern: str) -> np.ndarray:
    """Return the one band per pixel that a Bayer filter lets through, (H, W) of (H, W, 3)."""
    image = np.asarray(image)
    check_size(image.shape)
    seen = np.empty(image.shape[:2], image.dtype)
    for index, band in enumerate(pattern):
        row, column = divmod(index, 2)
        seen[row::2, column::2] = image[row::2, column::2, "RGB".index(band)]
    return seen


def demosaic(dn: np.ndarray, *, pattern: str, method: str, adc_bits: int) -> np.ndarray:
    """Return raw DN (H, W) as (H, W, 3) float64 [DN], the missing bands interpolated by OpenCV.

    Interpolation is on 16 bits, DN scaled up before and down after, so that rounding is by 2^(adc_bits - 16) DN
    (`vng`: 8 bits, by 1 DN). Samples that the mosaic has are kept by `bilinear` inside the image; at the border OpenCV
    repeats its neighbours. Raises ValueError on images smaller than 4 pixels.
    """
    import cv2

    check_size(dn.shape)
    code = getattr(cv2, f"COLOR_Bayer{pattern}2RGB{METHODS[method]}")
    if method == "vng":
        return cv2.demosaicing(dn.astype(np.uint8), code).astype(float)
    scale = 2 ** (16 - adc_bits)
    return cv2.demosaicing(dn.astype(np.uint16) * np.uint16(scale), code) / scale


def check_size(shape: tuple[int, ...]) -> None:
    """Raise ValueError on images (H, W, ...) too small to interpolate."""
    if min(shape[:2]) < LEAST_SIZE_PX:
        raise ValueError(f"mosaic: an image of {shape[1]} x {shape[0]} px, allowed: at least {LEAST_SIZE_PX} each way")
