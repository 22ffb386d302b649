"""Centres of spheres' outlines by a fit of their whole picture: lit balls, blurred, on a sloping ground.

With the picture of `sphere_model` light from one side shifts the brightness and not the centre, and a sphere that is
partly hidden by another has the centre of what can be seen of its outline. The covariance of a centre is that with all
others unknown.
"""

from typing import NamedTuple

import numpy as np

from uwsim.pose.correlated import sum_along_line
from uwsim.pose.sphere_model import EACH, SHARED, Window, clear, cut, fitted, loss, model, parts_of, slope

_SHARPEST_PX, _BLUNTEST = 0.12, 1.0
"""Of the blur: next to none, and one radius."""
_LIGHT_SD = 0.3
"""What is known of the light beforehand: it comes from near the camera, tangents of the angle to its axis so large."""
_MOST_LIGHT, _ALIKE_LIGHT_SD = 3.0, 0.1
_LEAST_SPARE = 10
_OUTLIER_SDS = 4.0
_ROUNDS, _HIDDEN_ROUNDS = 3, 2
_LEAST_CLEAR = 0.1
_CORRELATED_PX = 3
"""Lags up to which residuals are taken for correlated."""
_STEP = 0.01
_SAME_SIZE_SD = 0.2
"""What is known of balls that hide each other beforehand: logs of their radii differ by so much."""
PART_WINDOW = 2.0
"""Radii around the middle of a part that the ball may reach to."""
_GRID, _SIZES = 5, (0.85, 1.0, 1.15)
"""Places to a radius, and radii, that are tried for a ball of which a part is seen."""


class Fit(NamedTuple):
    """Middle (2,) of the outline [px], its covariance (2, 2) [px^2], radius [px], and how well it stands out.

    `contrast`: mean brightness above the ground where it is seen; `explained`: share of the variance about the ground
    that the model explains. Of all balls of a fit: `blur_px`, standard deviation of the blur, and `left`, mean
    of what the model leaves (`sphere_model.loss`), pixels that it is far off included. `seen`: share of the ball that
    is not hidden; `way_px` (2,): the way in the exposure, 0 without one; `light` (2,): tangents of the angle that the
    light comes from, to the line of sight, towards +x and +y.
    """

    centre_px: np.ndarray
    covariance_px2: np.ndarray
    radius_px: float
    contrast: float
    explained: float
    blur_px: float
    left: float
    seen: float
    way_px: np.ndarray
    light: np.ndarray


class Alike(NamedTuple):
    """What other balls of the picture tell of one: its radius, `size_sd` that of the log, the light, and the blur."""

    radius_px: float
    light: np.ndarray
    blur_px: float
    size_sd: float = 0.1


def fit_spheres(
    grey: np.ndarray, usable: np.ndarray, saturated: np.ndarray, *, centres_px: np.ndarray, radii_px: np.ndarray,
    shape: np.ndarray, within: tuple[np.ndarray, float] | None = None, way_px: np.ndarray | None = None,
    alike: Alike | None = None,
) -> list[Fit] | None:  # fmt: skip
    """Return the fits to a linear picture (H, W) from rough centres (n, 2) and radii (n,); None where there is no disc.

    Balls that come first hide those that follow. `usable` (H, W) bool leaves out pixels that belong to something else;
    `saturated` (H, W) bool are at least as bright as they are: the model may be brighter there at no cost. `shape`
    (2, 2), of determinant 1: the outline is the circle of a radius times it. `within`: middle and radius [px] of the
    disc that is looked at, with a border; default: that around all balls. `way_px` (2,): about the way that all of them
    go in the exposure, drawn out along it; centres are those of its middle. `alike`: what is known of the balls
    beforehand; what is darker than the model then counts little from the start, for something may hide it. Noise is
    taken as independent from pixel to pixel; what its variance is made of (`_weights`) is found from the residuals.

    Source: Golub and Pereyra, SIAM J. Numer. Anal. 10(2), 1973 (variable projection); the picture is this project's.
    """
    centres, radii = np.reshape(centres_px, (-1, 2)).astype(float), np.reshape(radii_px, -1).astype(float)
    middle, extent = _around(centres, radii) if within is None else within
    window = cut(grey, usable, middle, extent, np.linalg.inv(shape), radii.min())
    high = cut(saturated, usable, middle, extent, window.back, radii.min()).values > 0
    fair = window.weights
    way = [] if way_px is None else way_px
    window = window._replace(weights=np.where(high, 0.0, fair), shared=SHARED + len(way))
    shared = [np.log(max(0.2 * radii.min(), 0.6)), 0, 0] if alike is None else [np.log(alike.blur_px), *alike.light]
    unknowns = start = np.concatenate([shared, way, *np.c_[centres - window.first, np.log(radii)]])
    for number in range(_ROUNDS + (0 if alike is None else _HIDDEN_ROUNDS)):
        if alike is not None and number < _HIDDEN_ROUNDS:
            window = window._replace(weights=np.where(high, 0.0, fair) * clear(window, model(window, unknowns)[0]))
        unknowns = _solved(window, unknowns, alike, start)
        if unknowns is None:
            return None
        picture = model(window, unknowns)[0]
        # saturated pixels that the model has brighter agree with it
        agreed = np.where(high & (picture >= window.values), 0.0, fair)
        if alike is not None:
            agreed = agreed * (clear(window, picture) > _LEAST_CLEAR)
        window = window._replace(weights=_weights(window._replace(weights=agreed), picture))
    return _described(window, unknowns, alike, fair=np.where(high & (picture >= window.values), 0.0, fair))


