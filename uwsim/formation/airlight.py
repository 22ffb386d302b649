"""Single-scattered light of a lamp, lamp - particle - camera, along every ray of a view: the true integral.

L(R) = int_0^R E(s) b p(angle) exp(-c (s + path)) ds, with E the lamp's irradiance at the place s of the ray.

Source: Sun et al. 2005, ACM Trans. Graph. 24:1040, for the variable, the angle e at the lamp: s = s_0 + h tan e with h
the distance of the ray from the lamp, ds = (r^2 / h) de, so that the lamp's 1/r^2 cancels. Replaces dissertation eqs.
2.61-2.65 (errata: `uwsim.optics.airlight`).
Valid: single scattering; no shadows of bodies or housings on the water; lamps are points.
"""

from typing import NamedTuple

import numpy as np

from uwsim.formation.light import Lamp
from uwsim.formation.scattering import ScatteringTable
from uwsim.formation.view import View

_ALONG = 2e-4  # error of the pieces of a ray, of its light and _DARK of a bright ray's
_BETWEEN = 3e-4  # error of the interpolation between rays
_DARK = 0.02
_BRIGHT = 0.9  # quantile
_UNEVEN = 1.25
_PANELS = 24
_MOST_PANELS = 768
_CHUNK = 1024  # rays at once
_LEAST_M = 1e-5  # of h: a lamp on the ray itself
_INNER = 0.5 - 0.5 / np.sqrt(5)  # Lobatto's two inner nodes of a panel, from either end
_BISECTIONS = 10


