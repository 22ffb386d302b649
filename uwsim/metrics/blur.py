"""Errors of an estimated uniform motion blur. Angles: x right, y up, mod 180 deg. Scalars or arrays."""

import numpy as np

FAILURE_LENGTH_PX = 2.0
FAILURE_ANGLE_DEG = 10.0


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
