"""Sub-pixel corners of a dark square on a bright ground: lines fitted to its four edges, intersected.

OpenCV's own refinement sees only the surroundings of each corner, where blur rounds the corner off: it is off
by 0.2 to 0.4 px on exact pictures. Along the edges blur is symmetric.
"""

from typing import NamedTuple

import numpy as np

from uwsim.pose.correlated import sum_along_line

ITERATIONS = 4
# the ends of an edge are left out: there the neighbouring edge and the rounding of the corner interfere
_ENDS_SHARE = 0.12
_STEP_ALONG_PX, _STEP_ACROSS_PX = 0.5, 0.25
_HALF_WIDTH_PX = (1.5, 4.0)
_HALF_WIDTH_MODULES = 0.6
_OUTLIER_MADS = 4.0
# standard deviations of corners in rendered pictures over those that the scatter along the edges tells: what
# `benchmarks/fits/marker_errors.py` finds on `pose_tuning`
CORNERS_OVER_MODEL_STD = 2.1
# lags up to which places along an edge are taken for correlated
_CORRELATED_PX = 4.0
# of places on a noise-free picture: interpolation
_LEAST_VARIANCE_PX2 = 1e-4


def refine_corners(grey: np.ndarray, corners_px: np.ndarray, *, modules: int) -> np.ndarray:
    """Return corners (4, 2) [px, centres at integer + 0.5] refined in a linear picture (H, W).

    `corners_px` runs clockwise in the picture; `modules` is the number of modules along a side, black border
    included. Where an edge cannot be fitted, or a corner would move by more than a module, the corners are
    returned as they came.

    Source: the edge location of ISO 12233 (slanted edge: centroid of the derivative across the edge, straight
    line through the centroids), here with one rejection of outliers.
    """
    start = np.asarray(corners_px, dtype=float)
    module_px, half_width_px = _module_and_half_width(start, modules)
    current = start
    for _ in range(ITERATIONS):
        lines = [_edge_line(grey, current[i], current[(i + 1) % 4], half_width_px) for i in range(4)]
        if any(line is None for line in lines):
            return start
        current = np.array([_intersection(lines[i - 1], lines[i]) for i in range(4)])
        moved = np.linalg.norm(current - start, axis=1)
        if not np.all(moved <= max(module_px, _HALF_WIDTH_PX[0])):
            return start
    return current


def corner_covariances(grey: np.ndarray, corners_px: np.ndarray, *, modules: int) -> np.ndarray:
    """Return covariances (4, 2, 2) [px^2] of corners as `refine_corners` gives them; NaN where an edge has no line.

    From the scatter of the edges' places about their lines, all four edges together, each carried on to where it meets
    the next; places are worth as many as their residuals are independent. Times `CORNERS_OVER_MODEL_STD` squared.
    """
    corners = np.asarray(corners_px, dtype=float)
    _, half_width_px = _module_and_half_width(corners, modules)
    edges = [_edge_places(grey, corners[i], corners[(i + 1) % 4], half_width_px) for i in range(4)]
    squares, worth_one = _scatter([edge for edge in edges if edge is not None])
    found = np.full((4, 2, 2), np.nan)
    for corner in range(4):
        before, after = edges[corner - 1], edges[corner]
        if before is None or after is None:
            continue
        # dx = N^-1 (e, f): errors of the two lines, across them, at the corner
        back = np.array([before.outward, after.outward])
        if abs(np.linalg.det(back)) < 1e-6:
            continue
        inverse = np.linalg.inv(back)
        lines = (before, before.length), (after, 0.0)
        variances = [edge.variance_at(place, squares=squares, worth_one=worth_one) for edge, place in lines]
        found[corner] = CORNERS_OVER_MODEL_STD**2 * inverse @ np.diag(variances) @ inverse.T
    return found


def _module_and_half_width(corners: np.ndarray, modules: int) -> tuple[float, float]:
    """Return the side of a module, and how far to both sides of an edge it is sought. [px]"""
    module_px = np.linalg.norm(np.roll(corners, -1, axis=0) - corners, axis=1).min() / modules
    return module_px, float(np.clip(_HALF_WIDTH_MODULES * module_px, *_HALF_WIDTH_PX))


class _Edge(NamedTuple):
    """Places found along an edge: distances (n,), offsets (n,), weights (n,); its length and directions (2,)."""

    distances: np.ndarray
    offsets: np.ndarray
    weights: np.ndarray
    length: float
    along: np.ndarray
    outward: np.ndarray

    @property
    def residuals(self) -> np.ndarray:
        """Offsets (n,) from the line through the places; 0 where one has no weight."""
        slope, offset = _weighted_line(self.distances, self.offsets, self.weights)
        return np.where(self.weights > 0, self.offsets - slope * self.distances - offset, 0.0)

    def variance_at(self, distance: float, *, squares: float, worth_one: float) -> float:
        """Return the variance of the line's offset at a distance along the edge, from `_scatter`. [px^2]"""
        shares = self.weights / self.weights.sum()
        middle = shares @ self.distances
        spread = shares @ (self.distances - middle) ** 2
        independent = 1 / (shares @ shares) / worth_one
        if not (independent > 2 and spread > 0):
            return np.nan
        lever = 1 + (distance - middle) ** 2 / spread
        return float(max(squares, _LEAST_VARIANCE_PX2) * lever / (independent - 2))