def single(
    view: View, lamp: Lamp, *, spectral: bool = True, panels: int | None = None, stride_px: int | None = None
) -> np.ndarray:
    """Return the band radiance in the water of a lamp's light scattered once, (H, W, 3) float32.

    Not yet times `view.factor`; 0 for pixels without a ray. Without a body the ray ends where the water has taken all
    light. `panels`: pieces of a ray; None: as many as a check on a part of the rays asks for. `stride_px`: size of the
    cells in which the picture is interpolated at first, from 3 x 3 of their rays (None: a twentieth of the picture);
    where a check on two more of them asks for it, cells are divided, down to single pixels (`stride_px` 1: all).
    Method: cumulative integrals by Lobatto's rule in pieces of e (with the edge of a window's beam found), cubic in
    between; h L is quadratic between rays at the same part of e. Error: 1e-3 of the light of a ray (of dark rays: of
    2 % of a bright ray's), a few hundredths of it on average; at the edges of narrow beams up to 3e-3.
    """
    stride_px = max(max(view.shape) // 20, 1) if stride_px is None else stride_px
    if panels is not None and panels < 1 or stride_px < 1:
        raise ValueError(f"airlight: got panels {panels}, stride_px {stride_px}, allowed: at least 1")
    light = np.zeros((view.shape[0] * view.shape[1], 3), np.float32)
    active = view.has_ray.ravel()
    if view.water.scattering.any() and active.any():
        rays = _Rays(view, lamp, ScatteringTable(view, lamp.spectrum, spectral=spectral))
        panels = _enough_panels(rays) if panels is None else panels
        while active.any():
            active = _fill(light, rays, active, panels, stride_px)
            stride_px = max(stride_px // 2, 1)
    return light.reshape(*view.shape, 3)


class Paths(NamedTuple):
    """Cumulative integrals of rays (n): `h_light` (n, P + 1, 3) is h L up to the panels' ends, `slope` its change per
    panel there, `has_edge` (n, P) says in which panels the lamp's light begins or ends."""

    h_light: np.ndarray
    slope: np.ndarray
    has_edge: np.ndarray


class _Rays:
    """The rays of a view as a lamp sees them, numbered row by row."""

    def __init__(self, view: View, lamp: Lamp, scattering: ScatteringTable):
        self.view, self.lamp, self.scattering = view, lamp, scattering
        safe = view.has_ray[..., None]
        self.origins = np.where(safe, view.origins_m, 0.0).reshape(-1, 3)
        self.directions = np.where(safe, view.directions, [0.0, 0.0, 1.0]).reshape(-1, 3)
        self.is_ray = view.has_ray.ravel()
        to_lamp = lamp.apparent_m - self.origins
        self.ahead = np.einsum("ij,ij->i", to_lamp, self.directions)
        across = to_lamp - self.ahead[:, None] * self.directions
        self.h = np.maximum(np.sqrt(np.einsum("ij,ij->i", across, across)), _LEAST_M)
        self.start = np.arctan2(-self.ahead, self.h)
        self.span = np.arctan2(view.decay.reach_m - self.ahead, self.h) - self.start
        self.h32 = self.h.astype(np.float32)
        # how far each ray goes, in the variable in which its panels are equal, 0 ... 1
        range_m = np.minimum(view.range_m, view.decay.reach_m).ravel()
        share = (np.arctan2(range_m - self.ahead, self.h) - self.start) / self.span
        self.part = np.arccos(np.clip(1 - 2 * share, -1, 1)) / np.pi

    def values(self, index: np.ndarray, part: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return d(h L)/d(part) (n, m, 3) at parts (n, m) of rays (n,), and whether the lamp shines there (n, m)."""
        h, ahead = self.h[index, None], self.ahead[index, None]
        angle = self.start[index, None] + self.span[index, None] * (0.5 - 0.5 * np.cos(np.pi * part))
        offset = h * np.tan(angle)
        s = np.maximum(ahead + offset, 0.0)
        per_part = (h * h + offset * offset) * (self.span[index, None] * (np.pi / 2)) * np.sin(np.pi * part)
        points = self.origins[index, None] + s[..., None] * self.directions[index, None]
        came = self.lamp.arriving(points)
        cosine = np.einsum("nmk,nk->nm", came.towards, self.directions[index])
        value = self.scattering(cosine, s + came.path_m)
        value *= (came.irradiance_per_intensity * per_part)[..., None]
        return value, came.irradiance_per_intensity > 0

    def integrate(self, index: np.ndarray, panels: int, *, ends: np.ndarray | None = None) -> Paths:
        """Return the cumulative integrals of rays (n,), up to the parts `ends` (n,); None: 1."""
        edges = np.linspace(0, 1, panels + 1)
        nodes = np.concatenate([(edges[:-1, None] + np.array([0, _INNER, 1 - _INNER]) / panels).ravel(), [1.0]])
        ends = np.ones(len(index)) if ends is None else ends
        parts, width = ends[:, None] * nodes, (ends / panels)[:, None, None]
        value, lit = self.values(index, parts)
        inner = value[:, :-1].reshape(len(index), panels, 3, 3)
        right = value[:, 3::3]
        pieces = (inner[:, :, 0] + right + 5 * (inner[:, :, 1] + inner[:, :, 2])) * (width / 12)
        has_edge = self._mend(pieces, index, parts, lit)
        total = np.concatenate([np.zeros((len(index), 1, 3)), np.cumsum(pieces, axis=1)], axis=1)
        return Paths(total.astype(np.float32), (value[:, ::3] * width).astype(np.float32), has_edge)

    def _mend(self, pieces: np.ndarray, index: np.ndarray, parts: np.ndarray, lit: np.ndarray) -> np.ndarray:
        """Integrate panels anew in which the lamp's light begins or ends, from that place on; return which."""
        has_edge = np.zeros(pieces.shape[:2], bool)
        ray, node = np.nonzero(lit[:, 1:] != lit[:, :-1])
        if len(ray) == 0:
            return has_edge
        low, high, begins = parts[ray, node], parts[ray, node + 1], lit[ray, node + 1]
        rays, panel = index[ray], node // 3
        for _ in range(_BISECTIONS):
            middle = (low + high) / 2
            after = self.values(rays, middle[:, None])[1][:, 0] == begins
            low, high = np.where(after, low, middle), np.where(after, middle, high)
        first = np.where(begins, high, parts[ray, 3 * panel])
        last = np.where(begins, parts[ray, 3 * panel + 3], low)
        places = first[:, None] + (last - first)[:, None] * np.array([0, _INNER, 1 - _INNER, 1])
        value = self.values(rays, places)[0]
        pieces[ray, panel] = np.einsum("nmk,m->nk", value, [1 / 12, 5 / 12, 5 / 12, 1 / 12]) * (last - first)[:, None]
        has_edge[ray, panel] = True
        return has_edge


def _enough_panels(rays: _Rays) -> int:
    """Return a number of panels twice as many of which change no integral of some rays all over the view."""
    numbers = np.nonzero(rays.is_ray)[0]
    some = numbers[np.unique(np.linspace(0, len(numbers) - 1, 48).round().astype(int))]
    nearest = numbers[np.argsort(rays.h[numbers], kind="stable")[:16]]
    some = np.union1d(some, nearest)
    panels = _PANELS
    before = rays.integrate(some, panels).h_light
    while panels < _MOST_PANELS:
        after = rays.integrate(some, 2 * panels).h_light[:, ::2]
        allowed = after[:, -1:] + _DARK * np.quantile(after[:, -1], _BRIGHT)
        if np.all(np.abs(after - before) <= _ALONG * allowed):
            return panels
        panels *= 2
        before = rays.integrate(some, panels).h_light
    return panels


def _fill(light: np.ndarray, rays: _Rays, active: np.ndarray, panels: int, stride: int) -> np.ndarray:
    """Put the light of active pixels (H W,) into `light` (H W, 3); return those that need closer rays."""
    pixels = np.nonzero(active)[0]
    if stride == 1:
        light[pixels] = _directly(rays, pixels, panels)
        return np.zeros_like(active)
    cells = _Cells(rays, active, stride)
    used, corners = np.unique(cells.nodes, return_inverse=True)
    corners = corners.reshape(cells.nodes.shape)
    paths = _integrals(rays, used, panels)
    own = corners[:, cells.of_pixel[pixels]]
    light[pixels], crosses = _look_up(paths, own, cells.weights(pixels), rays.part[pixels])
    light[pixels] /= rays.h32[pixels, None]
    poor = _is_poor(light, rays, cells, corners, paths.h_light)
    # beside the edge of the lens there is nothing to interpolate
    poor |= ~np.all(rays.is_ray[cells.nodes], axis=0)
    again = poor[cells.of_pixel[pixels]]
    alone = pixels[crosses & ~again]
    light[alone] = _directly(rays, alone, panels)
    active = np.zeros_like(active)
    active[pixels[again]] = True
    return active


def _is_poor(light: np.ndarray, rays: _Rays, cells: "_Cells", corners: np.ndarray, h_light: np.ndarray) -> np.ndarray:
    """Return the cells (n,) whose tests differ from what is interpolated, at the parts that their pixels ask for."""
    panels = h_light.shape[1] - 1
    first, last = cells.extent(rays.part)
    ends = np.arange(panels + 1)
    asked = (ends >= np.floor(first * panels)[:, None]) & (ends <= np.ceil(last * panels)[:, None])
    dark = _DARK * np.quantile(light[::37], _BRIGHT, axis=0)
    error, poor = 0.0, np.zeros(len(cells.cells), bool)
    for tests in cells.tests:
        truth = _integrals(rays, tests, panels).h_light
        weights = cells.weights(tests)
        found = sum(w[:, None, None] * h_light[corner] for w, corner in zip(weights, corners, strict=True))
        one = (found - truth) / np.maximum(_BETWEEN * (truth + dark * rays.h32[tests, None, None]), 1e-30)
        # one tests rows and one columns: elsewhere in the cell both errors add up
        error = np.maximum(np.maximum(np.abs(error), np.abs(one)), np.abs(error + one))
    h = rays.h[cells.nodes]
    # where the distance from the lamp changes much from corner to corner, two tests say little of the rest
    poor |= h.max(axis=0) > _UNEVEN * h.min(axis=0)
    return poor | np.any((error.max(axis=-1) > 1) & asked, axis=1)


class _Cells:
    """Squares of pixels of about `stride` that hold an active one, by the numbers of rays.

    `nodes` (9, cells): 3 x 3 rays of each, row by row; `tests` (2, cells): a ray on its upper and one on its left side,
    a quarter on; `of_pixel` (H W,): the cell of each pixel (0 for those in none).
    """

    def __init__(self, rays: _Rays, active: np.ndarray, stride: int):
        height, self.width = rays.view.shape
        (row, rows, self._down), (column, columns, self._across) = (_sides(n, stride) for n in (height, self.width))
        cell = (row[:, None] * len(columns) + column).ravel()
        found, first = np.unique(cell[active], return_index=True)
        place = np.zeros(len(rows) * len(columns), int)
        place[found] = np.arange(len(found))
        self.of_pixel = np.where(np.isin(cell, found), place[cell], 0)
        own_rows, own_columns = rows[found // len(columns)].T, columns[found % len(columns)].T
        self.nodes = np.stack([r * self.width + c for r in own_rows for c in own_columns])
        (top, middle, _), (left, centre, _) = own_rows, own_columns
        tests = np.stack([top * self.width + (left + centre) // 2, (top + middle) // 2 * self.width + left])
        # one that is not asked for may have no ray: an active pixel of the cell does
        inside = (cell[tests] == found) & active[tests]
        self.tests = np.where(inside, tests, np.nonzero(active)[0][first])
        self.cells, self._of_active, self._active = found, self.of_pixel[active], active

    def weights(self, pixels: np.ndarray) -> np.ndarray:
        """Return the weights of the nodes of the pixels' cells, (9, pixels)."""
        down, across = self._down[:, pixels // self.width], self._across[:, pixels % self.width]
        return (down[:, None] * across).reshape(9, -1)

    def extent(self, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the least and the largest value (H W,) of the active pixels of each cell, (cells,) each."""
        order = np.argsort(self._of_active, kind="stable")
        starts = np.searchsorted(self._of_active[order], np.arange(len(self.cells)))
        sorted_values = values[self._active][order]
        return np.minimum.reduceat(sorted_values, starts), np.maximum.reduceat(sorted_values, starts)


def _sides(size: int, stride: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Cut a row or column of pixels into intervals: the interval of each pixel (size,), three nodes of each interval
    (intervals, 3), and the weights of its nodes at each pixel (3, size): Lagrange's parabola."""
    ends = np.unique(np.linspace(0, size - 1, -(-(size - 1) // stride) + 1).round().astype(int))
    first, last = (ends[:-1], ends[1:]) if len(ends) > 1 else (ends, ends)
    nodes = np.stack([first, (first + last) // 2, last], axis=1)
    pixel = np.arange(size)
    interval = np.clip(np.searchsorted(first, pixel, side="right") - 1, 0, len(first) - 1)
    start, middle, end = nodes[interval].T.astype(float)
    length, half = np.maximum(end - start, 1), middle - start
    x, m = (pixel - start) / length, half / length
    # two pixels have no third between them: a straight line
    safe = np.where(half > 0, m, 0.5)
    curve = np.where(half > 0, x * (1 - x) / (safe * (1 - safe)), 0.0)
    weights = np.stack([1 - x - (1 - safe) * curve, curve, x - safe * curve])
    return interval, nodes, weights.astype(np.float32)


def _integrals(rays: _Rays, numbers: np.ndarray, panels: int) -> Paths:
    """Return the integrals of rays (n,), some of them at a time."""
    chunks = [rays.integrate(numbers[first : first + _CHUNK], panels) for first in range(0, len(numbers), _CHUNK)]
    return Paths(*(np.concatenate(part) for part in zip(*chunks, strict=True)))


def _look_up(paths: Paths, corners: np.ndarray, weights: np.ndarray, part: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return h L (pixels, 3) at parts of rays, interpolated between rays, cubic along them; and whether the lamp's
    light begins or ends in one of the panels met."""
    panels = paths.slope.shape[1] - 1
    # h L and its change at the start of each panel, then at its end
    ends = np.concatenate([paths.h_light, paths.slope], axis=2)
    table = np.concatenate([ends[:, :-1], ends[:, 1:]], axis=2).reshape(-1, 12)
    place = part * panels
    panel = np.minimum(place.astype(int), panels - 1)
    x = (place - panel).astype(np.float32)[:, None]
    mixed, crosses = np.zeros((len(part), 12), np.float32), np.zeros(len(part), bool)
    flags = paths.has_edge.ravel()
    for corner, weight in zip(corners, weights, strict=True):
        place = corner * panels + panel
        row = np.take(table, place, axis=0)
        row *= weight[:, None]
        mixed += row
        crosses |= flags[place]
    # Hermite's cubic
    found = mixed[:, 0:3] * ((1 + 2 * x) * (1 - x) ** 2)
    found += mixed[:, 3:6] * (x * (1 - x) ** 2)
    found += mixed[:, 6:9] * (x * x * (3 - 2 * x))
    found += mixed[:, 9:12] * (x * x * (x - 1))
    return found, crosses


def _directly(rays: _Rays, numbers: np.ndarray, panels: int) -> np.ndarray:
    """Return the light of single rays (n, 3), integrated up to their own ends."""
    found = np.empty((len(numbers), 3), np.float32)
    for first in range(0, len(numbers), _CHUNK):
        chunk = numbers[first : first + _CHUNK]
        light = rays.integrate(chunk, panels, ends=rays.part[chunk]).h_light[:, -1]
        found[first : first + _CHUNK] = light / rays.h32[chunk, None]
    return found
