"""The picture of spheres that a fit compares with: lit balls, blurred, on a sloping ground.

It is  b0 [outside] + b1 x + b2 y + blur(sum of (a0 [inside] + a1 max(0, n.l) [inside]) [not inside one in front]),  n
the normal of the sphere under the pixel, l the direction of the light: a matt sphere under a far lamp, its dark side
included, and one that shines by itself. A sphere hides the ground behind it; what lies in front of both, the light that
the water scatters, is in b0 and a0 alike. Blur is a Gaussian and the pixel's own area. The a and b are those that fit
best, no a below 0 (variable projection): what is left unknown are places, radii, blur, direction of the light and the
way in the exposure.
"""

from typing import NamedTuple

import numpy as np

SHARED, EACH = 3, 3
"""Unknowns: log of the blur and the light's direction; the way in the exposure if any; of each ball its place in the
window and the log of its radius."""
_REACH_PX, _REACH = 3.0, 1.5
_HIDDEN = 0.05
"""Pixels darker than the model by more than about such a share of what a window spans are hidden or in shadow."""
_DARK, _BRIGHT = 10, 98
"""Percentiles that a window spans."""
_SAMPLES_PER_RADIUS = 18
_LEAST_SAMPLES, _MOST_SAMPLES = 2, 6
"""Samples of a pixel's side: centres are right to 0.001 radii or 0.005 px."""
_STOPS = 8
"""Places on the way."""
_GROUND, _PARTS = 3, 2
_DEPENDENT = 1e-6
"""Parts that differ by less than this share count as one."""


class Window(NamedTuple):
    """A cut-out: its first column and row, values (h, w), weights (h, w), back: picture to outline (2, 2), samples.

    `hidden_below`: brightness less than the model's by so much tells that something hides a ball, or shades it.
    """

    first: np.ndarray
    values: np.ndarray
    weights: np.ndarray
    back: np.ndarray
    samples: int
    hidden_below: float = np.inf
    shared: int = SHARED  # unknowns that all balls have in common

    @property
    def used(self) -> np.ndarray:
        """Which pixels count, (h, w) bool."""
        return self.weights > 0

    def balls(self, unknowns: np.ndarray) -> np.ndarray:
        """Return place and log of the radius of each ball, (n, 3)."""
        return unknowns[self.shared :].reshape(-1, EACH)

    def spare(self, unknowns: np.ndarray) -> int:
        """Return how many pixels more count than there are unknowns, brightnesses included."""
        return np.count_nonzero(self.used) - len(unknowns) - _GROUND - _PARTS * len(self.balls(unknowns))

    def aside_px(self, place_px: np.ndarray) -> np.ndarray:
        """Return where pixels are from a place in the window, turned back to the outline's circle, (h, w, 2)."""
        rows, columns = np.mgrid[: self.values.shape[0], : self.values.shape[1]] + 0.5
        return (np.stack([columns, rows], axis=-1) - place_px) @ self.back.T


def cut(picture: np.ndarray, usable: np.ndarray, centre_px, radius_px: float, back: np.ndarray, least_px: float):
    """Return the window of a picture (H, W) around a disc, with a border that hangs on the least radius in it."""
    height, width = picture.shape
    reach = radius_px + (_REACH - 1) * least_px + _REACH_PX
    low = np.maximum(np.floor(centre_px - reach).astype(int), 0)
    high = np.minimum(np.ceil(centre_px + reach).astype(int), [width, height])
    part = np.s_[low[1] : high[1], low[0] : high[0]]
    samples = int(np.clip(np.ceil(_SAMPLES_PER_RADIUS / least_px), _LEAST_SAMPLES, _MOST_SAMPLES))
    values = np.asarray(picture[part], float)
    window = Window(low, values, np.ones(values.shape), back, samples)
    inside = (np.linalg.norm(window.aside_px(centre_px - low), axis=-1) <= reach) & usable[part]
    dark, bright = np.percentile(values[inside], (_DARK, _BRIGHT)) if inside.any() else (0.0, 0.0)
    return window._replace(weights=inside.astype(float), hidden_below=max(_HIDDEN * (bright - dark), 1e-12))


