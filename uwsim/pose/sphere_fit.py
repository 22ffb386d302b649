"""Centres of spheres' outlines by a fit of their whole picture: lit balls, blurred, on a sloping ground.

The picture is  b0 + b1 x + b2 y + blur(sum of (a0 [inside] + a1 max(0, n.l) [inside]) [not inside one in front]),  n
the normal of the sphere under the pixel, l the direction of the light: a matt sphere under a far lamp, its dark side
included, and one that shines by itself. So light from one side shifts the brightness and not the centre, and a sphere
that is partly hidden by another has the centre of what can be seen of its outline. Blur is a Gaussian and the pixel's
own area. Centres, radii, width of the blur and direction of the light are sought; the a and b follow from them by
linear least squares (variable projection), and the covariance of a centre is that with all others unknown.
"""

from typing import NamedTuple

import numpy as np

from uwsim.pose.correlated import sum_along_line

_SHARPEST_PX, _BLUNTEST = 0.12, 1.0
"""Of the blur: next to none, and one radius."""
_LIGHT_SD = 1.0
"""What is known of the light beforehand: it comes from near the camera, tangents of the angle to its axis so large."""
_MOST_LIGHT = 3.0
_REACH_PX, _REACH = 3.0, 1.5
_LEAST_SPARE = 10
_OUTLIER_SDS = 4.0
_HIDDEN = 0.05
"""Pixels darker than the model by more than about such a share of its brightest are hidden or in shadow."""
_ROUNDS, _HIDDEN_ROUNDS = 3, 2
_LEAST_OPEN = 0.1
_GRID, _SIZES = 5, (0.85, 1.0, 1.15)
_SAMPLES_PER_RADIUS = 20
_MOST_SAMPLES = 4
_CORRELATED_PX = 3
"""Lags up to which residuals are taken for correlated."""
_STEP = 0.01
_SHARED, _WAY, _EACH = 3, 2, 3
"""Unknowns: log of the blur and the light's direction; the way in the exposure if any; of each ball its place and the
log of its radius."""
_STOPS = 8
"""Places on the way."""
_GROUND, _PARTS = 3, 2
_SAME_SIZE_SD = 0.2
"""What is known of balls that hide each other beforehand: logs of their radii differ by so much."""


