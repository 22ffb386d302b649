"""Contrast transfer: what of a pattern's contrast is left in a picture, by spatial frequency.

No bars need to be found: the picture of the same pattern without water is the reference, and both are compared
frequency by frequency. Light that has nothing to do with the pattern, such as a veil or noise, does not correlate with
it and takes part in the mean brightness only.
"""

from dataclasses import dataclass

import numpy as np

LEAST_CYCLES = 4.0  # in the window: below, the lamp's fall-off is what differs
FINEST_CYCLES_PER_PX = 0.25  # of charts: above, noise and the pixels' own blur decide
_CHART_BINS, _RIM_PX = 4, 2


@dataclass(frozen=True)
class Transfer:
    """`edges` (n + 1) of the frequency bins [cycles/px], `value` (n) of the transfer, `standard_error` (n)."""

    edges: np.ndarray
    value: np.ndarray
    standard_error: np.ndarray


def transfer(
    picture: np.ndarray, reference: np.ndarray, *, edges: np.ndarray, standard_error: np.ndarray | float = 0.0
) -> Transfer:
    """Return the contrast of `picture` over that of `reference` in bins of spatial frequency.

    `picture`, `reference` (H, W) linear; `edges` (n + 1) ascending [cycles/px]; `standard_error` (H, W) or a number:
    noise of the picture, independent from pixel to pixel. Per bin Re sum(Y X*) / sum |X|^2 of the windowed spectra X of
    the reference and Y of the picture, times mean(reference) / mean(picture). NaN in bins without a frequency.
    Raises ValueError unless the shapes agree and both have light.

    Source: Bendat and Piersol, Random Data, 4th ed., eq. 6.37 (frequency response by cross-spectra).
    Valid: frequencies of at least 4 cycles in the picture; blur that is the same all over it.
    """
    picture, reference = np.asarray(picture, float), np.asarray(reference, float)
    if picture.shape != reference.shape or picture.ndim != 2:
        raise ValueError(f"contrast: picture is {picture.shape}, allowed: (H, W) as the reference, {reference.shape}")
    if picture.mean() <= 0 or reference.mean() <= 0:
        raise ValueError(f"contrast: means {picture.mean():g} and {reference.mean():g}, allowed: above 0")
    window = np.outer(*(np.hanning(length + 2)[1:-1] for length in picture.shape))
    found, known = (np.fft.fft2(window * (one - np.average(one, weights=window))) for one in (picture, reference))
    frequency = np.hypot(np.fft.fftfreq(picture.shape[0])[:, None], np.fft.fftfreq(picture.shape[1])[None, :])
    usable = frequency * min(picture.shape) >= LEAST_CYCLES
    noise = np.broadcast_to(standard_error, picture.shape) * window
    bins = [
        _ratio(found, np.where(usable & (frequency >= low) & (frequency < high), known, 0), noise)
        for low, high in zip(edges[:-1], edges[1:], strict=True)
    ]
    value, error = reference.mean() / picture.mean() * np.array(bins).T
    return Transfer(np.asarray(edges, float), value, error)


def _ratio(found: np.ndarray, known: np.ndarray, noise: np.ndarray) -> tuple[float, float]:
    """Return sum(Y X*) / sum |X|^2 of two spectra, and its standard error for noise (H, W) of the windowed picture."""
    power = np.sum(np.abs(known) ** 2)
    if power == 0:
        return float("nan"), float("nan")
    # by Parseval the sum is one over the pixels, where the noise is independent
    spread = known.size * np.sqrt(np.sum(np.square(noise * np.fft.ifft2(known).real)))
    return float(np.sum(found * np.conj(known)).real / power), float(spread / power)


def transfer_error(truth: Transfer, estimate: Transfer, *, most_noise: float = 0.2) -> float:
    """Return the mean difference of two transfers, relative to the true one, over the bins that are known. [%]

    Known: the true transfer is above 0 and its standard error at most `most_noise` of it. NaN if none is.
    """
    with np.errstate(invalid="ignore"):
        known = (truth.value > 0) & (truth.standard_error <= most_noise * truth.value) & np.isfinite(estimate.value)
    if not np.any(known):
        return float("nan")
    return 100 * float(np.mean(np.abs(estimate.value[known] / truth.value[known] - 1)))


def chart_transfer(picture: np.ndarray, reference: np.ndarray, *, inside: np.ndarray) -> float:
    """Return how much of a chart's contrast is left, relative to the reference: a number up to 1.

    `picture`, `reference` (H, W) linear; `inside` (H, W) bool, where the chart is seen; 2 px of its rim stay out. Mean
    of `transfer` over four bins, evenly spaced in the logarithm, from 4 cycles in the chart's smaller side to 0.25
    cycles/px; more than the reference's contrast counts as 1 in each bin, so that an overshoot in one does not make up
    for a loss in another. NaN where the chart is smaller than 32 px, 0 for a picture that is black on the chart.

    Valid: noise that has nothing to do with the pattern adds an error that falls with the root of the chart's pixels
    and with the contrast of its bars, and no bias save that of the limit.
    """
    from scipy import ndimage

    inside = ndimage.binary_erosion(inside, iterations=_RIM_PX)
    rows, columns = (np.flatnonzero(inside.any(axis=axis)) for axis in (1, 0))
    size_px = min(np.ptp(rows), np.ptp(columns)) + 1 if len(rows) else 0
    coarsest = LEAST_CYCLES / max(size_px, 1)
    if coarsest > FINEST_CYCLES_PER_PX / 2:
        return float("nan")
    window = np.s_[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    inside = inside[window]
    # what lies beside the chart gets the chart's mean: it is no part of the pattern
    found, true = (np.where(inside, one[window], one[window][inside].mean()) for one in (picture, reference))
    if true.mean() <= 0:
        return float("nan")
    if found.mean() <= 0:
        return 0.0
    edges = np.geomspace(coarsest, FINEST_CYCLES_PER_PX, _CHART_BINS + 1)
    values = transfer(found, true, edges=edges).value
    return float(np.mean(np.minimum(values[np.isfinite(values)], 1.0)))
