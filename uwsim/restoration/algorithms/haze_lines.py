"""Haze lines: pixels of one colour at several distances lie on a curve that the water's attenuation ratios know.

With I - A = t_c (J - A) and t_c = t_B^(c_c / c_B), sign(I - A) |I - A|^(c_B / c_c) is t_B times something of the
object alone: pixels of one object lie on a line through the origin, and the farthest of a line is taken for water-free.
Jerlov's types give the ratios; the one is taken that leaves the picture greyest. In linear light.

Source: Berman, Treibitz, Avidan, "Diving into haze-lines", BMVC 2017; "Underwater single image color restoration using
haze-lines and a new quantitative dataset", IEEE Trans. PAMI 43(8), 2021.
Valid: a likeness: cells of equal angle instead of 500 clusters; the flattest part of the picture by Sobel's gradient
instead of a learned edge map; a guided filter instead of weighted least squares.
"""

from functools import cache

import numpy as np

from uwsim.optics import jerlov
from uwsim.restoration import colour_constancy, guided_filter
from uwsim.restoration.levels import LUMA

INPUT = "linear_float32"
NEEDS = ()

BAND_NM = (600.0, 525.0, 475.0)
POLAR_CELLS, AZIMUTH_CELLS = 20, 40
SMALLEST_TRANSMISSION = 0.1
# the type of water and the ends of the lines are found on a picture of about this width
_WIDTH_PX = 160
_FLAT_SHARE = 0.3
_LEAST = 1e-3


def restore(image: np.ndarray) -> np.ndarray:
    """Return the linear image (H, W, 3) float32 in [0, 1] without veil and attenuation, of equal channel means.

    Raises ValueError for another shape or type.
    """
    import cv2

    if image.dtype != np.float32 or image.ndim != 3 or image.shape[2] != 3:
        raise ValueError(f"haze_lines: image {image.dtype} {image.shape}, allowed: float32 (H, W, 3)")
    factor = max(1, round(image.shape[1] / _WIDTH_PX))
    size = tuple(max(1, round(side / factor)) for side in image.shape[1::-1])
    small = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
    veil = veiling_light(small)
    ends = {name: ends_of_lines(small, veil, ratios) for name, ratios in waters().items()}
    best = min(ends, key=lambda name: _colour_cast(_cleared(small, veil, waters()[name], ends[name])))
    found = _cleared(image, veil, waters()[best], ends[best])
    return np.clip(colour_constancy.gray_world(np.maximum(found, 0)), 0, 1)


@cache
def waters() -> dict[str, np.ndarray]:
    """Return c_B / c of red, green and blue (3,) of Jerlov's types by name."""
    found = {}
    for name in jerlov.TYPES:
        absorption, scattering = jerlov.coefficients(name, np.array(BAND_NM))
        found[name] = ((absorption + scattering)[2] / (absorption + scattering)).astype(np.float32)
    return found


def veiling_light(image: np.ndarray) -> np.ndarray:
    """Return A (3,) float32: the mean of the largest connected flat part of the picture."""
    import cv2

    bright = cv2.GaussianBlur(np.sqrt(np.maximum(image @ LUMA, 0)), (0, 0), 2.0)
    slope = np.hypot(cv2.Sobel(bright, cv2.CV_32F, 1, 0), cv2.Sobel(bright, cv2.CV_32F, 0, 1))
    flat = (slope <= np.quantile(slope, _FLAT_SHARE)).astype(np.uint8)
    _, labels, statistics, _ = cv2.connectedComponentsWithStats(flat)
    largest = 1 + int(np.argmax(statistics[1:, cv2.CC_STAT_AREA]))
    return np.maximum(image[labels == largest].mean(axis=0), np.float32(_LEAST))


def ends_of_lines(image: np.ndarray, veil: np.ndarray, ratios: np.ndarray) -> np.ndarray:
    """Return how far from the origin the farthest pixel of each line lies, (cells,) float32; 0 for empty cells."""
    radius, cell = _lines(image, veil, ratios)
    ends = np.zeros(POLAR_CELLS * AZIMUTH_CELLS, np.float32)
    np.maximum.at(ends, cell.ravel(), radius.ravel())
    return ends


def blue_transmission(image: np.ndarray, veil: np.ndarray, ratios: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """Return t_B (H, W) float32 in [0.1, 1]: the share of its line's length, at least what keeps objects above 0."""
    radius, cell = _lines(image, veil, ratios)
    # a line that only this picture has begins and ends in the pixel itself
    share = radius / np.maximum(ends[cell], np.maximum(radius, 1e-12))
    least = np.max(np.maximum(1 - image / veil, 0) ** ratios, axis=2)
    return np.clip(np.maximum(share, least), SMALLEST_TRANSMISSION, 1)


def _lines(image: np.ndarray, veil: np.ndarray, ratios: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return distance from the origin and number of the direction's cell, (H, W) each."""
    offset = image - veil
    straight = np.sign(offset) * np.abs(offset) ** ratios
    radius = np.linalg.norm(straight, axis=2)
    polar = np.arccos(np.clip(straight[..., 2] / np.maximum(radius, 1e-12), -1, 1)) / np.pi
    azimuth = np.arctan2(straight[..., 1], straight[..., 0]) / (2 * np.pi) + 0.5
    row = np.minimum((polar * POLAR_CELLS).astype(int), POLAR_CELLS - 1)
    return radius, row * AZIMUTH_CELLS + np.minimum((azimuth * AZIMUTH_CELLS).astype(int), AZIMUTH_CELLS - 1)


def _cleared(image: np.ndarray, veil: np.ndarray, ratios: np.ndarray, ends: np.ndarray) -> np.ndarray:
    blue = blue_transmission(image, veil, ratios, ends)
    guide = np.sqrt(np.maximum(image @ LUMA, 0))
    radius_px = max(2, image.shape[1] // 16)
    smooth = guided_filter.guided(guide, blue, radius_px=radius_px, epsilon=1e-3, subsample=1 + (image.shape[1] > 320))
    blue = np.clip(smooth, SMALLEST_TRANSMISSION, 1)
    transmission = np.maximum(blue[..., None] ** (1 / ratios), np.float32(SMALLEST_TRANSMISSION))
    return veil + (image - veil) / transmission


def _colour_cast(image: np.ndarray) -> float:
    """Return how far the channels' means are apart, relative to their mean."""
    means = np.clip(image, 0, 1).mean(axis=(0, 1), dtype=np.float64)
    return float(np.ptp(means) / max(means.mean(), 1e-9))