def places_of_part(
    grey: np.ndarray, usable: np.ndarray, alike: Alike, *, centre_px: np.ndarray, shape: np.ndarray, count: int
) -> np.ndarray:
    """Return the rough centres (count, 2) of balls of about a radius of which a part is seen near a place.

    Those on a grid around the place whose pictures leave the least (`sphere_model.loss`), what is darker counting
    little.
    """
    radius_px = alike.radius_px
    window = cut(grey, usable, centre_px, PART_WINDOW * radius_px, np.linalg.inv(shape), radius_px)
    window, fair = window._replace(samples=1), window.weights
    steps = np.stack(np.meshgrid(*[np.arange(-_GRID, _GRID + 1) / _GRID] * 2), axis=-1).reshape(-1, 2)
    found = []
    for step in steps[np.linalg.norm(steps, axis=1) < 1.01]:
        place = centre_px + radius_px * step
        balls = [[*(place - window.first), np.log(size * radius_px)] for size in _SIZES]
        for parts in parts_of(window, np.array([[np.log(alike.blur_px), *alike.light, *ball] for ball in balls])):
            weighted = window._replace(weights=fair * clear(window, fitted(window, parts)[0]))
            found.append((loss(window, fitted(weighted, parts)[0], fair), *place))
    apart: list[np.ndarray] = []
    for _, *place in sorted(found):
        if all(np.linalg.norm(place - other) > 1.5 * radius_px / _GRID for other in apart):
            apart.append(np.array(place))
    return np.array(apart[:count])


def _around(centres: np.ndarray, radii: np.ndarray) -> tuple[np.ndarray, float]:
    """Return the middle and the radius of a disc around discs (two at most touch it)."""
    middle = centres.mean(axis=0)
    return middle, float(np.max(np.linalg.norm(centres - middle, axis=1) + radii))


def _off(window: Window, unknowns: np.ndarray) -> np.ndarray:
    """Return what the model is brighter, of pixels that count, times the square roots of their weights."""
    used = window.used
    return np.sqrt(window.weights[used]) * (model(window, unknowns)[0] - window.values)[used]


def _known(window: Window, unknowns: np.ndarray, alike: Alike | None) -> np.ndarray:
    """Return how far the light's direction and sizes are from what is known of them, in standard deviations."""
    light, sizes = unknowns[1:SHARED], window.balls(unknowns)[:, 2]
    if alike is None:
        return np.concatenate([light / _LIGHT_SD, (sizes - sizes.mean())[:-1] / _SAME_SIZE_SD])
    return np.concatenate([(light - alike.light) / _ALIKE_LIGHT_SD, (sizes - np.log(alike.radius_px)) / alike.size_sd])


def _residuals(window: Window, unknowns: np.ndarray, alike: Alike | None, noise: float) -> np.ndarray:
    """Return residuals in standard deviations, what is known beforehand last."""
    return np.concatenate([_off(window, unknowns) / noise, _known(window, unknowns, alike)])


def _noise(window: Window, unknowns: np.ndarray) -> float:
    """Return the standard deviation of the weighted residuals."""
    off = _off(window, unknowns)
    return float(max(np.sqrt(off @ off / max(window.spare(unknowns), 1)), 1e-9))


def _solved(window: Window, unknowns: np.ndarray, alike: Alike | None, start: np.ndarray) -> np.ndarray | None:
    from scipy.optimize import least_squares

    if window.spare(unknowns) < _LEAST_SPARE:
        return None
    noise = _noise(window, unknowns)
    balls = window.balls(start)
    radii = np.exp(balls[:, 2])
    reach = np.c_[np.maximum(radii, 2.0), np.maximum(radii, 2.0), np.full(len(balls), np.log(2))].ravel()
    bluntest = np.log(max(_BLUNTEST * radii.min(), 2.0))
    # a way turned round is the same
    way = start[SHARED : window.shared]
    longest = np.full(len(way), 2 * np.linalg.norm(way) + 1)
    low = np.concatenate([[np.log(_SHARPEST_PX), -_MOST_LIGHT, -_MOST_LIGHT], -longest, start[window.shared :] - reach])
    high = np.concatenate([[bluntest, _MOST_LIGHT, _MOST_LIGHT], longest, start[window.shared :] + reach])
    balls_scale = np.c_[0.1 * radii, 0.1 * radii, np.full(len(radii), 0.1)].ravel()
    scale = np.concatenate([[0.3, 0.3, 0.3], np.full(len(way), 0.1 * radii.min()), balls_scale])
    found = least_squares(
        lambda tried: _residuals(window, tried, alike, noise), np.clip(unknowns, low + 1e-6, high - 1e-6),
        jac=lambda tried: _slope(window, tried, alike, noise), bounds=(low, high), x_scale=scale, xtol=1e-3, ftol=3e-4,
        max_nfev=15,
    )  # fmt: skip
    to_limit = np.minimum(found.x - low, high - found.x)[window.shared :]
    return None if to_limit.min() < 1e-3 or not np.all(np.isfinite(found.x)) else found.x