class Fit(NamedTuple):
    """Middle (2,) of the outline [px], its covariance (2, 2) [px^2], radius [px], and how well it stands out.

    `contrast`: mean brightness above the ground where it is seen; `explained`: share of the variance about the ground
    that the model explains. Of all balls of a fit: `blur_px`, standard deviation of the blur, and `left`, mean
    of what the model leaves (`_loss`), pixels that it is far off included. `seen`: share of the ball that is not hidden;
    `way_px` (2,): the way in the exposure, 0 without one.
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


class _Window(NamedTuple):
    """A cut-out: its first column and row, values (h, w), weights (h, w), back: picture to outline (2, 2), samples."""

    first: np.ndarray
    values: np.ndarray
    weights: np.ndarray
    back: np.ndarray
    samples: int
    shared: int = _SHARED  # unknowns that all balls have in common
    sizes: np.ndarray | None = None  # logs of the radii, where they are known,
    size_sd: float = 0.0  # so well


def fit_spheres(
    grey: np.ndarray, usable: np.ndarray, saturated: np.ndarray, *, centres_px: np.ndarray, radii_px: np.ndarray,
    shape: np.ndarray, within: tuple[np.ndarray, float] | None = None, way_px: np.ndarray | None = None,
    size_sd: float | None = None,
) -> list[Fit] | None:  # fmt: skip
    """Return the fits to a linear picture (H, W) from rough centres (n, 2) and radii (n,); None where there is no disc.

    Balls that come first hide those that follow. `usable` (H, W) bool leaves out pixels that belong to something else;
    `saturated` (H, W) bool are at least as bright as they are: the model may be brighter there at no cost. `shape`
    (2, 2), of determinant 1: the outline is the circle of a radius times it. `within`: middle and radius [px] of the
    disc that is looked at, with a border; default: that around all balls. `way_px` (2,): about the way that all of them
    go in the exposure, drawn out along it; centres are those of its middle. `size_sd`: standard deviation of the log of
    the radii about those given, where they are known; what is darker than the model then counts little from the start,
    for something may hide it. Noise is taken as independent from pixel to
    pixel; what its variance is made of (`_weights`) is found from the residuals.

    Source: Golub and Pereyra, SIAM J. Numer. Anal. 10(2), 1973 (variable projection); the picture is this project's.
    """
    centres, radii = np.reshape(centres_px, (-1, 2)).astype(float), np.reshape(radii_px, -1).astype(float)
    middle, extent = _around(centres, radii) if within is None else within
    window = _cut(grey, usable, middle, extent, np.linalg.inv(shape), radii.min())
    high = _cut(saturated, usable, middle, extent, window.back, radii.min()).values > 0
    fair = window.weights
    window = window._replace(weights=np.where(high, 0.0, fair))
    way = [] if way_px is None else way_px
    window = window._replace(shared=_SHARED + len(way))
    start = np.concatenate([[np.log(max(0.2 * radii.min(), 0.6)), 0, 0], way, *np.c_[centres, np.log(radii)]])
    unknowns = start
    if size_sd is not None:
        window = window._replace(size_sd=size_sd, sizes=np.log(radii))
        for _ in range(_HIDDEN_ROUNDS):
            window = window._replace(weights=np.where(high, 0.0, fair) * _open(window, unknowns, fair))
            if np.count_nonzero(window.weights) < _freedoms(window, unknowns) + _LEAST_SPARE:
                return None
            unknowns = _solved(window, unknowns, _noise(window, unknowns), start)
            if unknowns is None:
                return None
    for _ in range(_ROUNDS):
        if np.count_nonzero(window.weights) < _freedoms(window, unknowns) + _LEAST_SPARE:
            return None
        noise = _noise(window, unknowns)
        unknowns = _solved(window, unknowns, noise, start)
        if unknowns is None:
            return None
        model = _model(window, unknowns)[0]
        # saturated pixels that the model has brighter agree with it
        agreed = np.where(high & (model >= window.values), 0.0, fair)
        if size_sd is not None:
            agreed = agreed * (_open(window, unknowns, fair) > _LEAST_OPEN)
        window = window._replace(weights=agreed)
        window = window._replace(weights=_weights(window, model))
    return _described(window, unknowns, fair=np.where(high & (model >= window.values), 0.0, fair))


def places_of_part(
    grey: np.ndarray, usable: np.ndarray, *, centre_px: np.ndarray, radius_px: float, blur_px: float,
    shape: np.ndarray, count: int,
) -> np.ndarray:  # fmt: skip
    """Return the rough centres (count, 2) of balls of about a radius of which a part is seen near a place.

    Those on a grid around the place whose pictures leave the least (`_loss`), what is darker counting little.
    """
    window = _cut(grey, usable, centre_px, 2.0 * radius_px, np.linalg.inv(shape), radius_px)._replace(samples=1)
    fair = window.weights
    steps = radius_px * np.arange(-_GRID, _GRID + 1) / _GRID
    found = []
    for x in steps:
        for y in steps:
            if np.hypot(x, y) > 1.01 * radius_px:
                continue
            for size in _SIZES:
                tried = np.array([np.log(blur_px), 0, 0, *(centre_px + [x, y]), np.log(size * radius_px)])
                window = window._replace(weights=fair)
                window = window._replace(weights=fair * _open(window, tried, fair))
                found.append((_loss(window, *_model(window, tried), fair), *tried[3:5]))
    best = sorted(found)
    apart: list[np.ndarray] = []
    for _, *place in best:
        if all(np.linalg.norm(place - other) > 1.5 * radius_px / _GRID for other in apart):
            apart.append(np.array(place))
        if len(apart) == count:
            break
    return np.array(apart)


def _open(window: _Window, unknowns: np.ndarray, fair: np.ndarray) -> np.ndarray:
    """Return weights (h, w): small where the picture is much darker than the model, 1 elsewhere."""
    model, ground = _model(window, unknowns)
    bright = max(float((model - ground)[fair > 0].max()), 1e-12)
    below = np.clip(model - window.values, 0, None) / (_HIDDEN * bright)
    return 1 / (1 + below**2) ** 2


def _loss(window: _Window, model: np.ndarray, ground: np.ndarray, fair: np.ndarray) -> float:
    """Return the mean square of residuals, those of pixels darker than the model counted up to a limit."""
    limit = _HIDDEN * max(float((model - ground)[fair > 0].max()), 1e-12)
    off = window.values - model
    squares = np.where(off > 0, off**2, off**2 * limit**2 / (off**2 + limit**2))
    return float(np.average(squares, weights=fair))


def _around(centres: np.ndarray, radii: np.ndarray) -> tuple[np.ndarray, float]:
    """Return the middle and the radius of a disc around discs (two at most touch it)."""
    middle = centres.mean(axis=0)
    return middle, float(np.max(np.linalg.norm(centres - middle, axis=1) + radii))


def _freedoms(window: _Window, unknowns: np.ndarray) -> int:
    return len(unknowns) + _GROUND + _PARTS * len(_balls(window, unknowns))


def _balls(window: _Window, unknowns: np.ndarray) -> np.ndarray:
    """Return place and log of the radius of each ball, (n, 3)."""
    return unknowns[window.shared :].reshape(-1, _EACH)


def _cut(grey, usable, centre_px, radius_px: float, back: np.ndarray, least_px: float) -> _Window:
    height, width = grey.shape
    reach = radius_px + (_REACH - 1) * least_px + _REACH_PX
    low = np.maximum(np.floor(centre_px - reach).astype(int), 0)
    high = np.minimum(np.ceil(centre_px + reach).astype(int), [width, height])
    part = np.s_[low[1] : high[1], low[0] : high[0]]
    rows, columns = np.mgrid[part] + 0.5
    aside = np.stack([columns, rows], axis=-1) - centre_px
    inside = (np.linalg.norm(aside @ back.T, axis=-1) <= reach) & usable[part]
    samples = int(np.clip(np.ceil(_SAMPLES_PER_RADIUS / least_px), 1, _MOST_SAMPLES))
    return _Window(low, np.asarray(grey[part], float), inside.astype(float), back, samples)


def _basis(window: _Window, unknowns: np.ndarray) -> np.ndarray:
    """Return the parts (h, w, 3 + 2 n) that the picture is a sum of, the ground's three first."""
    import cv2

    (height, width), samples = window.values.shape, window.samples
    light = np.array([*unknowns[1:_SHARED], 1.0])
    light /= np.linalg.norm(light)
    way = unknowns[_SHARED : window.shared]
    stops = np.outer((np.arange(_STOPS) + 0.5) / _STOPS - 0.5, way) if len(way) else np.zeros((1, 2))
    parts = np.mean([_sharp(window, _balls(window, unknowns) + [*stop, 0], light) for stop in stops], axis=0)
    fine = [cv2.GaussianBlur(part, (0, 0), float(np.exp(unknowns[0]) * samples), borderType=cv2.BORDER_CONSTANT)
            for part in parts]  # fmt: skip
    discs = np.stack(fine, axis=-1).reshape(height, samples, width, samples, len(parts)).mean(axis=(1, 3))
    across = np.broadcast_to((np.arange(width) + 0.5 - width / 2) / width, (height, width))
    down = np.broadcast_to(((np.arange(height) + 0.5 - height / 2) / height)[:, None], (height, width))
    return np.concatenate([np.stack([np.ones((height, width)), across, down], axis=-1), discs], axis=-1)


