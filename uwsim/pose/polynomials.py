"""Polynomials of many problems at once; coefficients (..., degree + 1), the constant first."""

import numpy as np


def multiplied(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return the coefficients of the product."""
    shape = (*np.broadcast_shapes(first.shape[:-1], second.shape[:-1]), first.shape[-1] + second.shape[-1] - 1)
    result = np.zeros(shape)
    for power in range(first.shape[-1]):
        result[..., power : power + second.shape[-1]] += first[..., power, None] * second
    return result


def derivative(coefficients: np.ndarray) -> np.ndarray:
    """Return the coefficients of the derivative."""
    return coefficients[..., 1:] * np.arange(1, coefficients.shape[-1])


def value(coefficients: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Return values (B, k) of polynomials (B, degree + 1) at places (B, k)."""
    result = np.zeros_like(places)
    for power in range(coefficients.shape[-1] - 1, -1, -1):
        result = result * places + coefficients[:, power, None]
    return result


def roots(coefficients: np.ndarray) -> np.ndarray:
    """Return complex roots (B, degree) of polynomials (B, degree + 1): eigenvalues of companion matrices.

    A vanishing leading coefficient is taken for a tiny one: its root is far away. NaN where all are 0.
    """
    size = np.abs(coefficients).max(axis=1, keepdims=True)
    some = size[:, 0] > 0
    scaled = np.where(some[:, None], coefficients / np.where(size > 0, size, 1.0), 1.0)
    lead = scaled[:, -1]
    lead = np.where(np.abs(lead) < 1e-14, 1e-14, lead)
    degree = scaled.shape[1] - 1
    companion = np.zeros((len(scaled), degree, degree))
    companion[:, range(1, degree), range(degree - 1)] = 1.0
    companion[:, :, -1] = -scaled[:, :-1] / lead[:, None]
    return np.where(some[:, None], np.linalg.eigvals(companion), np.nan)
