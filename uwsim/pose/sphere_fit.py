"""Centre of a sphere's outline by a fit of its whole picture: a shaded disc with a blurred edge on a sloping ground.

The picture is  b0 + b1 x + b2 y + edge(x, y) sum_k a_k Y_k(n),  n the normal of a sphere under the pixel. Y_k are
products of the normal's parts: a matt sphere under any far light is near to a sum of those up to the second order, also
with its dark side in sight, and one that shines by itself is Y_0 alone. So light from one side shifts the brightness
and not the centre. The edge is the integral of a Gaussian; its width is part of the fit, as is the radius. The factors
a_k, b_k follow from the other four by linear least squares (variable projection), and the covariance of the centre is
that with all of them unknown.
"""

from typing import NamedTuple

import numpy as np

_SHARPEST_PX, _BLUNTEST = 0.3, 1.0
"""Of the edge's blur: a pixel's own width, and one radius."""
_SECOND_ORDER_FROM_PX = 4.0
"""Radius from which a disc has pixels enough for shading of the second order."""
_REACH_PX, _REACH = 3.0, 1.5
_LEAST_SPARE = 8
_OUTLIER_SDS = 4.0
_ROUNDS = 3
_STEP = 1e-4


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


class _Pixels(NamedTuple):
    """Places (N, 2) [px], values (N,) and weights (N,) of the pixels that take part; shape (2, 2) of the outline."""

    places: np.ndarray
    values: np.ndarray
    weights: np.ndarray
    back: np.ndarray


def fit_sphere(
    grey: np.ndarray, usable: np.ndarray, *, centre_px: np.ndarray, radius_px: float, shape: np.ndarray
) -> Fit | None:
    """Return the fit to a linear picture (H, W) from a rough centre and radius; None where there is no such disc.

    `usable` (H, W) bool leaves out pixels that are saturated or belong to something else. `shape` (2, 2), of
    determinant 1: the outline is the circle of `radius_px` times it. Noise is taken as independent from pixel to pixel,
    of a variance that grows linearly with the light; both of its numbers are found from the residuals.

    Source: Basri and Jacobs, PAMI 25(2), 2003 (shading of matt bodies); Golub and Pereyra, SIAM J. Numer. Anal. 10(2),
    1973 (variable projection).
    """
    pixels = _window(grey, usable, centre_px, radius_px, np.linalg.inv(shape))
    order = 2 if radius_px >= _SECOND_ORDER_FROM_PX else 1
    unknowns = np.array([*centre_px, np.log(radius_px), np.log(max(0.3 * radius_px, 0.7))])
    for _ in range(_ROUNDS):
        if np.count_nonzero(pixels.weights > 0) < 4 + len(_factors(order)) + 3 + _LEAST_SPARE:
            return None
        unknowns = _solved(pixels, unknowns, order, centre_px, radius_px)
        if unknowns is None:
            return None
        model, _ = _model(pixels, unknowns, order)
        pixels = pixels._replace(weights=_weights(pixels, model))
    return _described(pixels, unknowns, order)


def _window(grey, usable, centre_px, radius_px: float, back: np.ndarray) -> _Pixels:
    height, width = grey.shape
    reach = _REACH * radius_px + _REACH_PX
    low = np.maximum(np.floor(centre_px - reach).astype(int), 0)
    high = np.minimum(np.ceil(centre_px + reach).astype(int), [width, height])
    rows, columns = np.mgrid[low[1] : high[1], low[0] : high[0]]
    places = np.stack([columns.ravel(), rows.ravel()], axis=-1) + 0.5
    inside = np.linalg.norm((places - centre_px) @ back.T, axis=1) <= reach
    inside &= usable[rows.ravel(), columns.ravel()]
    values = np.asarray(grey[rows.ravel(), columns.ravel()][inside], float)
    return _Pixels(places[inside], values, np.ones(len(values)), back)


def _factors(order: int) -> list[tuple[int, int, int]]:
    """Return the exponents of the normal's parts in each factor of the shading."""
    first = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]
    return first if order < 2 else [*first, (1, 1, 0), (1, 0, 1), (0, 1, 1), (2, 0, 0), (0, 2, 0)]


