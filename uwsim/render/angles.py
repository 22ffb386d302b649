"""Tabulated densities over an angle, to draw from and to divide by: where light scattered near a lamp comes from."""

import drjit as dr
import mitsuba as mi
import numpy as np

from uwsim.optics.phase import PhaseMixture

_BINS = 1024
_SMALLEST_RAD = 1e-5
_LEAST_SINE = 1e-7


class AngleTable:
    """A piecewise constant density over angles in [0, pi], bins narrow towards 0.

    Held as the mass beyond an angle, which keeps its digits at large angles, where little is left.
    """

    def __init__(self, edges: np.ndarray, mass: np.ndarray):
        mass = mass / mass.sum()
        beyond = np.concatenate([np.cumsum(mass[::-1])[::-1], [0.0]])
        self.bins = len(mass)
        self.log_first = float(np.log(edges[1]))
        self.log_step = float((np.log(edges[-1]) - self.log_first) / (self.bins - 1))
        self.edges = mi.Float(edges.astype(np.float32))
        self.beyond = mi.Float(beyond.astype(np.float32))
        self.heights = mi.Float((mass / np.diff(edges)).astype(np.float32))

    def _bin(self, angle):
        index = dr.floor((dr.log(dr.maximum(angle, 1e-12)) - self.log_first) / self.log_step)
        return mi.UInt32(dr.clip(mi.Int32(index) + 1, 0, self.bins - 1))

    def density(self, angle):
        """Density at an angle. [1/rad]"""
        return dr.gather(mi.Float, self.heights, self._bin(angle))

    def direction_about(self, axis, sample):
        """Return a direction whose angle to a unit vector is drawn from the table, the turn about it evenly."""
        sine, cosine = dr.sincos(self.angle_with_mass_beyond(sample.x))
        turn_sine, turn_cosine = dr.sincos(dr.two_pi * sample.y)
        return mi.Frame3f(axis).to_world(mi.Vector3f(sine * turn_cosine, sine * turn_sine, cosine))

    def density_about(self, axis, direction):
        """Return the density of `direction_about` at a unit vector. [1/sr]"""
        sine = dr.maximum(dr.norm(dr.cross(axis, direction)), _LEAST_SINE)
        return self.density(dr.atan2(sine, dr.dot(axis, direction))) / (dr.two_pi * sine)

    def mass_beyond(self, angle):
        """Probability of a larger angle."""
        index = self._bin(angle)
        past = angle - dr.gather(mi.Float, self.edges, index)
        return dr.gather(mi.Float, self.beyond, index) - past * dr.gather(mi.Float, self.heights, index)

    def angle_with_mass_beyond(self, mass):
        """The angle that leaves `mass` beyond it."""
        index = dr.binary_search(0, self.bins - 1, lambda i: dr.gather(mi.Float, self.beyond, i + 1) > mass)
        below = dr.gather(mi.Float, self.beyond, index) - mass
        return dr.gather(mi.Float, self.edges, index) + below / dr.gather(mi.Float, self.heights, index)


def scattering_tables(phase: PhaseMixture) -> tuple[AngleTable, AngleTable]:
    """Return densities of the scattering angle along a ray past a lamp, and of the angle between lamp and ray.

    Along a ray that makes the angle alpha with the direction to a small lamp, light scattered once arrives with
    scattering angles psi from alpha on, in proportion to the phase function p(psi): the 1/d^2 of the lamp cancels
    against d(distance)/d(psi). The radiance scattered once is then in proportion to the integral of p beyond alpha,
    divided by sin alpha; the second density is that radiance over solid angle. Phase functions are averaged over
    the wavelengths here, and what a diverging peak has below the smallest bin is left out: densities to draw from need
    not be exact.
    """
    edges = np.concatenate([[0.0], np.geomspace(_SMALLEST_RAD, np.pi, _BINS)])
    inside = edges[:-1, None] + np.diff(edges)[:, None] * (np.arange(8) + 0.5) / 8
    shares = phase.weights.mean(axis=1)
    terms = [share * term.density(inside) for term, share in zip(phase.terms, shares, strict=True)]
    along = sum(terms).mean(axis=1) * np.diff(edges)
    beyond = np.cumsum(along[::-1])[::-1]
    around = (beyond - 0.5 * along) * np.diff(edges)
    return AngleTable(edges, along), AngleTable(edges, around)


def place_by_angle(table: AngleTable, source, ray, length, uniform, active):
    """Return a distance along a ray up to `length`, drawn by scattering angle about a source, and its density [1/m].

    `table` of the phase function along the ray. The density is 0 where there is no place.
    """
    reach, along, apart = _triangle(source, ray)
    nearest, low, high, farthest = _masses(table, along, apart, length)
    angle = table.angle_with_mass_beyond(dr.lerp(low, high, uniform))
    angle = dr.clip(angle, nearest, farthest)
    usable = active & (high > low) & (angle < dr.pi - 1e-5)
    # law of sines in the triangle of ray, source and place of scattering
    distance = dr.select(usable, reach * dr.sin(angle - nearest) / dr.sin(angle), 0.0)
    distance = dr.clip(distance, 0.0, dr.select(dr.isfinite(length), length, dr.largest(mi.Float)))
    # d(distance) / d(angle) = d^2 / apart
    squared = dr.square(apart) + dr.square(along - distance)
    return distance, dr.select(usable, table.density(angle) / (high - low) * apart / squared, 0.0)


def angle_density(table: AngleTable, source, ray, length, distance, active):
    """Return the density of `place_by_angle` at a distance along the ray. [1/m]"""
    _, along, apart = _triangle(source, ray)
    _, low, high, _ = _masses(table, along, apart, length)
    squared = dr.square(apart) + dr.square(along - distance)
    angle = dr.atan2(apart, along - distance)
    return dr.select(active & (high > low), table.density(angle) / (high - low) * apart / squared, 0.0)


def _triangle(source, ray):
    """Return the distance of a source from the start of a ray, along it, and apart from it."""
    offset = source - ray.o
    reach = dr.norm(offset)
    return reach, dr.dot(offset, ray.d), dr.maximum(dr.norm(dr.cross(offset, ray.d)), _LEAST_SINE * reach)


def _masses(table, along, apart, length):
    """Return the smallest scattering angle on a ray, the masses beyond the largest and it, and the largest."""
    nearest = dr.atan2(apart, along)
    farthest = dr.select(dr.isfinite(length), dr.atan2(apart, along - length), dr.pi)
    return nearest, table.mass_beyond(farthest), table.mass_beyond(nearest), farthest
