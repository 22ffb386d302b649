"""Water for light paths: homogeneous, or with other waters added in the cells of a rectilinear grid.

Optical depths and free paths are exact in both, in closed form or cell by cell: no null collisions.
"""

import drjit as dr
import mitsuba as mi
import numpy as np

from uwsim.render.build import LEAST_ATTENUATION_PER_M, Built
from uwsim.render.shapes import spectrum

_FAR_M = 1e6
_WAVELENGTHS = 4


class Coefficients:
    """Attenuation c and scattering b of the scene's water and of each added one at the wavelengths of the paths."""

    def __init__(self, medium: "Medium", wavelengths):
        self.c, self.b = spectrum_at(medium.attenuation, wavelengths), spectrum_at(medium.scattering, wavelengths)
        self.added = [(spectrum_at(c, wavelengths), spectrum_at(b, wavelengths)) for c, b in medium.added]


class Medium:
    """What light paths ask of the water; all lengths in metres, unit directions."""

    def __init__(self, built: Built):
        water = built.water
        # with added waters the rest may be empty; alone it must not, or its free paths would be infinite
        least = LEAST_ATTENUATION_PER_M if built.added is None else 0.0
        self.attenuation = mi.load_dict(spectrum(np.maximum(water.attenuation, least)))
        self.scattering = mi.load_dict(spectrum(water.scattering))
        self.phase = built.medium.phase_function()
        self.added, self.phases, self.grid = [], [], None
        if built.added is not None:
            self.added = [
                (mi.load_dict(spectrum(w.attenuation)), mi.load_dict(spectrum(w.scattering)))
                for w in built.added.waters
            ]
            self.phases = built.added.phases
            self.grid = _Grid(built.added.edges_m, built.added.shares)

    def coefficients(self, wavelengths) -> Coefficients:
        """Return what the following methods need to know of the paths' wavelengths."""
        return Coefficients(self, wavelengths)

    def depth(self, coefficients: Coefficients, origin, direction, length, active):
        """Optical depth from `origin` along `direction` up to `length`, which may be infinite; a spectrum."""
        if self.grid is None:
            return coefficients.c * length
        columns, _ = self.grid.walk(origin, direction, length, None, None, active)
        # an empty scene's water over an infinite length must not become 0 x inf
        total = coefficients.c * dr.minimum(length, 1e30)
        for (c, _), column in zip(coefficients.added, columns, strict=True):
            total += c * column
        return total

    def free_path(self, coefficients: Coefficients, channel, origin, direction, depth, active):
        """Distance at which the optical depth of one of the wavelengths reaches `depth`."""
        c = pick(coefficients.c, channel)
        if self.grid is None:
            return depth / c
        rates = [pick(added, channel) for added, _ in coefficients.added]
        _, distance = self.grid.walk(origin, direction, mi.Float(_FAR_M), (c, rates), depth, active)
        return distance

    def draw_distance(self, coefficients: Coefficients, ray, length, within, channel, uniform, active):
        """Draw a free path shorter than `length` by one of the wavelengths.

        within: shares of light that do not get as far as `length`. Returns the distance, the shares that do get there,
        and the density mixed over the wavelengths.
        """
        depth = -dr.log(1 - uniform * pick(within, channel))
        distance = self.free_path(coefficients, channel, ray.o, ray.d, depth, active)
        distance = dr.minimum(distance, length)
        distance = dr.select(active & dr.isfinite(distance), distance, 0.0)
        survived = dr.exp(-self.depth(coefficients, ray.o, ray.d, distance, active))
        attenuation = self.attenuation_at(coefficients, ray(distance), active)
        return distance, survived, dr.mean(attenuation * survived / dr.maximum(within, 1e-7))

    def attenuation_at(self, coefficients: Coefficients, point, active):
        """Attenuation at a place, a spectrum."""
        total = coefficients.c
        if self.grid is not None:
            for (c, _), share in zip(coefficients.added, self.grid.shares_at(point, active), strict=True):
                total = total + c * share
        return total

    def scattering_towards(self, coefficients: Coefficients, at, direction, active):
        """Volume scattering function b p at `at` towards `direction`, a spectrum; and the mean of p, the density."""
        value, density = self.phase.eval_pdf(mi.PhaseFunctionContext(), at, direction, active)
        if self.grid is None:
            return coefficients.b * value, density
        parts = self._parts(coefficients, at.p, active)
        total, weight = parts[0] * value, dr.mean(parts[0]) * density
        for phase, part in zip(self.phases, parts[1:], strict=True):
            value, density = phase.eval_pdf(mi.PhaseFunctionContext(), at, direction, active)
            total += part * value
            weight += dr.mean(part) * density
        return total, weight / dr.maximum(dr.mean(sum(parts[1:], parts[0])), 1e-30)

    def scattered_direction(self, coefficients: Coefficients, at, choice, sample, active):
        """A direction drawn with the density that `scattering_towards` returns."""
        if self.grid is None:
            return self.phase.sample(mi.PhaseFunctionContext(), at, choice, sample, active)[0]
        parts = [dr.mean(part) for part in self._parts(coefficients, at.p, active)]
        total = sum(parts[1:], parts[0])
        left = choice * total
        direction, drawn = mi.Vector3f(0, 0, 1), mi.Bool(False)
        for phase, part in zip([self.phase, *self.phases], parts, strict=True):
            last = phase is ([self.phase, *self.phases])[-1]
            mine = active & ~drawn & ((left < part) | last)
            own = dr.clip(left / dr.maximum(part, 1e-30), 0.0, 1 - 1e-7)
            direction = dr.select(mine, phase.sample(mi.PhaseFunctionContext(), at, own, sample, mine)[0], direction)
            drawn |= mine
            left -= part
        return direction

    def _parts(self, coefficients: Coefficients, point, active):
        """Scattering of the scene's water and of the share of each added one at a place."""
        shares = self.grid.shares_at(point, active)
        return [coefficients.b] + [b * share for (_, b), share in zip(coefficients.added, shares, strict=True)]


