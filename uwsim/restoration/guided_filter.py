"""Smoothing that keeps the edges of a guide: in every window the result is linear in the guide.

Source: He, Sun, Tang, "Guided image filtering", IEEE Trans. PAMI 35(6), 2013, eqs 5, 6, 8 (grey guide) and 14-16
(colour guide); subsampling: He, Sun, "Fast guided filter", arXiv 1505.00996, 2015, algorithm 2.
"""

import numpy as np


def guided(
    guide: np.ndarray, source: np.ndarray, *, radius_px: int, epsilon: float | np.ndarray, subsample: int = 1
) -> np.ndarray:
    """Return `source` (H, W) smoothed along the edges of `guide` (H, W) or (H, W, 3), (H, W) float32.

    Both float32 and finite. Windows are squares of 2 radius_px + 1, mirrored at the border of the image. `epsilon`
    [guide units^2]: edges whose variance is well below it are smoothed away; with a grey guide also a map (H, W).
    `subsample` n > 1 finds the linear coefficients on every n-th pixel (areas averaged) and enlarges them: about n^2
    times faster, and for radii well above n hardly another result. Raises ValueError on anything else.
    """
    _check(guide, source, radius_px, epsilon, subsample)
    if subsample == 1:
        return _apply(guide, coefficients(guide, source, radius_px=radius_px, epsilon=epsilon))
    return _enlarged(guide, guide, source, radius_px, epsilon, subsample)


def guided_enlarged(
    guide: np.ndarray, small_guide: np.ndarray, source: np.ndarray, *,
    radius_px: int, epsilon: float | np.ndarray, subsample: int = 1,
) -> np.ndarray:  # fmt: skip
    """Return a smaller `source` (h, w) at the size and with the edges of `guide` (H, W) or (H, W, 3), (H, W) float32.

    `small_guide` is the guide at the size of `source`, to which radius_px, epsilon and subsample belong; else as
    `guided`. ValueError on anything else.
    """
    _check(small_guide, source, radius_px, epsilon, subsample)
    if guide.dtype != np.float32 or guide.ndim != small_guide.ndim or guide.shape[2:] != small_guide.shape[2:]:
        raise ValueError(f"guided filter: guide {guide.dtype} {guide.shape}, allowed: float32, as {small_guide.shape}")
    return _enlarged(guide, small_guide, source, radius_px, epsilon, subsample)


def _enlarged(guide, small_guide, source, radius_px, epsilon, subsample) -> np.ndarray:
    import cv2

    found = coefficients(
        _shrunk(small_guide, subsample), _shrunk(source, subsample), radius_px=max(1, round(radius_px / subsample)),
        epsilon=_shrunk(epsilon, subsample) if np.ndim(epsilon) else epsilon,
    )  # fmt: skip
    size = guide.shape[1::-1]
    return _apply(guide, tuple(cv2.resize(values, size, interpolation=cv2.INTER_LINEAR) for values in found))


def coefficients(
    guide: np.ndarray, source: np.ndarray, *, radius_px: int, epsilon: float | np.ndarray
) -> tuple[np.ndarray, ...]:
    """Return the windows' mean slopes and intercept: the result is slope x guide + intercept (one slope per channel).

    Arguments as `guided`, not checked again; each (H, W) float32.
    """
    if guide.ndim == 2:
        slopes = _grey_slopes(guide, source, radius_px, epsilon)
        channels = (guide,)
    else:
        channels = tuple(np.ascontiguousarray(guide[..., channel]) for channel in range(3))
        slopes = _colour_slopes(channels, source, radius_px, epsilon)
    intercept = _mean(source, radius_px)
    for slope, channel in zip(slopes, channels, strict=True):
        intercept -= slope * _mean(channel, radius_px)
    return (*(_mean(slope, radius_px) for slope in slopes), _mean(intercept, radius_px))


