"""Errors of an estimated pose and of image points. Leading axes are batch axes."""

import numpy as np

# rotations in float32 are off by about 1e-6; a matrix farther off is no rotation
_ORTHONORMAL_TOLERANCE = 1e-4


def rotation_error_deg(estimated: np.ndarray, true: np.ndarray) -> np.ndarray:
    """Return the angle of the rotation between two rotations (..., 3, 3) [deg], in [0, 180].

    Uses sine and cosine together, so it is exact to round-off near 0 and near 180 deg as well, where the
    common arccos form loses half of the digits. Matrices that are no rotations raise ValueError.
    """
    estimated, true = _rotation(estimated, "estimated"), _rotation(true, "true")
    between = np.swapaxes(estimated, -1, -2) @ true
    axis_sine = np.stack(
        [
            between[..., 2, 1] - between[..., 1, 2],
            between[..., 0, 2] - between[..., 2, 0],
            between[..., 1, 0] - between[..., 0, 1],
        ]
    )
    sine = np.linalg.norm(axis_sine, axis=0) / 2
    cosine = (np.trace(between, axis1=-2, axis2=-1) - 1) / 2
    return np.degrees(np.arctan2(sine, cosine))


def _rotation(matrix: np.ndarray, which: str) -> np.ndarray:
    matrix = np.asarray(matrix, dtype=float)
    if matrix.shape[-2:] != (3, 3):
        raise ValueError(f"rotation error: {which} has shape {matrix.shape}, allowed: (..., 3, 3)")
    deviation = np.abs(np.swapaxes(matrix, -1, -2) @ matrix - np.eye(3)).max(initial=0.0)
    if not (deviation <= _ORTHONORMAL_TOLERANCE and np.all(np.linalg.det(matrix) > 0)):
        raise ValueError(
            f"rotation error: {which} holds a matrix that is no rotation (R^T R - 1 up to {deviation:.1e})"
        )
    return matrix


def translation_error_percent(estimated_m: np.ndarray, true_m: np.ndarray) -> np.ndarray:
    """Return |t - t_true| / |t_true| [%] of translations (..., 3) [m]; ValueError where the true one is 0."""
    distance_m = np.linalg.norm(np.asarray(true_m, dtype=float), axis=-1)
    if np.any(distance_m == 0):
        raise ValueError("translation error: got a true translation of length 0, allowed: > 0 m")
    return 0.1 * translation_error_mm(estimated_m, true_m) / distance_m


def translation_error_mm(estimated_m: np.ndarray, true_m: np.ndarray) -> np.ndarray:
    """Return |t - t_true| [mm] of translations (..., 3) [m]."""
    return 1000 * np.linalg.norm(np.asarray(estimated_m, dtype=float) - true_m, axis=-1)


def corner_error_px(estimated_px: np.ndarray, true_px: np.ndarray) -> np.ndarray:
    """Return the distance of each image point (..., 2) to its true place [px], shape (...)."""
    estimated_px, true_px = np.asarray(estimated_px, dtype=float), np.asarray(true_px, dtype=float)
    if estimated_px.shape != true_px.shape:
        raise ValueError(f"corner error: got {estimated_px.shape} and {true_px.shape}, allowed: one shape (..., 2)")
    return np.linalg.norm(estimated_px - true_px, axis=-1)
