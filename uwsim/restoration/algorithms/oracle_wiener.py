"""The best local linear estimate of the object, given the layers of the water and the noise: an oracle.

y = g J + B + F + n: known are backscatter B, forward scatter F, what the water leaves of the direct light g, and the
standard deviation of n. From wide windows to single pixels, each step moves the estimate towards the window's mean of
(y - B - F) / g, weighted by precision, as far as the scatter of these means exceeds what noise alone gives them:
V / (V + s), s the variance by noise, V the rest. Where g is small or noise large, the wider window's value stays.

An achievable bound, no ceiling: light scattered forward is subtracted, not used, and J is taken from nothing but y.

Source: Lee, "Digital image enhancement and noise filtering by use of local statistics", IEEE Trans. PAMI 2(2), 1980
(local linear minimum mean square error), with the variance of the noise known and a prior from the next wider window.
Valid: noise independent from pixel to pixel, picture not clipped at white.
"""

import numpy as np

INPUT = "linear_float32"
NEEDS = ("backscatter", "forward_scatter", "direct_gain", "noise_std")

WINDOWS_PX = (63, 31, 15, 7, 3, 1)
# before anything is seen: a grey of any brightness
PRIOR_MEAN, PRIOR_STD = 0.2, 0.3
# the scatter of the means is taken over about twice their window, but trusted up to some times that of the far
# window: single outliers would pass for detail
FAR_PX, MOST_OVER_FAR = 63, 3.0
# both layers of scattered light are smooth; what is not is the noise of their rendering, which the picture shares
SCATTER_SMOOTH_PX = 2.0
# keeps a mean without noise from outweighing all others
_LEAST_VARIANCE = 1e-3
_TINY = 1e-12


def restore(
    image: np.ndarray, *, backscatter: np.ndarray, forward_scatter: np.ndarray, direct_gain: np.ndarray,
    noise_std: np.ndarray,
) -> np.ndarray:  # fmt: skip
    """Return the linear image (H, W, 3) float32 in [0, 1] without the water.

    All (H, W, 3), in the units of the image; `direct_gain` >= 0 without unit, `noise_std` > 0. ValueError on other
    shapes or values.
    """
    import cv2

    given = {
        "backscatter": backscatter, "forward_scatter": forward_scatter, "direct_gain": direct_gain,
        "noise_std": noise_std,
    }  # fmt: skip
    for name, values in given.items():
        if np.shape(values) != image.shape or not np.all(np.isfinite(values)):
            raise ValueError(f"oracle_wiener: {name} is {np.shape(values)}, allowed: finite, shape {image.shape}")
    if not (np.min(direct_gain) >= 0 and np.min(noise_std) > 0):
        raise ValueError(
            f"oracle_wiener: least direct_gain {np.min(direct_gain):g}, least noise_std {np.min(noise_std):g}, "
            f"allowed: at least 0, above 0"
        )
    scattered = cv2.GaussianBlur(
        np.asarray(backscatter + forward_scatter, np.float32), (0, 0), SCATTER_SMOOTH_PX, borderType=cv2.BORDER_REFLECT
    )
    precision = direct_gain / np.square(noise_std)
    return np.clip(
        _coarse_to_fine(precision * (image - scattered), precision * direct_gain), 0, 1
    ).astype(np.float32)  # fmt: skip


def _coarse_to_fine(weighted: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Return the estimate (H, W, 3) from values times weight, and weight = 1 / variance of the values."""
    weighted, weight = (np.asarray(values, np.float32) for values in (weighted, weight))
    estimate, spread = np.full_like(weight, PRIOR_MEAN), np.float32(PRIOR_STD**2)
    for index, side_px in enumerate(WINDOWS_PX):
        in_window = np.maximum(_mean(weight, side_px), _TINY)
        step = _mean(weighted, side_px) / in_window - estimate
        by_noise = 1 / (in_window * side_px**2)
        if index > 0:
            spread = _spread(step, by_noise, near_px=2 * side_px + 1, far_px=FAR_PX)
        estimate = estimate + spread / (spread + by_noise) * step
    return estimate


def _spread(step: np.ndarray, by_noise: np.ndarray, *, near_px: int, far_px: int) -> np.ndarray:
    """Return the local mean square of the steps beyond what noise gives them, weighted by precision; >= 0."""
    precision = 1 / np.square(by_noise + _LEAST_VARIANCE)
    excess = precision * (np.square(step) - by_noise)
    near, far = (np.maximum(_mean(excess, side) / _mean(precision, side), 0) for side in (near_px, far_px))
    # an error of the layers, divided by a small gain, is no scatter of objects: they stay within the prior
    return np.minimum(np.minimum(near, MOST_OVER_FAR * far), np.float32(PRIOR_STD**2))


def _mean(image: np.ndarray, side_px: int) -> np.ndarray:
    import cv2

    # a window wider than the picture would only count its mirror images
    height, width = image.shape[:2]
    return cv2.blur(
        image, (min(side_px, 2 * width - 1), min(side_px, 2 * height - 1)), borderType=cv2.BORDER_REFLECT
    )  # fmt: skip
