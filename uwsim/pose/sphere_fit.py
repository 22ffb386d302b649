"""Centre of a sphere's outline by a fit of its whole picture: a lit ball, blurred, on a sloping ground.

The picture is  b0 + b1 x + b2 y + blur(a0 [inside] + a1 max(0, n.l) [inside]),  n the normal of the sphere under the
pixel, l the direction of the light: a matt sphere under a far lamp, its dark side included, and one that shines by
itself. So light from one side shifts the brightness and not the centre. Blur is a Gaussian and the pixel's own area.
Centre, radius, width of the blur and direction of the light are sought; a0, a1, b0, b1, b2 follow from them by linear
least squares (variable projection), and the covariance of the centre is that with all of them unknown.
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
_ROUNDS = 3
_SAMPLES_PER_RADIUS = 20
_MOST_SAMPLES = 4
_CORRELATED_PX = 3
"""Lags up to which residuals are taken for correlated."""
_STEP = 0.01
_UNKNOWNS, _FACTORS = 6, 5


class Fit(NamedTuple):
    """Middle (2,) of the outline [px], its covariance (2, 2) [px^2], radius [px], and how well it stands out.

    `contrast`: mean brightness above the ground; `explained`: share of the variance about the ground that the model
    explains.
    """

    centre_px: np.ndarray
    covariance_px2: np.ndarray
    radius_px: float
    contrast: float
    explained: float


class _Window(NamedTuple):
    """A cut-out: its first column and row, values (h, w), weights (h, w), back: picture to outline (2, 2), samples."""

    first: np.ndarray
    values: np.ndarray
    weights: np.ndarray
    back: np.ndarray
    samples: int


def fit_sphere(
    grey: np.ndarray, usable: np.ndarray, saturated: np.ndarray, *, centre_px: np.ndarray, radius_px: float,
    shape: np.ndarray,
) -> Fit | None:  # fmt: skip
    """Return the fit to a linear picture (H, W) from a rough centre and radius; None where there is no such disc.

    `usable` (H, W) bool leaves out pixels that belong to something else; `saturated` (H, W) bool are at least as bright
    as they are: the model may be brighter there at no cost. `shape` (2, 2), of determinant 1: the outline is the circle
    of `radius_px` times it. Noise is taken as independent from pixel to pixel; what its variance is made of
    (`_weights`) is found from the residuals.

    Source: Golub and Pereyra, SIAM J. Numer. Anal. 10(2), 1973 (variable projection); the picture is this project's.
    """
    window = _cut(grey, usable, centre_px, radius_px, np.linalg.inv(shape))
    high = _cut(saturated, usable, centre_px, radius_px, window.back).values > 0
    fair = window.weights
    window = window._replace(weights=np.where(high, 0.0, fair))
    unknowns = np.array([*centre_px, np.log(radius_px), np.log(max(0.2 * radius_px, 0.6)), 0.0, 0.0])
    noise = 1.0
    for _ in range(_ROUNDS):
        if np.count_nonzero(window.weights) < _UNKNOWNS + _FACTORS + _LEAST_SPARE:
            return None
        noise = _noise(window, unknowns)
        unknowns = _solved(window, unknowns, noise, centre_px, radius_px)
        if unknowns is None:
            return None
        model = _model(window, unknowns)[0]
        # saturated pixels that the model has brighter agree with it
        window = window._replace(weights=np.where(high & (model >= window.values), 0.0, fair))
        window = window._replace(weights=_weights(window, model))
    return _described(window, unknowns)


def _cut(grey, usable, centre_px, radius_px: float, back: np.ndarray) -> _Window:
    height, width = grey.shape
    reach = _REACH * radius_px + _REACH_PX
    low = np.maximum(np.floor(centre_px - reach).astype(int), 0)
    high = np.minimum(np.ceil(centre_px + reach).astype(int), [width, height])
    part = np.s_[low[1] : high[1], low[0] : high[0]]
    rows, columns = np.mgrid[part] + 0.5
    aside = np.stack([columns, rows], axis=-1) - centre_px
    inside = (np.linalg.norm(aside @ back.T, axis=-1) <= reach) & usable[part]
    samples = int(np.clip(np.ceil(_SAMPLES_PER_RADIUS / radius_px), 1, _MOST_SAMPLES))
    return _Window(low, np.asarray(grey[part], float), inside.astype(float), back, samples)


def _basis(window: _Window, unknowns: np.ndarray) -> np.ndarray:
    """Return the parts (h, w, 5) that the picture is a sum of, the ground's three first."""
    import cv2

    (height, width), samples = window.values.shape, window.samples
    radius, blur = np.exp(unknowns[2:4])
    columns = window.first[0] + (np.arange(width * samples) + 0.5) / samples - unknowns[0]
    rows = window.first[1] + (np.arange(height * samples) + 0.5) / samples - unknowns[1]
    x, y = ((way[0] * columns[None, :] + way[1] * rows[:, None]) / radius for way in window.back)
    distance = np.sqrt(x * x + y * y)
    inside = np.clip((1 - distance) * radius * samples + 0.5, 0, 1)
    z = np.sqrt(np.clip(1 - distance * distance, 0, None))
    light = np.array([unknowns[4], unknowns[5], 1.0])
    light /= np.linalg.norm(light)
    lit = inside * np.clip(light[0] * x + light[1] * y + light[2] * z, 0, None)
    fine = cv2.GaussianBlur(np.stack([inside, lit], axis=-1), (0, 0), float(blur * samples),
                            borderType=cv2.BORDER_CONSTANT)  # fmt: skip
    discs = fine.reshape(height, samples, width, samples, 2).mean(axis=(1, 3))
    across = np.broadcast_to((np.arange(width) + 0.5 - width / 2) / width, (height, width))
    down = np.broadcast_to(((np.arange(height) + 0.5 - height / 2) / height)[:, None], (height, width))
    return np.stack([np.ones((height, width)), across, down, discs[..., 0], discs[..., 1]], axis=-1)


