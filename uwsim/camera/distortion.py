"""Lens in air: pinhole with the distortion of OpenCV. Pixel centres at integer + 0.5.

OpenCV counts pixel centres from 0: K here is OpenCV's with 0.5 added to both principal point coordinates, and pixels
here are OpenCV's plus 0.5. The coefficients are the same, as they act on x / z and y / z.
"""

import numpy as np

_COUNTS = (0, 4, 5, 8)
_STEPS = 60


def checked(coefficients, *, where: str = "distortion") -> np.ndarray:
    """Return (k1, k2, p1, p2, k3, k4, k5, k6) of the 0, 4, 5 or 8 given, zeros for the rest.

    Raises ValueError for another count or numbers that are not finite.
    """
    given = np.asarray(coefficients, float).ravel()
    if len(given) not in _COUNTS:
        raise ValueError(f"{where}: got {len(given)} coefficients, allowed: 0, 4, 5 or 8 (k1 k2 p1 p2 k3 k4 k5 k6)")
    if not np.all(np.isfinite(given)):
        raise ValueError(f"{where}: got {given.tolist()}, allowed: finite numbers")
    return np.concatenate([given, np.zeros(8 - len(given))])


def _with_jacobian(undistorted: np.ndarray, coefficients: np.ndarray) -> tuple[np.ndarray, tuple]:
    """Return distorted coordinates (..., 2) and their derivatives (dx/dx, dx/dy, dy/dx, dy/dy), each (...)."""
    k1, k2, p1, p2, k3, k4, k5, k6 = coefficients
    x, y = undistorted[..., 0], undistorted[..., 1]
    s = x * x + y * y
    numerator, denominator = 1 + s * (k1 + s * (k2 + s * k3)), 1 + s * (k4 + s * (k5 + s * k6))
    radial = numerator / denominator
    # d radial / d s
    slope = (k1 + s * (2 * k2 + 3 * k3 * s) - radial * (k4 + s * (2 * k5 + 3 * k6 * s))) / denominator
    distorted = np.stack(
        [x * radial + 2 * p1 * x * y + p2 * (s + 2 * x * x), y * radial + p1 * (s + 2 * y * y) + 2 * p2 * x * y],
        axis=-1,
    )
    mixed = 2 * x * y * slope + 2 * p1 * x + 2 * p2 * y
    xx = radial + 2 * x * x * slope + 2 * p1 * y + 6 * p2 * x
    yy = radial + 2 * y * y * slope + 6 * p1 * y + 2 * p2 * x
    return distorted, (xx, mixed, mixed, yy)


def distort(undistorted: np.ndarray, *, coefficients) -> np.ndarray:
    """Return distorted image coordinates (..., 2) of undistorted ones (x / z, y / z) (..., 2). [1]

    Source: OpenCV documentation, calib3d: x'' = x' (1 + k1 r^2 + k2 r^4 + k3 r^6) / (1 + k4 r^2 + k5 r^4 + k6 r^6)
    + 2 p1 x' y' + p2 (r^2 + 2 x'^2), y'' with p1 and p2 exchanged.
    Valid: up to `fold_radius`, beyond which the polynomial bends back on the image.
    """
    return _with_jacobian(np.asarray(undistorted, float), checked(coefficients))[0]


def fold_radius(*, coefficients) -> float:
    """Return the undistorted radius at which the radial part stops to increase; infinity if it never does. [1]"""
    k1, k2, _, _, k3, k4, k5, k6 = checked(coefficients)
    s = np.polynomial.Polynomial([0, 1])
    numerator, denominator = np.polynomial.Polynomial([1, k1, k2, k3]), np.polynomial.Polynomial([1, k4, k5, k6])
    # d/dr of r N(r^2) / D(r^2), times D^2
    rise = (numerator + 2 * s * numerator.deriv()) * denominator - 2 * s * numerator * denominator.deriv()
    roots = np.concatenate([rise.trim().roots(), denominator.trim().roots()])
    real = roots[np.abs(roots.imag) <= 1e-9 * np.abs(roots)].real
    return float(np.sqrt(real[real > 0].min())) if np.any(real > 0) else np.inf


