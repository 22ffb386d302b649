"""How far a picture is from a true one in radiance, where the truth has Monte-Carlo noise of known size.

Errors are root mean squares over pixels and bands, in percent of the root mean square of the truth.
"""

import numpy as np

REGIONS = 8  # rows and columns of regions


def relative_error(truth: np.ndarray, estimate: np.ndarray, *, standard_error: np.ndarray | float = 0.0) -> float:
    """Return the relative error of an estimate without the part that the truth's noise has in it. [%]

    `truth`, `estimate` (..., C) radiance, `standard_error` of the truth, (..., C) or a number. The expectation of
    (estimate - truth)^2 is the squared error plus the truth's variance, which is therefore taken off again, below as
    above the fraction bar; 0 where noise alone explains the difference. NaN for a truth without light.
    Raises ValueError unless the shapes agree.
    """
    truth, estimate = _pair(truth, estimate)
    variance = np.broadcast_to(np.square(np.asarray(standard_error, float)), truth.shape).sum()
    power = np.square(truth).sum() - variance
    if power <= 0:
        return float("nan")
    return 100 * float(np.sqrt(max(np.square(estimate - truth).sum() - variance, 0.0) / power))


def resolution(truth: np.ndarray, *, standard_error: np.ndarray, batches: int) -> float:
    """Return the `relative_error` that the truth's noise alone makes by chance: one standard deviation. [%]

    `truth`, `standard_error` (..., C); the standard error is itself known from `batches` only. Noise is independent
    between pixels and taken to be the same in all bands, which is the worst case. NaN for a truth without light.
    """
    truth, variance = np.asarray(truth, float), np.square(np.asarray(standard_error, float))
    power = np.square(truth).sum() - variance.sum()
    if power <= 0:
        return float("nan")
    spread = np.sqrt(2 * np.square(variance.sum(axis=-1)).sum() * (1 + 1 / max(batches - 1, 1)))
    return 100 * float(np.sqrt(spread / power))


def noise_share(truth: np.ndarray, *, standard_error: np.ndarray) -> float:
    """Return the Monte-Carlo noise of a picture's pixels: root mean square, in percent of that of the picture."""
    noise, power = (np.mean(np.square(one, dtype=float)) for one in (standard_error, truth))
    return 100 * float(np.sqrt(noise / power)) if power > 0 else float("nan")


def region_error(truth: np.ndarray, estimate: np.ndarray) -> float:
    """Return the relative error of the means over 8 x 8 regions: what a smooth layer is off, with little noise. [%]

    `truth`, `estimate` (H, W, C), at least 8 pixels on each side, else ValueError. NaN for a truth without light.
    """
    truth, estimate = _pair(truth, estimate)
    return relative_error(region_means(truth), region_means(estimate))


def region_means(image: np.ndarray) -> np.ndarray:
    """Return the means of an image (H, W, C) over 8 x 8 regions, (8, 8, C); ValueError below 8 pixels on a side."""
    if min(image.shape[:2]) < REGIONS:
        raise ValueError(f"region means: image is {image.shape[:2]} px, allowed: at least {REGIONS} px on each side")
    rows, columns = (np.arange(REGIONS) * length // REGIONS for length in image.shape[:2])
    sums = np.add.reduceat(np.add.reduceat(np.asarray(image, float), rows, axis=0), columns, axis=1)
    sizes = np.outer(np.diff(rows, append=image.shape[0]), np.diff(columns, append=image.shape[1]))
    return sums / sizes[..., None]


def _pair(truth: np.ndarray, estimate: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    truth, estimate = np.asarray(truth, float), np.asarray(estimate, float)
    if truth.shape != estimate.shape or truth.ndim < 2:
        raise ValueError(f"radiance: estimate is {estimate.shape}, allowed: (..., C) as the truth, {truth.shape}")
    return truth, estimate