def model(window: Window, unknowns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the picture (h, w) that fits best with these unknowns, and its ground (h, w)."""
    basis = _basis(window, unknowns)
    parts = basis[:, window.used] * np.sqrt(window.weights[window.used])
    values = window.values[window.used] * np.sqrt(window.weights[window.used])
    factors = _factors(parts @ parts.T, parts @ values)
    ground = factors[0] + np.tensordot(factors[1:_GROUND], basis[1:_GROUND], axes=1)
    return np.tensordot(factors, basis, axes=1), ground


def _factors(products: np.ndarray, onto: np.ndarray) -> np.ndarray:
    """Return the factors of least squares, none of a ball below 0."""
    kept, factors = np.arange(len(onto)), np.zeros(len(onto))
    while True:
        scale = 1 / np.sqrt(np.maximum(np.diag(products)[kept], 1e-300))
        values, vectors = np.linalg.eigh(products[np.ix_(kept, kept)] * np.outer(scale, scale))
        # near to dependent parts share what they explain
        inverse = np.where(values > _DEPENDENT * values[-1], 1 / np.maximum(values, 1e-300), 0.0)
        found = scale * (vectors @ (inverse * (vectors.T @ (scale * onto[kept]))))
        fair = (found >= 0) | (kept < _GROUND)
        if fair.all():
            factors[kept] = found
            return factors
        kept = np.delete(kept, np.argmin(np.where(fair, 0, found)))


def _basis(window: Window, unknowns: np.ndarray) -> np.ndarray:
    """Return the parts (3 + 2 n, h, w) that the picture is a sum of, the ground's three first."""
    height, width = window.values.shape
    light = np.array([*unknowns[1:SHARED], 1.0])
    light /= np.linalg.norm(light)
    way, balls = unknowns[SHARED : window.shared], window.balls(unknowns)
    if len(way):
        stops = np.outer((np.arange(_STOPS) + 0.5) / _STOPS - 0.5, way)
        parts = np.mean([_sharp(window, balls + [*stop, 0], light) for stop in stops], axis=0)
    else:
        parts = _sharp(window, balls, light)
    blur_px = float(np.exp(unknowns[0]))
    down, across = (_blurred_pixels(side, window.samples, blur_px) for side in (height, width))
    discs = down @ parts @ across.T
    ground = np.empty((_GROUND, height, width))
    # evenly bright parts come first of each ball's
    ground[0] = 1 - discs[::_PARTS].sum(axis=0)
    ground[1] = (np.arange(width) + 0.5 - width / 2) / width
    ground[2] = ((np.arange(height) + 0.5 - height / 2) / height)[:, None]
    return np.concatenate([ground, discs])


def _blurred_pixels(count: int, samples: int, blur_px: float) -> np.ndarray:
    """Return what each of `count` pixels on a line sees of each sample, (count, count samples), after the blur."""
    from scipy.special import ndtr

    apart = np.arange(-(count + 1) * samples, (count + 1) * samples + 1) / (samples * blur_px)
    # second antiderivative of the Gaussian: of pixel and sample each the whole width counts
    twice = blur_px * (apart * ndtr(apart) + np.exp(-0.5 * apart**2) / np.sqrt(2 * np.pi))
    once = np.diff(twice)
    by_distance = once[samples:] - once[:-samples]
    pixels, cells = np.arange(count) * samples, np.arange(count * samples)
    return by_distance[count * samples + samples - 1 + pixels[:, None] - cells]


def _sharp(window: Window, balls: np.ndarray, light: np.ndarray) -> np.ndarray:
    """Return what is seen of each ball, evenly bright and lit, on the grid of samples."""
    samples = window.samples
    fine = np.array(window.values.shape) * samples
    seen, parts = None, np.zeros((2 * len(balls), *fine))
    # half the sides of the rectangle around an outline of radius 1
    sides = np.linalg.norm(np.linalg.inv(window.back), axis=1)
    for number, (column, row, log_radius) in enumerate(balls):
        radius = np.exp(log_radius)
        reach = sides[::-1] * radius + 1.0
        low, high = (np.clip(((np.array([row, column]) + to) * samples).astype(int), 0, fine) for to in (-reach, reach))
        part = np.s_[low[0] : high[0], low[1] : high[1]]
        below, aside = (
            ((np.arange(first, last) + 0.5) / samples - place) / radius
            for first, last, place in zip(low, high, (row, column), strict=True)
        )
        x, y = (way[0] * aside + (way[1] * below)[:, None] for way in window.back)
        squared = x * x + y * y
        inside = np.clip((1 - np.sqrt(squared)) * (radius * samples) + 0.5, 0, 1)
        lit = np.clip(light[0] * x + light[1] * y + light[2] * np.sqrt(np.clip(1 - squared, 0, None)), 0, None)
        if len(balls) == 1:
            parts[0][part], parts[1][part] = inside, lit * inside
            continue
        seen = np.ones(fine) if seen is None else seen
        parts[2 * number][part] = inside * seen[part]
        parts[2 * number + 1][part] = lit * parts[2 * number][part]
        seen[part] *= 1 - inside
    return parts


def clear(window: Window, picture: np.ndarray) -> np.ndarray:
    """Return weights (h, w): small where the window is much darker than a model's picture, 1 elsewhere."""
    below = np.clip(picture - window.values, 0, None) / window.hidden_below
    return 1 / (1 + below**2) ** 2


def loss(window: Window, picture: np.ndarray, fair: np.ndarray) -> float:
    """Return the mean square of residuals, those of pixels darker than the model counted up to a limit."""
    off, limit = window.values - picture, window.hidden_below
    squares = np.where(off > 0, off**2, off**2 * limit**2 / (off**2 + limit**2))
    return float(np.average(squares, weights=fair))
