"""A lamp's light that the water sends to the camera from slabs of range, with any law on the two paths.

Integrals along rays of a lattice, cumulative over range; what is smooth between rays is interpolated. For light that no
other particle scattered there is the sharper `airlight.single`.
"""

from collections.abc import Callable

import numpy as np
from scipy import ndimage

from uwsim.formation.bands import fine
from uwsim.formation.scattering import density_of, groups
from uwsim.formation.spread import Spread
from uwsim.formation.two_paths import Law, TwoPaths
from uwsim.formation.view import View

_RAYS = 24  # across an image
_PANELS = 32
_FIRST_M = 0.02  # of the panels, which grow in proportion to range further on
_OPTICAL_END = 15.0
_LEAST = 1e-12  # sin^2(angle/2) of the smallest angle: some phase functions are infinite at 0
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(3)


class Lattice:
    """Rays of a view about 1/24 of its width apart, and panels of range from 0 to where the farthest body is seen.

    Without a body rays end where c s = 15 in the clearest wavelength, at most at 100 m. Panels hold three nodes each.
    Light is within 1e-3 of that with twice as many rays and panels.
    """

    def __init__(self, view: View):
        self.view = view
        stride = max(1, -(-max(view.shape) // _RAYS))
        self.rows, self.columns = (np.unique(np.append(np.arange(0, size, stride), size - 1)) for size in view.shape)
        pick = np.ix_(self.rows, self.columns)
        has_ray = view.has_ray[pick]
        # beside the edge of the lens the nearest ray, so that nothing dark is interpolated in
        nearest = ndimage.distance_transform_edt(~has_ray, return_distances=False, return_indices=True)
        self.origins, self.directions = (
            np.where(has_ray[..., None], values[pick], default)[tuple(nearest)]
            for values, default in ((view.origins_m, 0.0), (view.directions, [0.0, 0.0, 1.0]))
        )
        self.end_m = self._end()
        growth = np.log1p(self.end_m / _FIRST_M)
        self.edges_m = _FIRST_M * np.expm1(growth * np.linspace(0, 1, _PANELS + 1))
        self._growth = growth
        width = np.diff(self.edges_m)
        self.ranges_m = self.edges_m[:-1, None] + width[:, None] * 0.5 * (_NODES + 1)
        self.steps_m = width[:, None] * 0.5 * _WEIGHTS
        self.points_m = self.origins[:, :, None, None] + self.ranges_m[..., None] * self.directions[:, :, None, None]

    def _end(self) -> float:
        clearest = float(self.view.water.attenuation.min())
        far = min(_OPTICAL_END / clearest, 100.0) if clearest > 0 else 100.0
        ranges = self.view.range_m[self.view.has_ray]
        if ranges.size and np.all(np.isfinite(ranges)):
            far = min(far, float(ranges.max()))
        return max(far, 1e-3)

    def cumulative(self, per_length: np.ndarray) -> np.ndarray:
        """Return integrals up to the panels' ends, (.., P + 1, 3), of values at the nodes (rows, columns, P, 3, 3)."""
        pieces = np.einsum("ijpnb,pn->ijpb", per_length, self.steps_m)
        total = np.cumsum(pieces, axis=2)
        return np.concatenate([np.zeros_like(total[:, :, :1]), total], axis=2)

    def to(self, cumulative: np.ndarray, range_m: np.ndarray, *, stride: int = 1) -> np.ndarray:
        """Return integrals up to ranges (H, W) at the pixels (every `stride`th), (H, W, 3) float32."""
        height, width = self.view.shape
        rows = np.interp(np.arange(stride // 2, height, stride), self.rows, np.arange(len(self.rows)))
        columns = np.interp(np.arange(stride // 2, width, stride), self.columns, np.arange(len(self.columns)))
        path = np.minimum(range_m[stride // 2 :: stride, stride // 2 :: stride], self.end_m)
        place = np.log1p(path / _FIRST_M) * (_PANELS / self._growth)
        places = np.broadcast_arrays(rows[:, None], columns[None], place)
        found = [
            ndimage.map_coordinates(band, places, order=1, mode="nearest", output=np.float32)
            for band in np.moveaxis(cumulative, -1, 0)
        ]
        return np.stack(found, axis=-1)


class Slabs:
    """One lamp's light in the slabs of a lattice; `wide` False: without its field of light scattered forwards.

    `angular`: None for the phase function at the angle between lamp and ray; (61,) for a coefficient without angles
    instead [1/(m sr)]. `one_over_distance`: the lamp's 1/z^2 as 1/z (eq. 2.36 as printed).
    """

    def __init__(
        self, lattice: Lattice, spread: Spread, index: int, *, wide: bool, angular: np.ndarray | None = None,
        one_over_distance: bool = False,
    ):  # fmt: skip
        self.lattice, self.spread, self.lamp = lattice, spread, spread.view.lamps[index]
        came = self.lamp.arriving(lattice.points_m)
        self.path_m, self.unscattered = came.path_m, came.irradiance_per_intensity
        self.cosine = np.einsum("ijpnk,ijk->ijpn", came.towards, lattice.directions)
        field = spread.widened(index, farthest_m=float(self.path_m.max())) if wide else None
        self.scattered = field(lattice.points_m, self.path_m) if wide else None
        if one_over_distance:
            self.unscattered = self.unscattered * self.path_m
            self.scattered = self.scattered * self.path_m if wide else None
        self.parts = self._parts(angular)

    def _parts(self, angular: np.ndarray | None) -> list[tuple[np.ndarray, np.ndarray]]:
        """Return [(spectrum on the fine grid (121,) [1/m], angular factor (rows, columns, panels, nodes)), ...]."""
        water, power = self.spread.view.water, fine(self.lamp.spectrum)
        if angular is not None:
            return [(power * fine(angular), np.ones_like(self.cosine))]
        half = np.clip((1 - self.cosine) / 2, _LEAST, 1.0)
        return [
            (
                power * fine(water.scattering) * fine(share),
                sum(weight * density_of(term, half) for weight, term in terms),
            )
            for share, terms in groups(water.phase)
        ]

    def per_length(self, source: Law, camera: Law) -> np.ndarray:
        """Return the radiance per length of ray that reaches the camera, (rows, columns, panels, nodes, 3)."""
        geometry = self.unscattered if source == "unscattered" else self.scattered
        reach = (self.path_m.max(), self.lattice.end_m)
        total = np.zeros((*self.cosine.shape, 3), np.float32)
        for spectrum, angular in self.parts:
            table = TwoPaths(self.spread.media, spectrum[:, None] * self.spread.view.weights, (source, camera), reach)
            total += table(self.path_m, self.lattice.ranges_m) * (angular * geometry)[..., None].astype(np.float32)
        return total


def blurred(
    lattice: Lattice, cumulative: np.ndarray, *, blur: Callable[[np.ndarray, float, int], np.ndarray], count: int = 14
) -> np.ndarray:
    """Return the sum over `count` slabs of each one's light blurred by its own range, (H, W, 3) float32.

    `cumulative` as of `Lattice.cumulative`; `blur(image, range_m, stride)` spreads an image of every `stride`th pixel.
    A slab ends at the body seen. Images of about 160 pixels across are blurred: the light of a slab is smooth.
    """
    view = lattice.view
    stride = max(1, max(view.shape) // 160)
    bounds = np.unique(np.round(np.linspace(0, _PANELS, count + 1)).astype(int))
    before, total = None, None
    for start, stop in zip(bounds[:-1], bounds[1:], strict=True):
        if before is None:
            before = lattice.to(cumulative, np.minimum(view.range_m, lattice.edges_m[start]), stride=stride)
        after = lattice.to(cumulative, np.minimum(view.range_m, lattice.edges_m[stop]), stride=stride)
        middle = 0.5 * (lattice.edges_m[start] + lattice.edges_m[stop])
        part = blur(after - before, middle, stride)
        total = part if total is None else total + part
        before = after
    return _enlarged(total, stride, view.shape)


def _enlarged(image: np.ndarray, stride: int, shape: tuple[int, int]) -> np.ndarray:
    if stride == 1:
        return image
    rows, columns = ((np.arange(size) - stride // 2) / stride for size in shape)
    places = np.broadcast_arrays(rows[:, None], columns[None])
    bands = [ndimage.map_coordinates(band, places, order=1, mode="nearest") for band in np.moveaxis(image, -1, 0)]
    return np.stack(bands, axis=-1).astype(np.float32)