def _basis(pixels: _Pixels, unknowns: np.ndarray, order: int) -> tuple[np.ndarray, int]:
    """Return the parts (N, k) that the picture is a sum of, the ground's three first, and how many these are."""
    from scipy.special import ndtr

    radius, blur = np.exp(unknowns[2:])
    aside = (pixels.places - unknowns[:2]) @ pixels.back.T / radius
    distance = np.linalg.norm(aside, axis=1)
    edge = ndtr((1 - distance) * radius / blur)
    # beyond the outline light of the rim is smeared
    across = aside / np.maximum(distance, 1.0)[:, None]
    normal = np.column_stack([across, np.sqrt(np.clip(1 - (across**2).sum(axis=1), 0, None))])
    shading = [np.prod(normal ** np.array(powers), axis=1) for powers in _factors(order)]
    far = (pixels.places - pixels.places.mean(axis=0)) / radius
    ground = [np.ones(len(far)), far[:, 0], far[:, 1]]
    return np.column_stack([*ground, *(edge * one for one in shading)]), len(ground)


def _model(pixels: _Pixels, unknowns: np.ndarray, order: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the picture (N,) that fits best with these four unknowns, and its ground (N,)."""
    basis, of_ground = _basis(pixels, unknowns, order)
    scale = np.sqrt(pixels.weights)
    # near to dependent parts (a small disc's) share what they explain
    factors = np.linalg.lstsq(scale[:, None] * basis, scale * pixels.values, rcond=1e-6)[0]
    return basis @ factors, basis[:, :of_ground] @ factors[:of_ground]


def _residuals(pixels: _Pixels, unknowns: np.ndarray, order: int) -> np.ndarray:
    return np.sqrt(pixels.weights) * (_model(pixels, unknowns, order)[0] - pixels.values)


def _solved(pixels: _Pixels, unknowns, order: int, centre_px, radius_px: float) -> np.ndarray | None:
    from scipy.optimize import least_squares

    reach = max(radius_px, 2.0)
    low = np.array([*(centre_px - reach), np.log(radius_px / 2), np.log(_SHARPEST_PX)])
    high = np.array([*(centre_px + reach), np.log(2 * radius_px), np.log(max(_BLUNTEST * radius_px, 2.0))])
    found = least_squares(
        lambda tried: _residuals(pixels, tried, order), np.clip(unknowns, low + 1e-6, high - 1e-6),
        bounds=(low, high), x_scale=[0.1 * radius_px, 0.1 * radius_px, 0.1, 0.3], xtol=1e-6, ftol=1e-9, max_nfev=40,
    )  # fmt: skip
    on_limit = np.any(np.abs(found.x[:3] - low[:3]) < 1e-3) or np.any(np.abs(found.x[:3] - high[:3]) < 1e-3)
    return None if on_limit or not np.all(np.isfinite(found.x)) else found.x


def _weights(pixels: _Pixels, model: np.ndarray) -> np.ndarray:
    """Return 1 / variance, relative, of a variance linear in the light; 0 for pixels that the model is far off."""
    from scipy.optimize import nnls

    squares = (pixels.values - model) ** 2
    used = pixels.weights > 0
    light = np.clip(model, 0, None)
    typical = max(squares[used].mean(), 1e-300)
    parts = np.column_stack([np.ones(len(light)), light / max(light.max(), 1e-300)])
    found, _ = nnls(parts[used], np.minimum(squares, 16 * typical)[used] / typical)
    variance = np.maximum(parts @ found, 0.02 * found.sum() + 1e-12)
    far_off = squares > _OUTLIER_SDS**2 * variance * typical
    return np.where(far_off, 0.0, variance.mean() / variance)


def _described(pixels: _Pixels, unknowns: np.ndarray, order: int) -> Fit | None:
    residuals = _residuals(pixels, unknowns, order)
    slope = np.empty((len(residuals), 4))
    for place in range(4):
        step = np.zeros(4)
        step[place] = _STEP
        ahead, behind = (_residuals(pixels, unknowns + way * step, order) for way in (1, -1))
        slope[:, place] = (ahead - behind) / (2 * _STEP)
    model, ground = _model(pixels, unknowns, order)
    used = pixels.weights > 0
    spare = np.count_nonzero(used) - 4 - len(_factors(order)) - 3
    if spare <= 0 or np.linalg.cond(slope) > 1e8:
        return None
    covariance = np.linalg.inv(slope.T @ slope) * (residuals @ residuals) / spare
    radius = float(np.exp(unknowns[2]))
    inside = np.linalg.norm((pixels.places - unknowns[:2]) @ pixels.back.T, axis=1) <= radius
    about = pixels.values - ground
    explained = 1 - np.sum((pixels.values - model)[used] ** 2) / max(np.sum(about[used] ** 2), 1e-300)
    contrast = float((model - ground)[inside].mean()) if inside.any() else 0.0
    return Fit(unknowns[:2].copy(), covariance[:2, :2], radius, contrast, float(explained))
