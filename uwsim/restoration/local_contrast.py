"""Detail as the picture shows it, with the contrast that detail usually has: for where nobody knows how much is lost.

Detail over its own standard deviation nearby: whatever weakened it alike about a place is gone. Where noise could make
such a detail it stays weak, and what lies behind it is shown.

Source: local normalisation, as of Retinex with a single scale and a gain control (Jobson, Rahman and Woodell 1997, IEEE
Trans. Image Processing 6(3)); the noise in the denominator is that of a Wiener filter.
Valid: detail finer than the window, and more of it than noise.
"""

import numpy as np

# standard deviation of detail, and what its mean leaves room for, in encoded values of 0 to 1
_USUAL_STD = 0.25
_ROOM = (0.3, 0.7)
# of the picture's width
_WINDOW = 0.02
# noise counts for this much of its standard deviation: less is left of it in a denoised picture
_NOISE_SHARE = 0.85


def with_usual_contrast(behind: np.ndarray, seen: np.ndarray, variance: np.ndarray) -> np.ndarray:
    """Return the picture `behind` with the grey detail of `seen`, both (H, W, 3); values about 0 to 1, not clipped.

    `behind`: encoded values in [0, 1]. `seen`: the same view in linear light, denoised, of any scale; `variance`
    (H, W, 3) > 0 of its noise before that. How far detail is shown goes by its variance over that of noise.
    Source, Valid: see the module.
    """
    grey, noise = seen.mean(axis=2), variance.sum(axis=2) / 9
    detail = grey - _mean(grey)
    power, doubt = _mean(np.square(detail)), _NOISE_SHARE**2 * _mean(noise)
    shown = (power / (power + doubt))[..., None]
    usual = _USUAL_STD * (detail / np.sqrt(power + doubt))[..., None]
    return behind + shown * (np.clip(_mean(behind), *_ROOM) + usual - behind)


def _mean(image: np.ndarray) -> np.ndarray:
    import cv2

    return cv2.GaussianBlur(np.asarray(image, np.float32), (0, 0), _WINDOW * image.shape[1])
