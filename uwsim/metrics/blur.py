"""Errors of an estimated motion blur, and of pictures deblurred. Angles: x right, y up, mod 180 deg. Scalars or arrays.

Standard deviations and intervals: those of an estimate's own covariance, or of the Cramer-Rao bound.
"""

import math

import numpy as np

FAILURE_LENGTH_PX = 2.0
FAILURE_ANGLE_DEG = 10.0
SEEN_LENGTH_PX = 2.0
"""A sharp picture of which a method says that it is blurred so much or more was taken for a blurred one."""
MEDIAN_OVER_SD = 0.6745
"""Median of the absolute value of a normal variable over its standard deviation."""
INTERVAL_SHARE = 0.9
SD_OF_INTERVAL = 1.6449
"""Half the width of the 90 % interval of a normal variable over its standard deviation."""
SSIM_WINDOW_PX = 7


def length_error_px(estimated_px: np.ndarray, true_px: np.ndarray) -> np.ndarray:
    """Return the absolute error of the blur length [px]."""
    return np.abs(np.asarray(estimated_px, dtype=float) - true_px)


def angle_error_deg(estimated_deg: np.ndarray, true_deg: np.ndarray) -> np.ndarray:
    """Return the absolute error of the blur direction [deg], in [0, 90]: directions repeat after 180 deg."""
    difference = np.asarray(estimated_deg, dtype=float) - true_deg
    return np.abs((difference + 90) % 180 - 90)


def blur_failure(length_error_px: np.ndarray, angle_error_deg: np.ndarray) -> np.ndarray:
    """Return where an estimate failed: off by more than 2 px or more than 10 deg, or not a number."""
    length_error_px, angle_error_deg = np.abs(length_error_px), np.abs(angle_error_deg)
    return ~((length_error_px <= FAILURE_LENGTH_PX) & (angle_error_deg <= FAILURE_ANGLE_DEG))


def error_to_bound_ratio(error: np.ndarray, bound_sd: np.ndarray) -> np.ndarray:
    """Return |error| over the median that the bound on the standard deviation leaves, 0.6745 of it.

    The median over many frames of an estimator at the bound is 1; it cannot be less for one without bias. Both in the
    same unit. ValueError on a bound that is not positive.
    """
    return np.abs(error) / (MEDIAN_OVER_SD * _positive(bound_sd, "error_to_bound_ratio: bound_sd"))


def error_to_sd(error: np.ndarray, sd: np.ndarray) -> np.ndarray:
    """Return |error| over the standard deviation that the method gives it; ValueError unless that is positive."""
    return np.abs(error) / _positive(sd, "error_to_sd: sd")


def within_interval(errors_to_sd: np.ndarray, *, scale: float = 1.0) -> np.ndarray:
    """Return where the truth lies in the 90 % interval, its standard deviation times `scale`."""
    return np.asarray(errors_to_sd, dtype=float) <= SD_OF_INTERVAL * scale


def interval_scale(errors_to_sd: np.ndarray) -> float:
    """Return the factor on the standard deviations with which 90 % intervals cover 90 % of these cases.

    NaN entries (no interval) are left out; NaN if there are no others.
    """
    known = np.asarray(errors_to_sd, dtype=float)
    known = known[~np.isnan(known)]
    return float(np.quantile(known, INTERVAL_SHARE)) / SD_OF_INTERVAL if known.size else math.nan


def sharp_called_blurred(length_px: np.ndarray, verdict: str) -> np.ndarray:
    """Return whether a sharp picture was called blurred by 2 px or more; the verdict "no blur" is not."""
    return (np.asarray(length_px) >= SEEN_LENGTH_PX) & (verdict != "no blur")


def field_error_px(estimated_px: np.ndarray, true_px: np.ndarray) -> np.ndarray:
    """Return the distance of estimated and true displacements, (..., 2) each [px], as (...).

    The picture of a motion does not tell its sign: the nearer of the two counts, with its length and its direction.
    """
    estimated_px = np.asarray(estimated_px, dtype=float)
    return np.minimum(
        np.linalg.norm(estimated_px - true_px, axis=-1), np.linalg.norm(estimated_px + true_px, axis=-1)
    )  # fmt: skip


def psnr_linear(reference: np.ndarray, image: np.ndarray) -> float:
    """Return the PSNR [dB] of two float pictures in linear light, (H, W[, C]), 1 = white; `math.inf` for identical."""
    _check_pair(reference, image, "psnr_linear")
    error = float(np.mean(np.square(np.asarray(reference, float) - image)))
    return math.inf if error == 0 else -10 * math.log10(error)


def ssim_linear(reference: np.ndarray, image: np.ndarray) -> float:
    """Return the SSIM of two grey float pictures in linear light, (H, W), 1 = white: as `uwsim.metrics.image.ssim`."""
    from skimage.metrics import structural_similarity

    _check_pair(reference, image, "ssim_linear")
    return float(structural_similarity(reference, image, win_size=SSIM_WINDOW_PX, data_range=1.0))


def _check_pair(reference: np.ndarray, image: np.ndarray, where: str) -> None:
    if reference.shape != image.shape or not np.issubdtype(image.dtype, np.floating):
        raise ValueError(f"{where}: got {image.dtype} {image.shape}, allowed: float of the shape {reference.shape}")


def _positive(sd: np.ndarray, where: str) -> np.ndarray:
    sd = np.asarray(sd, dtype=float)
    if np.any(sd <= 0):
        raise ValueError(f"{where}: got {sd.min()}, allowed: > 0, or NaN where there is none")
    return sd