def _sharp(window: _Window, balls: np.ndarray, light: np.ndarray) -> list[np.ndarray]:
    """Return what is seen of each ball, evenly bright and lit, on the grid of samples."""
    (height, width), samples = window.values.shape, window.samples
    seen, parts = np.ones((height * samples, width * samples)), []
    for column, row, log_radius in balls:
        radius = np.exp(log_radius)
        columns = window.first[0] + (np.arange(width * samples) + 0.5) / samples - column
        rows = window.first[1] + (np.arange(height * samples) + 0.5) / samples - row
        x, y = ((way[0] * columns[None, :] + way[1] * rows[:, None]) / radius for way in window.back)
        distance = np.sqrt(x * x + y * y)
        inside = np.clip((1 - distance) * radius * samples + 0.5, 0, 1)
        z = np.sqrt(np.clip(1 - distance * distance, 0, None))
        lit = inside * np.clip(light[0] * x + light[1] * y + light[2] * z, 0, None)
        parts += [inside * seen, lit * seen]
        seen = seen * (1 - inside)
    return parts


def _model(window: _Window, unknowns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the picture (h, w) that fits best with these unknowns, and its ground (h, w)."""
    basis = _basis(window, unknowns)
    used = window.weights > 0
    scale = np.sqrt(window.weights[used])
    parts, values = scale[:, None] * basis[used], scale * window.values[used]
    kept = np.arange(basis.shape[-1])
    while True:
        # near to dependent parts share what they explain; no part takes light away
        found = np.linalg.lstsq(parts[:, kept], values, rcond=1e-6)[0]
        fair = (found >= 0) | (kept < _GROUND)
        if fair.all():
            break
        kept = np.delete(kept, np.argmin(np.where(fair, 0, found)))
    factors = np.zeros(basis.shape[-1])
    factors[kept] = found
    return basis @ factors, basis[..., :_GROUND] @ factors[:_GROUND]


def _residuals(window: _Window, unknowns: np.ndarray, noise: float) -> np.ndarray:
    """Return residuals in standard deviations, those of the light's direction and of the sizes last."""
    used = window.weights > 0
    off = np.sqrt(window.weights[used]) * (_model(window, unknowns)[0] - window.values)[used]
    sizes = _balls(window, unknowns)[:, 2]
    known = [] if window.sizes is None else (sizes - window.sizes) / window.size_sd
    alike = (sizes - sizes.mean())[: len(sizes) - 1] / _SAME_SIZE_SD
    return np.concatenate([off / noise, unknowns[1:_SHARED] / _LIGHT_SD, alike, known])


def _noise(window: _Window, unknowns: np.ndarray) -> float:
    """Return the standard deviation of the weighted residuals."""
    used = window.weights > 0
    off = np.sqrt(window.weights[used]) * (_model(window, unknowns)[0] - window.values)[used]
    return float(max(np.sqrt(off @ off / max(len(off) - _freedoms(window, unknowns), 1)), 1e-9))


def _solved(window: _Window, unknowns, noise: float, start: np.ndarray) -> np.ndarray | None:
    from scipy.optimize import least_squares

    balls = _balls(window, start)
    radii = np.exp(balls[:, 2])
    reach = np.c_[np.maximum(radii, 2.0), np.maximum(radii, 2.0), np.full(len(balls), np.log(2))].ravel()
    bluntest = np.log(max(_BLUNTEST * radii.min(), 2.0))
    # a way turned round is the same
    way = start[_SHARED : window.shared]
    longest = np.full(len(way), 2 * np.linalg.norm(way) + 1)
    low = np.concatenate([[np.log(_SHARPEST_PX), -_MOST_LIGHT, -_MOST_LIGHT], -longest, start[window.shared :] - reach])
    high = np.concatenate([[bluntest, _MOST_LIGHT, _MOST_LIGHT], longest, start[window.shared :] + reach])
    balls_scale = np.c_[0.1 * radii, 0.1 * radii, np.full(len(radii), 0.1)].ravel()
    scale = np.concatenate([[0.3, 0.3, 0.3], np.full(len(way), 0.1 * radii.min()), balls_scale])
    found = least_squares(
        lambda tried: _residuals(window, tried, noise), np.clip(unknowns, low + 1e-6, high - 1e-6),
        jac=lambda tried: _slope(window, tried, noise), bounds=(low, high), x_scale=scale, xtol=1e-4, ftol=1e-5,
        max_nfev=15,
    )  # fmt: skip
    to_limit = np.minimum(found.x - low, high - found.x)[window.shared :]
    return None if to_limit.min() < 1e-3 or not np.all(np.isfinite(found.x)) else found.x


def _slope(window: _Window, unknowns: np.ndarray, noise: float) -> np.ndarray:
    here = _residuals(window, unknowns, noise)
    steps = _STEP * np.eye(len(unknowns))
    return np.stack([(_residuals(window, unknowns + step, noise) - here) / _STEP for step in steps], axis=-1)


def _weights(window: _Window, model: np.ndarray) -> np.ndarray:
    """Return 1 / variance, relative; 0 for pixels that the model is far off.

    The variance is a sum of a constant, a share of the light (photons) and a share of the squared slope: at an edge a
    picture is off by what its blur is not quite a Gaussian, a rendered one by its samples.
    """
    from scipy.optimize import nnls

    used = window.weights > 0
    squares = (window.values - model) ** 2
    typical = max(squares[used].mean(), 1e-300)
    light = np.clip(model, 0, None) / max(model[used].max(), 1e-300)
    down, across = np.gradient(model)
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


def _described(window: _Window, unknowns: np.ndarray, *, fair: np.ndarray) -> list[Fit] | None:
    used = window.weights > 0
    if np.count_nonzero(used) < _freedoms(window, unknowns) + _LEAST_SPARE:
        return None
    slope = _slope(window, unknowns, _noise(window, unknowns))
    if np.linalg.cond(slope) > 1e8:
        return None
    model, ground = _model(window, unknowns)
    covariance = np.linalg.inv(slope.T @ slope) * _correlation(np.sqrt(window.weights) * (window.values - model), used)
    rows, columns = np.mgrid[: model.shape[0], : model.shape[1]] + 0.5
    about = (window.values - ground)[used]
    explained = 1 - np.sum((window.values - model)[used] ** 2) / max(about @ about, 1e-300)
    left, clear = _loss(window, model, ground, fair), _open(window, unknowns, fair)
    seen, fits = np.ones(model.shape, bool), []
    for number, (column, row, log_radius) in enumerate(_balls(window, unknowns)):
        aside = np.stack([columns, rows], axis=-1) + window.first - [column, row]
        inside = (np.linalg.norm(aside @ window.back.T, axis=-1) <= np.exp(log_radius)) & seen
        contrast = float((model - ground)[inside].mean()) if inside.any() else 0.0
        own = np.s_[window.shared + _EACH * number : window.shared + _EACH * number + 2]
        fits.append(
            Fit(
                np.array([column, row]), covariance[own, own], float(np.exp(log_radius)), contrast, float(explained),
                float(np.exp(unknowns[0])), left, float(clear[inside].mean()) if inside.any() else 0.0,
                np.resize([*unknowns[_SHARED : window.shared], 0.0, 0.0], 2),
            )
        )  # fmt: skip
        seen &= ~inside
    return fits