def _scatter(edges: list[_Edge]) -> tuple[float, float]:
    """Return the mean squared residual of edges [px^2], and how many neighbouring places are worth one.

    One for all edges of a square: they share print, light and blur, and of the few places of one edge the scatter is
    known to a factor only, which as a weight does more harm than none.
    """
    if not edges:
        return np.nan, np.nan
    found = [(edge.weights / edge.weights.sum(), edge.residuals) for edge in edges]
    squares = [shares @ residuals**2 for shares, residuals in found]
    return float(np.mean(squares)), float(np.mean([_correlated_places(residuals) for _, residuals in found]))


def _correlated_places(residuals: np.ndarray) -> float:
    """Return how many neighbouring places (n,) along an edge are worth one: the sum of the autocorrelation.

    At least a pixel's; noise of a smoothed or restored picture, and light scattered into an edge, reach further.
    """
    lags = np.arange(1, min(_CORRELATED_PX / _STEP_ALONG_PX, len(residuals) - 1) + 1).astype(int)
    square = max(residuals @ residuals / len(residuals), 1e-300)
    shares = [residuals[lag:] @ residuals[:-lag] / (len(residuals) - lag) / square for lag in lags]
    # what the fitted line has taken up is missing in the sum over lags
    smooth = sum_along_line(shares[0]) if shares else 1.0
    return float(max(1 + 2 * np.sum(shares), smooth, 1 / _STEP_ALONG_PX))


def _edge_line(grey, first, second, half_width_px: float) -> tuple[np.ndarray, np.ndarray] | None:
    """Return (point, direction) of the edge near the segment, dark on its right; None if there is none."""
    edge = _edge_places(grey, first, second, half_width_px)
    if edge is None:
        return None
    slope, offset = _weighted_line(edge.distances, edge.offsets, edge.weights)
    return first + offset * edge.outward, edge.along + slope * edge.outward


def _edge_places(grey, first, second, half_width_px: float) -> _Edge | None:
    """Return where the edge near the segment is, dark on its right; None if there is none."""
    length = np.linalg.norm(second - first)
    if not length > 4 * _STEP_ALONG_PX:
        return None
    along = (second - first) / length
    # clockwise corners with rows going down: the outside is to the left of the walk
    outward = np.array([along[1], -along[0]])
    count = max(int((1 - 2 * _ENDS_SHARE) * length / _STEP_ALONG_PX), 4)
    distances = np.linspace(_ENDS_SHARE, 1 - _ENDS_SHARE, count) * length
    across = np.arange(-half_width_px, half_width_px + 1e-9, _STEP_ACROSS_PX)
    places = first + distances[:, None, None] * along + across[None, :, None] * outward
    rise = np.clip(np.diff(_sample(grey, places), axis=1), 0, None)
    strength = rise.sum(axis=1)
    if not np.count_nonzero(strength > 0) >= 4:
        return None
    middle = (across[1:] + across[:-1]) / 2
    offsets = rise @ middle / np.where(strength > 0, strength, 1)
    slope, offset = _weighted_line(distances, offsets, strength)
    residuals = np.abs(offsets - slope * distances - offset)
    kept = residuals <= _OUTLIER_MADS * np.median(residuals[strength > 0]) + 1e-9
    return _Edge(distances, offsets, strength * kept, float(length), along, outward)


def _weighted_line(x: np.ndarray, y: np.ndarray, weights: np.ndarray) -> tuple[float, float]:
    """Return slope and offset of the least-squares line y = slope x + offset; slope 0 if x does not vary."""
    total = weights.sum()
    mean_x, mean_y = weights @ x / total, weights @ y / total
    spread = weights @ (x - mean_x) ** 2
    slope = weights @ ((x - mean_x) * (y - mean_y)) / spread if spread > 0 else 0.0
    return slope, mean_y - slope * mean_x


def _sample(grey: np.ndarray, places_px: np.ndarray) -> np.ndarray:
    """Return bilinear samples at pixels (..., 2) in x, y with centres at integer + 0.5; edges repeated."""
    from scipy import ndimage

    rows, columns = places_px[..., 1] - 0.5, places_px[..., 0] - 0.5
    return ndimage.map_coordinates(grey, [rows, columns], order=1, mode="nearest")


def _intersection(first: tuple[np.ndarray, np.ndarray], second: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    """Return the crossing of two lines given as (point, direction); NaN if they are parallel."""
    (a, along_a), (b, along_b) = first, second
    cross = along_a[0] * along_b[1] - along_a[1] * along_b[0]
    if abs(cross) < 1e-9:
        return np.full(2, np.nan)
    offset = b - a
    return a + along_a * (offset[0] * along_b[1] - offset[1] * along_b[0]) / cross