def _slope(window: Window, unknowns: np.ndarray, alike: Alike | None, noise: float) -> np.ndarray:
    """Return the derivatives of `_residuals`; what is known beforehand is linear in the unknowns."""
    here = _known(window, unknowns, alike)
    known = [_known(window, unknowns + one, alike) - here for one in np.eye(len(unknowns))]
    return np.concatenate([slope(window, unknowns, _STEP) / noise, np.transpose(known)])


def _weights(window: Window, picture: np.ndarray) -> np.ndarray:
    """Return 1 / variance, relative; 0 for pixels that the model is far off.

    The variance is a sum of a constant, a share of the light (photons) and a share of the squared slope: at an edge a
    picture is off by what its blur is not quite a Gaussian, a rendered one by its samples.
    """
    from scipy.optimize import nnls

    used = window.used
    squares = (window.values - picture) ** 2
    typical = max(squares[used].mean(), 1e-300)
    light = np.clip(picture, 0, None) / max(picture[used].max(), 1e-300)
    down, across = np.gradient(picture)
    steep = down**2 + across**2
    parts = np.stack([np.ones(light.shape), light, steep / max(steep[used].max(), 1e-300)], axis=-1)
    found, _ = nnls(parts[used], np.minimum(squares, 16 * typical)[used] / typical)
    variance = np.maximum(parts @ found, 0.02 * found.sum() + 1e-12)
    far_off = squares > _OUTLIER_SDS**2 * variance * typical
    return np.where(used & ~far_off, variance[used].mean() / variance, 0.0)


def _correlation(residuals: np.ndarray, used: np.ndarray) -> float:
    """Return the sum of the autocorrelation of residuals (h, w) over all lags, at least 1: variances grow by it.

    It is 1 for noise that is independent from pixel to pixel, more where a picture has been smoothed or restored, and
    where the model leaves a pattern. The larger of the sum over near lags, which misses what the fit has taken up, and
    of that of a Gaussian with the same correlation of neighbours.
    """
    from scipy.signal import fftconvolve

    mask, values = used.astype(float), np.where(used, residuals, 0.0)
    products, pairs = (fftconvolve(part, part[::-1, ::-1]) for part in (values, mask))
    row, column = (side - 1 for side in values.shape)
    means = products / np.maximum(pairs, 1)
    shares = means / max(means[row, column], 1e-300)
    reach = np.s_[
        max(row - _CORRELATED_PX, 0) : row + _CORRELATED_PX + 1,
        max(column - _CORRELATED_PX, 0) : column + _CORRELATED_PX + 1,
    ]
    smooth = np.maximum(sum_along_line(np.array([shares[row + 1, column], shares[row, column + 1]])), 1.0)
    return float(max(shares[reach].sum(), smooth.prod(), 1.0))


def _described(window: Window, unknowns: np.ndarray, alike: Alike | None, *, fair: np.ndarray) -> list[Fit] | None:
    used = window.used
    if window.spare(unknowns) < _LEAST_SPARE:
        return None
    change = _slope(window, unknowns, alike, _noise(window, unknowns))
    if np.linalg.cond(change) > 1e8:
        return None
    picture, ground = model(window, unknowns)
    residuals = np.sqrt(window.weights) * (window.values - picture)
    covariance = np.linalg.inv(change.T @ change) * _correlation(residuals, used)
    about = (window.values - ground)[used]
    explained = 1 - np.sum((window.values - picture)[used] ** 2) / max(about @ about, 1e-300)
    left, open_ = loss(window, picture, fair), clear(window, picture)
    way = unknowns[SHARED : window.shared] if window.shared > SHARED else np.zeros(2)
    seen, fits = np.ones(picture.shape, bool), []
    for number, (column, row, log_radius) in enumerate(window.balls(unknowns)):
        place, radius = np.array([column, row]), float(np.exp(log_radius))
        inside = (np.linalg.norm(window.aside_px(place), axis=-1) <= radius) & seen
        contrast, share = (float(part[inside].mean()) if inside.any() else 0.0 for part in (picture - ground, open_))
        own = slice(window.shared + EACH * number, window.shared + EACH * number + 2)
        fits.append(
            Fit(
                window.first + place, covariance[own, own], radius, contrast, float(explained),
                float(np.exp(unknowns[0])), left,
                share, way, unknowns[1:SHARED],
            )
        )  # fmt: skip
        seen &= ~inside
    return fits