def _model(window: _Window, unknowns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the picture (h, w) that fits best with these unknowns, and its ground (h, w)."""
    basis = _basis(window, unknowns)
    used = window.weights > 0
    scale = np.sqrt(window.weights[used])
    parts, values = scale[:, None] * basis[used], scale * window.values[used]
    # near to dependent parts share what they explain; no part takes light away
    factors = np.linalg.lstsq(parts, values, rcond=1e-6)[0]
    for place in (3, 4):
        if factors[place] < 0:
            kept = [other for other in range(_FACTORS) if other != place]
            factors = np.zeros(_FACTORS)
            factors[kept] = np.linalg.lstsq(parts[:, kept], values, rcond=1e-6)[0]
    return basis @ factors, basis[..., :3] @ factors[:3]


def _residuals(window: _Window, unknowns: np.ndarray, noise: float) -> np.ndarray:
    """Return residuals in standard deviations, those of the light's direction last."""
    used = window.weights > 0
    off = np.sqrt(window.weights[used]) * (_model(window, unknowns)[0] - window.values)[used]
    return np.append(off / noise, unknowns[4:] / _LIGHT_SD)


def _noise(window: _Window, unknowns: np.ndarray) -> float:
    """Return the standard deviation of the weighted residuals."""
    used = window.weights > 0
    off = np.sqrt(window.weights[used]) * (_model(window, unknowns)[0] - window.values)[used]
    return float(max(np.sqrt(off @ off / max(len(off) - _UNKNOWNS - _FACTORS, 1)), 1e-9))


def _solved(window: _Window, unknowns, noise: float, centre_px, radius_px: float) -> np.ndarray | None:
    from scipy.optimize import least_squares

    reach = max(radius_px, 2.0)
    low = np.array([*(centre_px - reach), np.log(radius_px / 2), np.log(_SHARPEST_PX), -_MOST_LIGHT, -_MOST_LIGHT])
    high = np.array([*(centre_px + reach), np.log(2 * radius_px), np.log(max(_BLUNTEST * radius_px, 2.0)),
                     _MOST_LIGHT, _MOST_LIGHT])  # fmt: skip
    found = least_squares(
        lambda tried: _residuals(window, tried, noise), np.clip(unknowns, low + 1e-6, high - 1e-6),
        jac=lambda tried: _slope(window, tried, noise),
        bounds=(low, high), x_scale=[0.1 * radius_px, 0.1 * radius_px, 0.1, 0.3, 0.3, 0.3],
        xtol=1e-4, ftol=1e-5, max_nfev=15,
    )  # fmt: skip
    on_limit = np.any(np.abs(found.x[:3] - low[:3]) < 1e-3) or np.any(np.abs(found.x[:3] - high[:3]) < 1e-3)
    return None if on_limit or not np.all(np.isfinite(found.x)) else found.x


def _slope(window: _Window, unknowns: np.ndarray, noise: float) -> np.ndarray:
    here = _residuals(window, unknowns, noise)
    steps = _STEP * np.eye(_UNKNOWNS)
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


def _described(window: _Window, unknowns: np.ndarray) -> Fit | None:
    used = window.weights > 0
    if np.count_nonzero(used) < _UNKNOWNS + _FACTORS + _LEAST_SPARE:
        return None
    slope = _slope(window, unknowns, _noise(window, unknowns))
    if np.linalg.cond(slope) > 1e8:
        return None
    model, ground = _model(window, unknowns)
    covariance = np.linalg.inv(slope.T @ slope) * _correlation(np.sqrt(window.weights) * (window.values - model), used)
    radius = float(np.exp(unknowns[2]))
    rows, columns = np.mgrid[: model.shape[0], : model.shape[1]] + 0.5
    aside = np.stack([columns, rows], axis=-1) + window.first - unknowns[:2]
    inside = np.linalg.norm(aside @ window.back.T, axis=-1) <= radius
    about = (window.values - ground)[used]
    explained = 1 - np.sum((window.values - model)[used] ** 2) / max(about @ about, 1e-300)
    contrast = float((model - ground)[inside].mean()) if inside.any() else 0.0
    return Fit(unknowns[:2].copy(), covariance[:2, :2], radius, contrast, float(explained))
