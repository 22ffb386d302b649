"""Checks of what is measured in pixels: places, covariances, standard deviations."""

import numpy as np

# what round-off of a product J C J^T leaves, float32 included
_UNSYMMETRIC_SHARE = 1e-6
_SINGULAR_SHARE = 1e-14


def check_pixels(pixels: np.ndarray, shape: tuple[int, ...], *, where: str) -> np.ndarray:
    """Return pixels as float64; ValueError unless they have the shape and are finite."""
    return _finite(_numbers(pixels, "pixels", where), shape, name="pixels", where=where)


def whitening_of(covariance_px2: np.ndarray, shape: tuple[int, ...], *, name: str, where: str) -> np.ndarray:
    """Return L^-1 (..., 2, 2) of covariances L L^T [px^2]: it makes errors uncorrelated, of unit deviation.

    ValueError unless they have the shape and are finite, symmetric and positive definite.
    """
    given = _finite(_numbers(covariance_px2, name, where), shape, name=name, where=where)
    first, lower, upper, last = given[..., 0, 0], given[..., 1, 0], given[..., 0, 1], given[..., 1, 1]
    symmetric = np.abs(upper - lower) <= _UNSYMMETRIC_SHARE * np.abs(given).max(axis=(-2, -1), initial=0)
    # what Cholesky, which does not say where it fails, would take the root of
    left = last - lower * lower / np.where(first > 0, first, 1.0)
    definite = (first > 0) & (left > _SINGULAR_SHARE * last)
    for kind, fine in (("symmetric", symmetric), ("positive definite", definite)):
        if not np.all(fine):
            place = tuple(int(index) for index in np.argwhere(~fine)[0])
            raise ValueError(
                f"{where}: {name} holds {np.sum(~fine)} matrices that are not {kind}, the first at {place} "
                f"{given[place].tolist()}, allowed: covariances"
            )
    return np.linalg.inv(np.linalg.cholesky(given))


def _numbers(values: object, name: str, where: str) -> np.ndarray:
    try:
        return np.asarray(values, float)
    except (TypeError, ValueError):
        raise ValueError(f"{where}: {name} holds no numbers ({type(values).__name__}), allowed: an array") from None


def _finite(values: np.ndarray, shape: tuple[int, ...], *, name: str, where: str) -> np.ndarray:
    if values.shape != shape:
        raise ValueError(f"{where}: {name} has shape {values.shape}, allowed: {shape}")
    if count := np.sum(~np.isfinite(values)):
        raise ValueError(f"{where}: {name} holds {count} NaN or infinite values, allowed: none")
    return values