class _Grid:
    """Shares of added waters, constant in the cells between edges along the world's axes."""

    def __init__(self, edges_m: tuple[np.ndarray, ...], shares: np.ndarray):
        self.count = [len(edges) - 1 for edges in edges_m]
        self.edges = [mi.Float(edges.astype(np.float32)) for edges in edges_m]
        self.low = mi.Point3f(*[float(edges[0]) for edges in edges_m])
        self.high = mi.Point3f(*[float(edges[-1]) for edges in edges_m])
        self.shares = [mi.Float(np.ascontiguousarray(share, dtype=np.float32).ravel()) for share in shares]

    def _cell(self, axis: int, position):
        edges, last = self.edges[axis], self.count[axis] - 1
        return mi.Int32(dr.binary_search(0, last, lambda i: dr.gather(mi.Float, edges, i + 1) <= position))

    def _index(self, cell):
        return mi.UInt32((cell[0] * self.count[1] + cell[1]) * self.count[2] + cell[2])

    def shares_at(self, point, active):
        """Share of each added water at a place; 0 outside."""
        inside = active & dr.all((point >= self.low) & (point <= self.high))
        index = self._index([self._cell(axis, point[axis]) for axis in range(3)])
        return [dr.gather(mi.Float, share, index, inside) for share in self.shares]

    @dr.syntax
    def walk(self, origin, direction, length, rates, depth, active):
        """Return the integral of each share along a ray up to `length`, and where `depth` is reached.

        rates: attenuation (of the scene's water, [of each added one]) for the second; None for none.
        """
        # a direction without a component never meets that axis' edges
        inverse = dr.rcp(dr.select(dr.abs(direction) < 1e-12, dr.copysign(mi.Vector3f(1e-12), direction), direction))
        first, second = (self.low - origin) * inverse, (self.high - origin) * inverse
        t = dr.maximum(dr.max(dr.minimum(first, second)), 0.0)
        end = dr.minimum(dr.min(dr.maximum(first, second)), length)
        start = origin + t * direction
        cell = [self._cell(axis, start[axis]) for axis in range(3)]
        forward = [inverse[axis] > 0 for axis in range(3)]  # of the rounded direction: -0 goes backwards
        columns = [mi.Float(0.0) for _ in self.shares]
        stopped = dr.full(mi.Float, dr.inf, dr.width(t))
        base = mi.Float(0.0)
        if dr.hint(rates is not None, mode="scalar"):
            base = rates[0]
            # reached before the grid begins
            stopped = dr.select(base * t >= depth, depth / base, stopped)
        walking = active & (t < end) & ~dr.isfinite(stopped)
        while walking:
            index = self._index(cell)
            shares = [dr.gather(mi.Float, share, index, walking) for share in self.shares]
            leave = []
            for axis in range(3):
                edge = dr.gather(mi.Float, self.edges[axis], mi.UInt32(cell[axis] + dr.select(forward[axis], 1, 0)))
                leave.append(dr.maximum((edge - origin[axis]) * inverse[axis], t))
            nearest = dr.minimum(dr.minimum(leave[0], leave[1]), leave[2])
            out = dr.minimum(nearest, end)
            if dr.hint(rates is not None, mode="scalar"):
                rate, reached = base, base * t
                for r, share, column in zip(rates[1], shares, columns, strict=True):
                    rate = rate + r * share
                    reached = reached + r * column
                here = t + (depth - reached) / rate
                stopped = dr.select((rate > 0) & (here <= out), here, stopped)
            for k in range(len(shares)):
                columns[k] = columns[k] + shares[k] * (out - t)
            t = out
            walking &= (out < end) & ~dr.isfinite(stopped)
            for axis in range(3):
                step = dr.select(leave[axis] <= nearest, dr.select(forward[axis], 1, -1), 0)
                cell[axis] = cell[axis] + step
                walking &= (cell[axis] >= 0) & (cell[axis] < self.count[axis])
        if dr.hint(rates is not None, mode="scalar"):
            reached = mi.Float(0.0)
            for r, column in zip(rates[1], columns, strict=True):
                reached = reached + r * column
            beyond = dr.select(base > 0, (depth - reached) / base, dr.inf)
            stopped = dr.minimum(stopped, dr.maximum(beyond, t))
        return columns, stopped


def spectrum_at(texture, wavelengths):
    """Return a spectrum at the wavelengths of the rays."""
    si = dr.zeros(mi.SurfaceInteraction3f)
    si.wavelengths = wavelengths
    return texture.eval(si)


def interaction(point, wi, time, wavelengths):
    """Return an interaction with the water at a point; `wi` leads back to where the path, or the light, came from."""
    at = dr.zeros(mi.MediumInteraction3f)
    at.p, at.time, at.wavelengths, at.wi = point, time, wavelengths, wi
    at.sh_frame = mi.Frame3f(wi)
    return at


def channel_of(uniform):
    """Return the number of one of the wavelengths that a ray carries."""
    return dr.minimum(mi.UInt32(uniform * _WAVELENGTHS), _WAVELENGTHS - 1)


def pick(values, channel):
    """Return one entry of a spectrum."""
    picked = values[0]
    for index in range(1, len(values)):
        picked = dr.select(channel == index, values[index], picked)
    return picked
