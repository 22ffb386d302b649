"""A noisy image as far as its noise lets one believe it: means over windows, from wide to single pixels.

Source: local linear mean-square estimate: Lee, "Digital image enhancement and noise filtering by use of local
statistics", IEEE Trans. PAMI 2(2), 1980, here from window to window with weights by the pixels' own noise.
"""

import numpy as np

SIDES_PX = (31, 15, 7, 3, 1)
# sum of squares 1: noise of variance 1 stays so
_DOUBLE_DIFFERENCE = np.array([[1, -2, 1], [-2, 4, -2], [1, -2, 1]], np.float32) / 6
_TILE_PX = 64
_EDGE_SIGMA_PX = 3.0
_LEAST_ABOUT_PX = 5
# about five independent windows: noise alone exceeds three times its mean square in 1 % of places (chi-square of 5)
_CERTAIN = 3.0


def believed(values: np.ndarray, variance: np.ndarray, *, sides_px: tuple[int, ...] = SIDES_PX) -> np.ndarray:
    """Return the estimate (H, W) float32 of what is behind values (H, W) with noise of a variance (H, W) > 0.

    Pixels of infinite variance say nothing. It begins with the mean of all; each window's mean then counts by what
    the windows about it vary beyond three times their noise, so that without noise the values come back as they are.
    Raises ValueError if shapes differ, for a variance not above 0, and values that are not finite.
    """
    if np.shape(values) != np.shape(variance) or np.ndim(values) != 2 or not np.all(np.asarray(variance) > 0):
        raise ValueError(f"noise: values {np.shape(values)}, variance {np.shape(variance)}, allowed: one (H, W), > 0")
    if not np.all(np.isfinite(values)):
        raise ValueError("noise: values are not finite, allowed: finite")
    weight = (1 / variance).astype(np.float64)
    if not weight.any():
        return np.zeros(values.shape, np.float32)
    estimate = np.full(values.shape, np.sum(weight * values) / weight.sum())
    for side in sides_px:
        weights = _mean(weight, side)
        known = weights > 0
        safe = np.where(known, weights, 1)
        noise = 1 / (safe * side * side)
        news = np.where(known, _mean(weight * values, side) / safe - estimate, 0)
        about_px = max(2 * side + 1, _LEAST_ABOUT_PX)
        total = np.maximum(_mean(weights, about_px), np.finfo(float).tiny)
        varies = _mean(weights * news * news, about_px) / total
        signal = np.maximum(varies - _CERTAIN / (total * side * side), 0)
        estimate += signal / (signal + noise) * news
    return estimate.astype(np.float32)


def believed_colour(image: np.ndarray, variance: np.ndarray) -> np.ndarray:
    """Return `believed` of an image (H, W, 3) with independent noise of a variance (H, W, 3): grey and colour apart.

    The mean of the channels has a third of their noise and most of the detail; how each differs from it is smooth, so
    that wide windows are believed. Pixels of infinite variance in one channel say nothing in all; errors as there.
    """
    grey = image.mean(axis=2)
    known = np.all(np.isfinite(variance), axis=2)
    own = np.where(known[..., None], variance, 0)
    whole = own.sum(axis=2)
    found = believed(np.where(known, grey, 0), np.where(known, whole / 9, np.inf))
    apart = [
        believed(np.where(known, image[..., k] - grey, 0), np.where(known, (whole + 3 * own[..., k]) / 9, np.inf))
        for k in range(3)
    ]
    return found[..., None] + np.dstack(apart)


def noise_excess(image: np.ndarray, variance: np.ndarray) -> np.ndarray:
    """Return how much larger the noise of an image (H, W) is than a variance (H, W) > 0 says: std over std, (H, W).

    In tiles of about 64 pixels, the mean square of a double second difference on the flatter half of each, and linear
    in between; below 1 where a black level hides the noise.
    Source: Immerkaer, "Fast noise variance estimation", Computer Vision and Image Understanding 64(2), 1996.
    Valid: white noise; fine texture counts as noise.
    """
    import cv2

    ratio = (image / np.sqrt(variance)).astype(np.float32)
    square = cv2.filter2D(ratio, -1, _DOUBLE_DIFFERENCE, borderType=cv2.BORDER_REFLECT_101) ** 2
    smooth = cv2.GaussianBlur(ratio, (0, 0), _EDGE_SIGMA_PX)
    slope = np.hypot(cv2.Sobel(smooth, cv2.CV_32F, 1, 0), cv2.Sobel(smooth, cv2.CV_32F, 0, 1))
    rows, columns = (max(1, round(size / _TILE_PX)) for size in square.shape)
    found = [
        [_flat_mean(*pair) for pair in zip(*(np.array_split(band, columns, axis=1) for band in bands), strict=True)]
        for bands in zip(np.array_split(square, rows), np.array_split(slope, rows), strict=True)
    ]
    return cv2.resize(np.sqrt(np.array(found, np.float32)), square.shape[::-1], interpolation=cv2.INTER_LINEAR)


def _flat_mean(square: np.ndarray, slope: np.ndarray) -> float:
    return float(square[slope <= np.median(slope)].mean())


def _mean(image: np.ndarray, side_px: int) -> np.ndarray:
    import cv2

    return image if side_px == 1 else cv2.blur(image, (side_px, side_px), borderType=cv2.BORDER_REFLECT)
