"""Guided filter whose penalty falls where the guide has an edge.

Source: Li, Zheng, Zhu, Yao, Wu, "Weighted guided image filtering", IEEE Trans. Image Processing 24(1), 2015.
"""

import numpy as np

from uwsim.restoration import guided_filter

# (0.001 L)^2 with L = 1
_LEAST_VARIANCE = 1e-6


def edge_weight(guide: np.ndarray) -> np.ndarray:
    """Return Gamma (H, W) float32 of a guide (H, W) float32 in [0, 1]: above 1 at edges, below 1 where it is flat.

    (v + e) times the mean of 1 / (v + e), v the variance in 3 x 3 pixels, e = 1e-6.
    """
    import cv2

    border = cv2.BORDER_REFLECT
    # in double: the difference of two near squares
    wide = guide.astype(np.float64)
    mean = cv2.blur(wide, (3, 3), borderType=border)
    variance = np.maximum(cv2.blur(wide * wide, (3, 3), borderType=border) - mean * mean, 0) + _LEAST_VARIANCE
    return (variance * np.mean(1 / variance)).astype(np.float32)


def weighted_guided(
    guide: np.ndarray, source: np.ndarray, *, radius_px: int, penalty: float, subsample: int = 1
) -> np.ndarray:
    """Return `source` (H, W) smoothed along the edges of a grey guide (H, W), both float32 with white 1.

    `penalty` is lambda: epsilon of the guided filter is lambda / Gamma. ValueError as `guided_filter.guided`.
    """
    return guided_filter.guided(
        guide, source, radius_px=radius_px, epsilon=penalty / edge_weight(guide), subsample=subsample
    )