def is_before_fold(undistorted: np.ndarray, *, coefficients) -> np.ndarray:
    """Return True (...) where undistorted coordinates (..., 2) lie on the part of the image that is not folded."""
    undistorted = np.asarray(undistorted, float)
    (xx, xy, yx, yy) = _with_jacobian(undistorted, checked(coefficients))[1]
    inside = np.hypot(undistorted[..., 0], undistorted[..., 1]) < fold_radius(coefficients=coefficients)
    return inside & (xx * yy - xy * yx > 0)


def undistort(distorted: np.ndarray, *, coefficients) -> np.ndarray:
    """Return undistorted coordinates (..., 2) of distorted ones (..., 2), to 1e-12; NaN where there are none.

    Newton's method, its steps halved while they leave the part before the fold or miss the target by more.
    """
    distorted, values = np.asarray(distorted, float), checked(coefficients)
    if not np.any(values):
        return distorted.copy()
    target = np.where(np.isfinite(distorted), distorted, np.nan).reshape(-1, 2)
    fold = fold_radius(coefficients=values)
    radius = np.linalg.norm(target, axis=-1, keepdims=True)
    estimate = target * np.where(radius < 0.8 * fold, 1.0, 0.8 * fold / np.maximum(radius, 1e-300))
    open_rows = np.flatnonzero(np.isfinite(radius))
    for _ in range(_STEPS):
        moved = _newton_step(estimate[open_rows], target[open_rows], values=values, fold=fold)
        is_moved = np.any(moved != estimate[open_rows], axis=-1)
        estimate[open_rows] = moved
        open_rows = open_rows[is_moved]
        if len(open_rows) == 0:
            break
    error = np.abs(target - _with_jacobian(estimate, values)[0])
    found = np.all(error <= 1e-12 * (1 + np.abs(target)), axis=-1) & is_before_fold(estimate, coefficients=values)
    return np.where(found[:, None], estimate, np.nan).reshape(distorted.shape)


def _newton_step(estimate: np.ndarray, target: np.ndarray, *, values: np.ndarray, fold: float) -> np.ndarray:
    """Return estimates (n, 2) one step nearer to `target` (n, 2); unchanged where they are there or no step helps."""
    reached, (xx, xy, yx, yy) = _with_jacobian(estimate, values)
    x, y = (target - reached).T
    determinant = xx * yy - xy * yx
    determinant = np.where(determinant == 0, 1e-300, determinant)
    with np.errstate(over="ignore"):
        step = np.stack([yy * x - xy * y, xx * y - yx * x], axis=-1) / determinant[:, None]
    step = np.where(np.isfinite(step), step, 0.0)
    before = np.hypot(x, y)
    result = estimate.copy()
    rows = np.flatnonzero(before > 1e-15)
    for halvings in range(12):
        trial = estimate[rows] + step[rows] / 2**halvings
        inside = np.linalg.norm(trial, axis=-1) < fold
        trial = np.where(inside[:, None], trial, 0.0)
        missing = target[rows] - _with_jacobian(trial, values)[0]
        better = inside & (np.hypot(missing[:, 0], missing[:, 1]) < before[rows])
        result[rows[better]] = trial[better]
        rows = rows[~better]
        if len(rows) == 0:
            break
    return result


def project(points_camera_m: np.ndarray, K: np.ndarray, *, coefficients=()) -> np.ndarray:
    """Return pixels (..., 2) of points (..., 3) in air; NaN behind the camera and beyond the fold of the distortion."""
    points = np.asarray(points_camera_m, float)
    flat = points[..., :2] / np.where(points[..., 2:] > 0, points[..., 2:], np.nan)
    flat = np.where(is_before_fold(flat, coefficients=coefficients)[..., None], flat, np.nan)
    return distort(flat, coefficients=coefficients) @ K[:2, :2].T + K[:2, 2]


def directions(pixels_px: np.ndarray, K: np.ndarray, *, coefficients=()) -> np.ndarray:
    """Return unit directions (..., 3) in the camera frame of pixels (..., 2) in air; NaN where the lens has none."""
    distorted = (np.asarray(pixels_px, float) - K[:2, 2]) @ np.linalg.inv(K[:2, :2]).T
    flat = undistort(distorted, coefficients=coefficients)
    result = np.concatenate([flat, np.ones_like(flat[..., :1])], axis=-1)
    return result / np.linalg.norm(result, axis=-1, keepdims=True)
