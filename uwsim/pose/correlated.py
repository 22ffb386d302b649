"""How much less neighbours tell where their noise is correlated."""

import numpy as np

_LEAST, _MOST = 1e-6, 0.95


def sum_along_line(neighbours: np.ndarray) -> np.ndarray:
    """Return the sum of an autocorrelation over all lags on a line from the correlation of neighbours.

    The correlation is taken for exp(-d^2 / (4 s^2)), that of noise smoothed by a Gaussian of standard deviation s; it
    sums to 2 s sqrt(pi). Below 1 for correlations under exp(-pi), where the formula does not hold.
    """
    return np.sqrt(np.pi / -np.log(np.clip(neighbours, _LEAST, _MOST)))
