"""Light that particles send to bodies, found from the lamps' side: paths traced from the lamps, kept as vertices.

From a body to a lamp through turbid water hardly any path finds the way back to the small region around the lamp where
nearly all of its scattered light comes from. Paths from the lamps do: every one of them leaves one of its collisions
behind, drawn in proportion to the light that it carries. A point on a body draws one of a few of them by how much light
is to be expected from there by way of one more collision, and that collision as the camera's paths would draw it from
the other side: a direction, partly as the collision itself would choose it and partly around the point, and a place on
it by scattering angle. Both singularities, 1/d^2 at the point and the forward peak, cancel.

Source: bidirectional path tracing (Lafortune & Willems 1993; Veach 1997, chapter 10) with vertices shared by rays of
a set; resampled importance sampling (Talbot et al. 2005, Eurographics Symposium on Rendering). Unbiased: vertices are
drawn anew for every launch.
Valid: no water surface, whose reflections of light on its way to a body are not found.
"""

import drjit as dr
import mitsuba as mi
import numpy as np

from uwsim.render.angles import place_by_angle
from uwsim.render.medium import channel_of, interaction

_CANDIDATES = 16  # vertices among which a point on a body draws
_LEAST_VERTICES, _MOST_VERTICES = 8, 4096  # for each set of time and wavelengths
_RAYS_PER_PATH = 8
_AROUND = 0.5  # share of directions drawn around the point
_BINS, _PROBES = 128, 64
_ROULETTE_DEPTH = 5
_TINY = 1e-7


class Emission:
    """Draws rays in the water that carry the light of a lamp, by its irradiance on a sphere around it."""

    def __init__(self, lamp):
        self.lamp = lamp
        self.centre = mi.Point3f(0, 0, dr.opaque(mi.Float, lamp.front_m))
        self.reach = dr.opaque(mi.Float, lamp.enclosing_radius_m)
        bins, probe = np.divmod(np.arange(_BINS * _PROBES), _PROBES)
        rng = np.random.default_rng(0)  # places of probes: they shape a density, whatever they are
        u = mi.Point3f(rng.random((3, _BINS * _PROBES)).astype(np.float32))
        cosine = 2 * (mi.Float(bins.astype(np.float32)) + u.x) / _BINS - 1
        value = self._ray(cosine, u.y, mi.Point2f(u.z, 0.5), mi.Float(0.5), mi.Spectrum(400, 500, 600, 700))[2]
        expected = dr.mean(value).numpy().reshape(_BINS, _PROBES).mean(axis=1)
        # where the probes saw nothing there may still be a little
        shape = np.maximum(expected, 0.05 * expected.max())
        self.power = float(expected.sum())
        self.bins = mi.DiscreteDistribution(mi.Float(shape.astype(np.float32)))

    def draw(self, sample, turn, state, time, wavelengths):
        """Return origins and directions in the water, and the spectral power over its density."""
        index, rest, share = self.bins.sample_reuse_pmf(sample)
        cosine = 2 * (mi.Float(index) + rest) / _BINS - 1
        origin, direction, value = self._ray(cosine, turn, state, time, wavelengths)
        return origin, direction, value / (share * _BINS)

    def _ray(self, cosine, turn, state, time, wavelengths):
        """Return the ray through a point of the sphere, and its power for points drawn evenly over the sphere."""
        frame = self.lamp.frames.at(time)
        sine = dr.safe_sqrt(1 - dr.square(cosine))
        turn_sine, turn_cosine = dr.sincos(dr.two_pi * turn)
        outward = mi.Vector3f(sine * turn_cosine, sine * turn_sine, cosine)
        ref = dr.zeros(mi.MediumInteraction3f)
        ref.p = frame.point_outside(self.centre + self.reach * outward)
        ref.time, ref.wavelengths = time, wavelengths
        ds, irradiance = self.lamp.sample_direction(ref, state, mi.Bool(True))
        across = dr.abs(dr.dot(frame.vector_outside(outward), ds.d))
        return ds.p, -ds.d, irradiance * (across * 4 * dr.pi * dr.square(self.reach))