def _apply(guide: np.ndarray, found: tuple[np.ndarray, ...]) -> np.ndarray:
    *slopes, intercept = found
    if guide.ndim == 2:
        return slopes[0] * guide + intercept
    return sum((slope * guide[..., channel] for channel, slope in enumerate(slopes)), intercept)


def _grey_slopes(guide, source, radius_px, epsilon) -> tuple[np.ndarray]:
    mean_guide, mean_source = _mean(guide, radius_px), _mean(source, radius_px)
    covariance = _mean(guide * source, radius_px) - mean_guide * mean_source
    variance = _mean(guide * guide, radius_px) - mean_guide * mean_guide
    # round-off can leave a variance a little below 0, which must not eat up epsilon
    return (covariance / (np.maximum(variance, 0) + np.asarray(epsilon, dtype=np.float32)),)


def _colour_slopes(channels, source, radius_px, epsilon) -> tuple[np.ndarray, ...]:
    """Return (covariance of the guide + epsilon)^-1 covariance with the source, by cofactors. Double: they cancel."""
    wide = [channel.astype(np.float64) for channel in channels]
    means = [_mean(channel, radius_px) for channel in wide]
    mean_source = _mean(source.astype(np.float64), radius_px)

    def covariance(first: int, second: int) -> np.ndarray:
        return _mean(wide[first] * wide[second], radius_px) - means[first] * means[second]

    rr, rg, rb = covariance(0, 0) + epsilon, covariance(0, 1), covariance(0, 2)
    gg, gb, bb = covariance(1, 1) + epsilon, covariance(1, 2), covariance(2, 2) + epsilon
    # of the symmetric 3 x 3 matrix
    cofactors = [
        [gg * bb - gb * gb, rb * gb - rg * bb, rg * gb - rb * gg],
        [None, rr * bb - rb * rb, rb * rg - rr * gb],
        [None, None, rr * gg - rg * rg],
    ]
    determinant = rr * cofactors[0][0] + rg * cofactors[0][1] + rb * cofactors[0][2]
    with_source = [
        _mean(channel * source, radius_px) - mean * mean_source for channel, mean in zip(wide, means, strict=True)
    ]
    return tuple(
        (sum(cofactors[min(i, j)][max(i, j)] * with_source[j] for j in range(3)) / determinant).astype(np.float32)
        for i in range(3)
    )


def _mean(image: np.ndarray, radius_px: int) -> np.ndarray:
    import cv2

    side = 2 * radius_px + 1
    return cv2.blur(image, (side, side), borderType=cv2.BORDER_REFLECT)


def _shrunk(image: np.ndarray, factor: int) -> np.ndarray:
    import cv2

    if factor == 1:
        return image
    height, width = image.shape[:2]
    size = (max(1, round(width / factor)), max(1, round(height / factor)))
    return cv2.resize(image, size, interpolation=cv2.INTER_AREA)


def _check(guide, source, radius_px, epsilon, subsample) -> None:
    if source.ndim != 2 or guide.shape not in (source.shape, (*source.shape, 3)):
        raise ValueError(
            f"guided filter: guide {guide.shape}, source {source.shape}, "
            f"allowed: source (H, W), guide (H, W) or (H, W, 3)"
        )
    for name, image in (("guide", guide), ("source", source)):
        if image.dtype != np.float32 or not np.isfinite(image).all():
            raise ValueError(f"guided filter: {name} is {image.dtype} or not finite, allowed: finite float32")
    for name, value in (("radius_px", radius_px), ("subsample", subsample)):
        if not isinstance(value, int | np.integer) or value < 1:
            raise ValueError(f"guided filter: {name} = {value!r}, allowed: a whole number >= 1")
    shapes = ((), source.shape) if guide.ndim == 2 else ((),)
    if np.shape(epsilon) not in shapes or not np.all(np.asarray(epsilon) > 0):
        raise ValueError(
            f"guided filter: epsilon of shape {np.shape(epsilon)}, least {np.min(epsilon):g}, "
            f"allowed: > 0, a number, or with a grey guide (H, W)"
        )
