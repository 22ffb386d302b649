"""Medians of paired errors: their ratio, and its interval by the bootstrap."""

import math

import numpy as np

COVERAGE = 0.95
_AT_ONCE = 100


def finite(value: float) -> float:
    """Return a value, NaN for an infinite one: JSON has none."""
    return float(value) if math.isfinite(value) else math.nan


def median_ratio(errors: np.ndarray, others: np.ndarray) -> float:
    """Return the ratio of the medians of two samples (B,); NaN where either is infinite or the second 0."""
    return _ratio(float(np.median(errors)), float(np.median(others)))


def ratio_interval(
    errors: np.ndarray, others: np.ndarray, *, resamples: int, rng: np.random.Generator
) -> tuple[float, float]:
    """Return the 95 % interval of the ratio of the medians of two paired samples (B,): the same problems drawn of both.

    Source: Efron and Tibshirani, An Introduction to the Bootstrap, 1993, section 13.3, percentile interval. NaN where
    the ratio is, infinite where more than 2.5 % of the draws are.
    """
    if math.isnan(median_ratio(errors, others)):
        return math.nan, math.nan
    found = []
    for first in range(0, resamples, _AT_ONCE):
        drawn = rng.integers(len(errors), size=(min(_AT_ONCE, resamples - first), len(errors)))
        above, below = np.median(errors[drawn], axis=1), np.median(others[drawn], axis=1)
        found.append(above / np.maximum(below, np.finfo(float).tiny))
    tail = (1 - COVERAGE) / 2
    low, high = np.quantile(np.concatenate(found), (tail, 1 - tail), method="inverted_cdf")
    return float(low), float(high)


def _ratio(above: float, below: float) -> float:
    if not (math.isfinite(above) and math.isfinite(below)) or below == 0:
        return math.nan
    return above / below


def rms(values: np.ndarray) -> float:
    """Return the root mean square of the finite values; NaN without any."""
    known = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(known**2))) if known.size else math.nan


def geometric_mean(values: np.ndarray) -> float:
    """Return the geometric mean of the finite values; NaN without any."""
    known = values[np.isfinite(values)]
    return float(np.exp(np.mean(np.log(known)))) if known.size else math.nan