class LampSide:
    """Collisions of light from all lamps at the times and wavelengths of the camera's rays."""

    def __init__(self, world, emissions, tables, sets):
        self.world, self.medium, self.sets = world, world.medium, sets
        self.along, self.around = tables
        wanted = dr.width(sets.index) // (_RAYS_PER_PATH * sets.count)
        self.per_set = int(np.clip(wanted, _LEAST_VERTICES, _MOST_VERTICES))
        count = self.per_set * sets.count
        sampler = mi.load_dict({"type": "independent"})
        sampler.seed(sets.seed, count)
        time, wavelengths = sets.draw(dr.arange(mi.UInt32, count) // dr.opaque(mi.UInt32, self.per_set))
        origin, direction, power = self._start(emissions, sampler, time, wavelengths)
        kept = self._trace(mi.Ray3f(origin, direction, time, wavelengths), power, sampler)
        self.place, self.direction, self.power = kept
        self.strength = dr.mean(self.power)
        dr.eval(self.place, self.direction, self.power, self.strength)
        self.number = dr.opaque(mi.UInt32, self.per_set)

    def _start(self, emissions, sampler, time, wavelengths):
        """Return the rays with which the paths leave the lamps."""
        shares = np.array([emission.power for emission in emissions])
        shares = shares / shares.sum()
        choice, sample, turn, state = sampler.next_1d(), sampler.next_1d(), sampler.next_1d(), sampler.next_2d()
        origin, direction, power = mi.Point3f(0), mi.Vector3f(0, 0, 1), mi.Spectrum(0.0)
        below = mi.Float(0.0)
        for emission, share in zip(emissions, [dr.opaque(mi.Float, float(s)) for s in shares], strict=True):
            mine = (choice >= below) & (choice < below + share)
            below += share
            o, d, p = emission.draw(sample, turn, state, time, wavelengths)
            origin, direction = dr.select(mine, o, origin), dr.select(mine, d, direction)
            power = dr.select(mine, p / share, power)
        return origin, direction, power

    @dr.syntax
    def _trace(self, ray, power, sampler):
        """Follow paths through the water; return one collision of each: place, direction of arrival, and power."""
        world, medium = self.world, self.medium
        k = medium.coefficients(ray.wavelengths)
        ray = mi.Ray3f(ray.o, ray.d, ray.time, ray.wavelengths)
        power = mi.Spectrum(power)
        place, direction, carried = mi.Point3f(ray.o), mi.Vector3f(ray.d), mi.Spectrum(0.0)
        total = mi.Float(0.0)  # of the power of the collisions so far
        depth, active = mi.UInt32(0), dr.max(power) > 0
        while active:
            met = world.meet(ray, active)
            within = 1 - dr.exp(-medium.depth(k, ray.o, ray.d, met.length, active))
            collision = dr.mean(within)
            active &= sampler.next_1d(active) < collision
            channel = channel_of(sampler.next_1d(active))
            distance, survived, density = medium.draw_distance(
                k, ray, met.length, within, channel, sampler.next_1d(active), active
            )
            power *= survived / dr.maximum(density * collision, 1e-30)
            at = interaction(ray(distance), -ray.d, ray.time, ray.wavelengths)
            strength = dr.select(active, dr.mean(power), 0.0)
            total += strength
            # each collision stays with the probability that its power has among those before and itself
            stays = active & (sampler.next_1d(active) * total < strength)
            place, direction = dr.select(stays, at.p, place), dr.select(stays, ray.d, direction)
            carried = dr.select(stays, power / dr.maximum(strength, 1e-30), carried)

            onwards = medium.scattered_direction(k, at, sampler.next_1d(active), sampler.next_2d(active), active)
            spread, drawn = medium.scattering_towards(k, at, onwards, active)
            power *= spread / dr.maximum(drawn, 1e-30)
            ray = mi.Ray3f(at.p, onwards, ray.time, ray.wavelengths)
            depth += 1
            left = dr.mean(power) / dr.maximum(total, 1e-30)
            survival = dr.select(depth > _ROULETTE_DEPTH, dr.minimum(4 * left, 0.95), 1.0)
            active &= (dr.max(power) > 0) & (sampler.next_1d(active) < survival)
            power /= dr.maximum(survival, _TINY)
        return place, direction, carried * total

    def reflected(self, met, k, sampler, active):
        """Radiance that a body sends back of light that collided at least twice on its way from the lamps to it."""
        si = met.si
        index, weight = self._chosen(si, k, sampler, active)
        active = active & (weight > 0)
        place = dr.gather(mi.Point3f, self.place, index, active)
        arrived = dr.gather(mi.Vector3f, self.direction, index, active)
        at = interaction(place, -arrived, si.time, si.wavelengths)
        direction = self._onwards(si, at, k, sampler, active)
        first, drawn = self.medium.scattering_towards(k, at, direction, active)
        drawn = dr.lerp(drawn, self.around.density_about(dr.normalize(si.p - place), direction), _AROUND)
        ray = mi.Ray3f(place, direction, si.time, si.wavelengths)
        length = self.world.meet(ray, active).length
        distance, density = place_by_angle(self.along, si.p, ray, length, sampler.next_1d(active), active)
        active &= density > 0

        at = interaction(ray(distance), -direction, si.time, si.wavelengths)
        offset = si.p - at.p
        reach = dr.maximum(dr.norm(offset), _TINY)
        towards = offset / reach
        second, _ = self.medium.scattering_towards(k, at, towards, active)
        bsdf = si.bsdf().eval(mi.BSDFContext(), si, si.to_local(-towards), active)
        active &= dr.max(bsdf) > 0
        active &= ~self.world.blocked(si, at.p, active)
        depth = self.medium.depth(k, place, direction, distance, active)
        depth += self.medium.depth(k, at.p, towards, reach, active)
        power = dr.gather(mi.Spectrum, self.power, index, active)
        value = bsdf * power * first * second * dr.exp(-depth)
        return dr.select(active, value * (weight / (drawn * dr.square(reach) * density)), 0.0)

    def _onwards(self, si, at, k, sampler, active):
        """Return a direction from a collision, drawn as it scatters or around the direction to a point."""
        choice, sample = sampler.next_1d(active), sampler.next_2d(active)
        own = self.medium.scattered_direction(k, at, choice, sample, active)
        towards = self.around.direction_about(dr.normalize(si.p - at.p), sample)
        return dr.select(sampler.next_1d(active) < _AROUND, towards, own)

    @dr.syntax
    def _chosen(self, si, k, sampler, active):
        """Draw one of a few collisions by the light that is to be expected from it; return its index and its weight."""
        first = self.sets.index * self.number
        attenuation = dr.mean(k.c)
        chosen, expected, total, tried = mi.UInt32(0), mi.Float(0.0), mi.Float(0.0), mi.UInt32(0)
        trying = mi.Bool(active)
        while trying:
            number = dr.minimum(mi.UInt32(sampler.next_1d(trying) * mi.Float(self.number)), self.number - 1)
            brought = self._expected(si, first + number, attenuation, trying)
            total += brought
            stays = sampler.next_1d(trying) * total < brought
            chosen, expected = dr.select(stays, first + number, chosen), dr.select(stays, brought, expected)
            tried += 1
            trying &= tried < _CANDIDATES
        return chosen, dr.select(expected > 0, total / (_CANDIDATES * dr.maximum(expected, 1e-30)), 0.0)

    def _expected(self, si, index, attenuation, active):
        """Light that a collision sends to a point by way of one more, but for what is in between.

        One of the two turns is small: the phase function towards the point times all that arrives around it, or the
        light that the straight path would scatter to it.
        """
        place = dr.gather(mi.Point3f, self.place, index, active)
        arrived = dr.gather(mi.Vector3f, self.direction, index, active)
        offset = si.p - place
        reach = dr.maximum(dr.norm(offset), 1e-4)
        sine = dr.maximum(dr.norm(dr.cross(offset, arrived)) / reach, 1e-3)
        angle = dr.atan2(sine, dr.dot(offset, arrived) / reach)
        turned = self.along.phase(angle) * self.along.all_around + self.along.mass_beyond(angle) / sine
        left = dr.exp(-attenuation * reach) / reach
        return dr.gather(mi.Float, self.strength, index, active) * turned * left
