"""Refusing numbers out of range in one line: where, got, allowed."""

import numpy as np


def require(
    where: str,
    values: np.ndarray,
    *,
    above: float | None = None,
    least: float | None = None,
    most: float | None = None,
    below: float | None = None,
) -> np.ndarray:
    """Return values as a float array; ValueError unless all are finite and within the bounds given."""
    array = np.asarray(values, float)
    good = np.isfinite(array)
    allowed = ["finite"]
    for bound, holds, words in (
        (above, np.greater, "above"),
        (least, np.greater_equal, "at least"),
        (most, np.less_equal, "at most"),
        (below, np.less, "below"),
    ):
        if bound is not None:
            good = good & holds(array, bound)
            allowed.append(f"{words} {bound:g}")
    if not np.all(good):
        raise ValueError(f"{where}: got {array[~good].flat[0]:.6g}, allowed: {', '.join(allowed)}")
    return array


def require_index(where: str, **indices: float) -> None:
    """Raise ValueError unless every refractive index is finite and at least 1."""
    for name, value in indices.items():
        require(f"{where} {name}", value, least=1.0)
