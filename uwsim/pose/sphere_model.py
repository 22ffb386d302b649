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
        """Return place and log of the radius of each ball, (..., n, 3), of unknowns (..., u)."""
        return unknowns[..., self.shared :].reshape(*unknowns.shape[:-1], -1, EACH)

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
    return fitted(window, parts_of(window, unknowns[None])[0])


def parts_of(window: Window, tried: np.ndarray) -> np.ndarray:
    """Return what pictures with unknowns (b, u), all of one blur, are sums of: (b, 3 + 2 n, h, w), the ground first."""
    return _with_ground(window, _sharp(window, tried), _blur(window, tried[0]))


def fitted(window: Window, parts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the sum of parts (3 + 2 n, h, w) that fits best (h, w), and its ground (h, w)."""
    factors, _ = _factors(*_counted(window, parts))
    ground = factors[0] + np.tensordot(factors[1:_GROUND], parts[1:_GROUND], axes=1)
    return np.tensordot(factors, parts, axes=1), ground


def slope(window: Window, unknowns: np.ndarray, step: float) -> np.ndarray:
    """Return the change (pixels that count, unknowns) of `model`, times the square roots of their weights.

    Of brightnesses that are kept, less what other brightnesses would take up. Source: Kaufman, BIT 15(1), 1975.
    """
    tried = unknowns + step * np.eye(len(unknowns))
    # the first is the blur
    sharp = _sharp(window, np.concatenate([unknowns[None], tried[1:]]))
    blur, other_blur = _blur(window, unknowns), _blur(window, tried[0])
    parts, values = _counted(window, _with_ground(window, sharp[:1], blur)[0])
    factors, inverse = _factors(parts, values)
    # a ball hides the ground
    bright = factors[_GROUND:] - factors[0] * (np.arange(len(factors) - _GROUND) % _PARTS == 0)
    lit = np.einsum("k,bkij->bij", bright, sharp)
    here = blur[0] @ lit @ blur[1].T
    change = [other_blur[0] @ lit[0] @ other_blur[1].T - here[0], *(here[1:] - here[0])]
    change = np.stack([one[window.used] for one in change], axis=-1) / step
    change *= np.sqrt(window.weights[window.used])[:, None]
    return change - parts.T @ (inverse @ (parts @ change))


def _counted(window: Window, parts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return parts (n, h, w) and values of the pixels that count, times the square roots of their weights."""
    roots = np.sqrt(window.weights[window.used])
    return parts[:, window.used] * roots, window.values[window.used] * roots


def _factors(parts: np.ndarray, brightness: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the factors (n,) of least squares, none of a ball below 0, and the inverse (n, n) that gave them."""
    products, onto = parts @ parts.T, parts @ brightness
    kept, factors, inverse = np.arange(len(onto)), np.zeros(len(onto)), np.zeros(products.shape)
    while True:
        scale = 1 / np.sqrt(np.maximum(np.diag(products)[kept], 1e-300))
        values, vectors = np.linalg.eigh(products[np.ix_(kept, kept)] * np.outer(scale, scale))
        # near to dependent parts share what they explain
        vectors = scale[:, None] * vectors
        inverted = np.where(values > _DEPENDENT * values[-1], 1 / np.maximum(values, 1e-300), 0.0)
        found = vectors @ (inverted * (vectors.T @ onto[kept]))
        fair = (found >= 0) | (kept < _GROUND)
        if fair.all():
            factors[kept] = found
            inverse[np.ix_(kept, kept)] = (vectors * inverted) @ vectors.T
            return factors, inverse
        kept = np.delete(kept, np.argmin(np.where(fair, 0, found)))


def _with_ground(window: Window, sharp: np.ndarray, blur: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    """Return what is seen of the balls, blurred, after the ground's three parts: (b, 3 + 2 n, h, w)."""
    height, width = window.values.shape
    parts = np.empty((len(sharp), _GROUND + sharp.shape[1], height, width))
    parts[:, _GROUND:] = blur[0] @ sharp @ blur[1].T
    # evenly bright parts come first of each ball's
    parts[:, 0] = 1 - parts[:, _GROUND::_PARTS].sum(axis=1)
    parts[:, 1] = (np.arange(width) + 0.5 - width / 2) / width
    parts[:, 2] = ((np.arange(height) + 0.5 - height / 2) / height)[:, None]
    return parts


def _blur(window: Window, unknowns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return what pixels down and across see of the samples, after the blur."""
    down, across = (_blurred_pixels(side, window.samples, float(np.exp(unknowns[0]))) for side in window.values.shape)
    return down, across


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


def _sharp(window: Window, tried: np.ndarray) -> np.ndarray:
    """Return what is seen of each ball, evenly bright and lit, before the blur: (b, 2 n, h samples, w samples).

    `tried` (b, unknowns).
    """
    light = np.concatenate([tried[:, 1:SHARED], np.ones((len(tried), 1))], axis=1)
    light /= np.linalg.norm(light, axis=1, keepdims=True)
    balls, way = window.balls(tried), tried[:, SHARED : window.shared]
    if not way.size:
        return _at_rest(window, balls, light)
    stops = (np.arange(_STOPS) + 0.5) / _STOPS - 0.5
    moved = np.repeat(balls[:, None], _STOPS, axis=1)
    moved[..., :2] += (stops[:, None] * way[:, None])[:, :, None]
    parts = _at_rest(window, moved.reshape(-1, *balls.shape[1:]), np.repeat(light, _STOPS, axis=0))
    return parts.reshape(len(tried), _STOPS, *parts.shape[1:]).mean(axis=1)


def _at_rest(window: Window, balls: np.ndarray, light: np.ndarray) -> np.ndarray:
    """Return the same of balls (b, n, 3) that do not move; light (b, 3)."""
    samples = window.samples
    fine = np.array(window.values.shape) * samples
    seen, parts = None, np.zeros((len(balls), _PARTS * balls.shape[1], *fine))
    # half the sides of the rectangle around an outline of radius 1
    sides = np.linalg.norm(np.linalg.inv(window.back), axis=1)
    light_x, light_y, light_z = light.T[:, :, None, None]
    for number in range(balls.shape[1]):
        places, radius = balls[:, number, 1::-1], np.exp(balls[:, number, 2, None])
        reach = radius * sides[::-1] + 1.0
        low, high = (places - reach).min(axis=0), (places + reach).max(axis=0)
        low, high = (np.clip((end * samples).astype(int), 0, fine) for end in (low, high))
        part = np.s_[:, low[0] : high[0], low[1] : high[1]]
        below, aside = (
            ((np.arange(low[way], high[way]) + 0.5) / samples - places[:, way, None]) / radius for way in (0, 1)
        )
        x, y = (way[0] * aside[:, None] + way[1] * below[:, :, None] for way in window.back)
        squared = x * x + y * y
        inside = np.clip((1 - np.sqrt(squared)) * (radius[..., None] * samples) + 0.5, 0, 1)
        lit = np.maximum(light_x * x + light_y * y + light_z * np.sqrt(np.maximum(1 - squared, 0)), 0)
        if balls.shape[1] > 1:
            seen = np.ones((len(balls), *fine)) if seen is None else seen
            hides = inside
            inside = inside * seen[part]
            seen[part] *= 1 - hides
        parts[:, _PARTS * number][part], parts[:, _PARTS * number + 1][part] = inside, lit * inside
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
