"""Light transport from lamps and daylight through water to the camera, in layers.

A path is followed from the camera. Every segment of it brings, without waiting for chance,
  - the light of the lamps and the sun that the body at its end reflects, dimmed over the whole segment,
  - light scattered once between lamp and segment, at a scattering angle drawn from the phase function: the 1/d^2 of the
    lamp cancels, so that passing close to a lamp is no rare, huge event (see `angles`), and
  - the sky where it ends at the water surface.
Then the path collides in the water or reaches the body, and goes on in a direction drawn partly as the event itself
would choose it and partly as light arrives that was scattered near a lamp or near the sun's direction. Whether it is
followed further depends on its weight and on how bright it is where it is and where it goes: a path that has turned
back towards a lamp weighs little and brings much. A path sees a lamp of finite size, or of several LEDs, through one
point of it; over many paths that is the whole lamp. All orders of scattering, unbiased; the layers are sums over the
same paths.

Source: next-event estimation and multiple importance sampling (Veach 1997, chapter 9), over wavelengths too
(Wilkie et al. 2014, Comput. Graph. Forum 33:123); the change of variables of Kulla & Fajardo 2012 (Comput. Graph. Forum
31:1519) taken from the angle at the lamp to the scattering angle, where it absorbs the phase function as well.
Valid: bodies without extinction of their own, opaque to light; a flat water surface; no polarisation.
"""

import drjit as dr
import mitsuba as mi

from uwsim.render.angles import angle_density, place_by_angle, scattering_tables
from uwsim.render.build import Built
from uwsim.render.medium import channel_of, interaction, pick
from uwsim.render.world import World

LAYERS = ("direct", "forward_scatter", "backscatter")
ORDERS = ("direct_unscattered", "backscatter_single")
"""What of `direct` and of `backscatter` was scattered no more than a particle or a body at its last event did."""

MOST_SEGMENTS = 1 << 20  # of a path, from the camera; 1 keeps what was scattered or reflected once

_FIRST_COLLISION = 0.5  # least probability of a collision before the body that the camera sees
_GUIDED_IN_WATER = 0.2  # share of directions drawn around the lamps and the sun
_GUIDED_AT_BODY = 0.5
_ROULETTE_DEPTH = 5
_MOST_SURVIVAL = 0.998  # near 1: in water that hardly absorbs, weights of long paths must not grow
_MOST_BRIGHTER = 1e6
_NEAR_M, _FAR_M = 1e-3, 1e6
_TINY = 1e-7


class LampWalk:
    """Estimator of the layers of radiance along camera rays."""

    def __init__(self, built: Built):
        self.world = World(built)
        self.medium = self.world.medium
        self.guides = len(self.world.lamps) + (self.world.sun is not None) if self.medium is not None else 0
        if self.medium is not None:
            self.along, self.around = scattering_tables(built.water.phase)

    @dr.syntax
    def __call__(self, rays, sampler):
        """Return the radiance of each ray by LAYERS, then by ORDERS, as spectra."""
        world, medium = self.world, self.medium
        k = None if medium is None else medium.coefficients(rays.wavelengths)
        state = sampler.next_2d()  # the point of the lamps that this path sees

        # ---- state of the loop ----
        ray = mi.Ray3f(rays.o, rays.d, rays.time, rays.wavelengths)
        direct, forward, backward = mi.Spectrum(0.0), mi.Spectrum(0.0), mi.Spectrum(0.0)
        unscattered, single = mi.Spectrum(0.0), mi.Spectrum(0.0)
        throughput = mi.Spectrum(1.0)  # weight of what the next segment brings
        from_body = mi.Bool(False)  # the last event before the camera was a body
        met_body = mi.Bool(False)  # some event was a body
        events = mi.UInt32(0)  # a reflection at the water surface is none
        farthest = mi.Float(0.0)  # distance of an event from the lamps
        depth, active = mi.UInt32(0), mi.Bool(True)

        while active:
            met = world.meet(ray, active)
            passed = mi.Spectrum(1.0)  # share of light that crosses the whole segment
            if dr.hint(medium is not None, mode="scalar"):
                passed = dr.exp(-medium.depth(k, ray.o, ray.d, met.length, active))

            # ---- what the segment brings, by layer ----
            first, second = events == 0, events == 1
            arrived = throughput * passed
            reflected = arrived * self._reflected(met, k, state, met.body)
            entering = arrived * self._sky(ray, met.surface)
            entering += dr.select(first, self._lamps_seen(ray, met.length, k, active & first), 0.0)
            unscattered += dr.select(first & ~met.particle, reflected, 0.0)
            unscattered += dr.select(first | (second & from_body), entering, 0.0)
            single += dr.select(first & met.particle, reflected, 0.0) + dr.select(second & ~from_body, entering, 0.0)
            scattered = throughput * self._scattered_once(ray, met.length, k, state, sampler, active)
            single += dr.select(first, scattered, 0.0)
            seen = dr.select(met.particle, 0.0, reflected)
            scattered += reflected - seen
            directly = first | from_body
            # the sky comes in by a particle where the last event was one
            scattered += dr.select(directly, 0.0, entering)
            direct += dr.select(directly, seen + entering, 0.0) + dr.select(from_body, scattered, 0.0)
            forward += dr.select(directly, 0.0, seen) + dr.select(met_body & ~from_body, scattered, 0.0)
            backward += dr.select(met_body | from_body, 0.0, scattered)

            # ---- the event: a collision in the water, or the end of the segment ----
            collides, place = mi.Bool(False), ray(dr.select(dr.isfinite(met.length), met.length, 0.0))
            if dr.hint(medium is not None, mode="scalar"):
                collision = dr.mean(1 - passed)
                raised = dr.maximum(collision, _FIRST_COLLISION)
                collision = dr.select(met.body & first & (collision > 0), raised, collision)
                collides = active & (sampler.next_1d(active) < collision)
                distance, survived, density = medium.draw_distance(
                    k,
                    ray,
                    met.length,
                    1 - passed,
                    channel_of(sampler.next_1d(active)),
                    sampler.next_1d(active),
                    collides,
                )
                in_water = survived / dr.maximum(density * collision, 1e-30)
                throughput *= dr.select(collides, in_water, passed / dr.maximum(1 - collision, _TINY))
                place = dr.select(collides, ray(distance), place)
            at_body = met.body & ~collides
            reflects = met.surface & ~collides

            # ---- the direction in which the path goes on ----
            event = _Event(medium, _water(place, ray), met.si, at_body, collides, k)
            guided = dr.select(at_body, mi.Float(_GUIDED_AT_BODY), _GUIDED_IN_WATER)
            direction, weight, promise = self._onwards(event, state, sampler, guided)
            origin = event.origin(direction)
            if dr.hint(world.surface is not None, mode="scalar"):
                mirror = world.surface.reflectance(ray.d.z)
                reflects &= sampler.next_1d(active) < mirror
                direction = dr.select(reflects, mi.Vector3f(ray.d.x, ray.d.y, -ray.d.z), direction)
                weight = dr.select(reflects, 1.0, weight)
                origin.z = dr.select(reflects, dr.minimum(origin.z, -1e-6), origin.z)
            throughput *= weight
            active &= collides | at_body | reflects
            ray = mi.Ray3f(origin, direction, ray.time, ray.wavelengths)
            from_body |= first & at_body & ~met.particle
            met_body |= at_body & ~met.particle
            events += dr.select(reflects, 0, 1)
            depth += 1

            # ---- Russian roulette, by weight and by the light that is to be expected ----
            brighter, farthest = self._brighter(event.at, farthest, k, state, active)
            survival = dr.minimum(dr.max(throughput) * promise * brighter, _MOST_SURVIVAL)
            survival = dr.select((depth > _ROULETTE_DEPTH) & ~reflects, survival, 1.0)
            active &= (dr.max(throughput) > 0) & (depth < MOST_SEGMENTS) & (sampler.next_1d(active) < survival)
            throughput /= dr.maximum(survival, _TINY)

        return [direct, forward, backward, unscattered, single]

    def _reflected(self, met, k, state, active):
        """Radiance that a body sends back along the ray: of light straight from lamps and sun, and of its own."""
        total = mi.Spectrum(0.0)
        for light in self.world.lights:
            came = light.arriving(met.si, state, self.world, k, active)
            bsdf = met.si.bsdf().eval(mi.BSDFContext(), met.si, met.si.to_local(came.direction), came.visible)
            total += dr.select(came.visible, bsdf * came.irradiance * dr.exp(-came.depth), 0.0)
        # what shines is met by chance alone: no path is sent there on purpose, nothing counts twice
        glow = self.world.glow(met.si, active)
        return total if glow is None else total + glow

    def _sky(self, ray, active):
        if self.world.surface is None:
            return mi.Spectrum(0.0)
        return dr.select(active, self.world.surface.sky(ray.d.z, ray.wavelengths), 0.0)

    def _lamps_seen(self, ray, length, k, active):
        """Radiance of the lamps that the camera looks at."""
        total = mi.Spectrum(0.0)
        for distance, radiance in self.world.seen_lamps(ray, length, active):
            reach = dr.select(dr.isfinite(distance), distance, 0.0)
            total += radiance * dr.exp(-self.world.medium_depth(k, ray.o, ray.d, reach, active))
        return total

    def _scattered_once(self, ray, length, k, state, sampler, active):
        """Radiance at the start of a segment of light scattered once on it: one place per lamp, one for the sun."""
        total = mi.Spectrum(0.0)
        if self.medium is None:
            return total
        for light in self.world.lamps:
            distance, density = self._place_by_angle(light, ray, length, state, sampler, active)
            total += self._scattered_at(ray, distance, density, light, k, state, active)
        if self.world.sun is not None:
            distance, density = self._place_in_sun(ray, length, k, sampler, active)
            total += self._scattered_at(ray, distance, density, self.world.sun, k, state, active)
        return total

    def _scattered_at(self, ray, distance, density, light, k, state, active):
        """Light of one source scattered once at a place of a segment that was drawn with `density`."""
        usable = active & (density > 0)
        at = _water(ray(dr.select(usable, distance, 0.0)), ray)
        came = light.arriving(at, state, self.world, k, usable)
        usable &= came.visible
        spread, _ = self.medium.scattering_towards(k, at, came.direction, usable)
        own = self.medium.depth(k, ray.o, ray.d, dr.select(usable, distance, 0.0), usable)
        value = spread * came.irradiance * dr.exp(-own - came.depth) / dr.maximum(density, 1e-30)
        return dr.select(usable, value, 0.0)

    def _place_by_angle(self, light, ray, length, state, sampler, active):
        """Return a distance along a segment, drawn by scattering angle about a lamp, and its density."""
        source, uniform = light.source(_water(ray.o, ray), state, active), sampler.next_1d(active)
        distance, density = place_by_angle(self.along, source, ray, length, uniform, active)
        if not light.is_refracted:
            return distance, density
        # behind a window the source seems to be elsewhere from near by: half of the places are drawn about that
        nearest = dr.clip(dr.dot(source - ray.o, ray.d), 0.0, dr.select(dr.isfinite(length), length, 1e6))
        second = light.source(_water(ray(nearest), ray), state, active)
        other, _ = place_by_angle(self.along, second, ray, length, uniform, active)
        distance = dr.select(sampler.next_1d(active) < 0.5, distance, other)
        density = angle_density(self.along, source, ray, length, distance, active)
        return distance, 0.5 * (density + angle_density(self.along, second, ray, length, distance, active))

    def _place_in_sun(self, ray, length, k, sampler, active):
        """Return a distance along a segment at which the sun is scattered, and its density."""
        channel = channel_of(sampler.next_1d(active))
        uniform = sampler.next_1d(active)
        if self.medium.grid is not None:
            within = 1 - dr.exp(-self.medium.depth(k, ray.o, ray.d, length, active))
            return self.medium.draw_distance(k, ray, length, within, channel, uniform, active)[::2]
        # the light that arrives falls as exp(-rate x distance), which rises where the segment leads up to the sun
        rate = k.c * (1 - ray.d.z / self.world.sun.cosine)
        reach = dr.select(dr.isfinite(length), length, 1e6)
        # any rate will do to draw by: none that loses its digits, none that overflows
        rate = dr.maximum(dr.select(dr.abs(rate * reach) < 1e-2, 1e-2 / reach, rate), -80 / reach)
        drawn = pick(rate, channel)
        share = 1 - dr.exp(-drawn * reach)
        distance = dr.clip(-dr.log(1 - uniform * share) / drawn, 0.0, reach)
        density = dr.mean(rate * dr.exp(-rate * distance) / (1 - dr.exp(-rate * reach)))
        return distance, dr.select(active & dr.isfinite(distance) & dr.isfinite(density), density, 0.0)

    def _onwards(self, event, state, sampler, guided):
        """Return the direction of the path's next segment, value over density, and how bright it promises to be.

        guided: share of directions drawn around the lamps and the sun. A promise of 1 is the average over directions.
        """
        direction = event.sample(sampler)
        if self.guides == 0:
            value, density = event.value(direction)
            return direction, dr.select(event.active & (density > 0), value / density, 0.0), mi.Float(1.0)
        towards = self._guiding_direction(event, state, sampler)
        direction = dr.select(sampler.next_1d(event.active) < guided, towards, direction)
        value, density = event.value(direction)
        around = self._guiding_density(event, direction, state)
        density = dr.lerp(density, around, guided)
        promise = dr.maximum(1.0, 4 * dr.pi * around)
        return direction, dr.select(event.active & (density > 0), value / density, 0.0), promise

    def _brighter(self, at, farthest, k, state, active):
        """Return how much brighter it is at a place than where the path was farthest from the lamps; that distance.

        A rough estimate, for the roulette: scattered light around a lamp falls as exp(-K d) / d with K about c / 2.
        """
        if not self.world.lamps or self.medium is None:
            return mi.Float(1.0), farthest
        near = mi.Float(_FAR_M)
        for light in self.world.lamps:
            near = dr.minimum(near, dr.norm(light.source(at, state, active) - at.p))
        farthest = dr.maximum(farthest, near)
        brighter = farthest / dr.maximum(near, _NEAR_M) * dr.exp(0.5 * dr.mean(k.c) * (farthest - near))
        return dr.minimum(brighter, _MOST_BRIGHTER), farthest

    def _guiding_direction(self, event, state, sampler):
        """Return a direction drawn around a lamp or around the sun's."""
        at, active = event.at, event.active
        choice, sample = sampler.next_1d(active), sampler.next_2d(active)
        chosen = dr.minimum(mi.UInt32(choice * self.guides), self.guides - 1)
        aim = mi.Vector3f(0, 0, 1)
        for index, light in enumerate(self.world.lamps):
            aim = dr.select(chosen == index, dr.normalize(light.source(at, state, active) - at.p), aim)
        direction = self.around.direction_about(aim, sample)
        if self.world.sun is not None:
            again = choice * self.guides - chosen
            by_sun = self.medium.scattered_direction(event.k, self._in_sun(at), again, sample, active)
            direction = dr.select(chosen == len(self.world.lamps), by_sun, direction)
        return direction

    def _guiding_density(self, event, direction, state):
        total = mi.Float(0.0)
        for light in self.world.lamps:
            aim = dr.normalize(light.source(event.at, state, event.active) - event.at.p)
            total += self.around.density_about(aim, direction)
        if self.world.sun is not None:
            total += self.medium.scattering_towards(event.k, self._in_sun(event.at), direction, event.active)[1]
        return total / self.guides

    def _in_sun(self, at):
        """Return a place as light that travels towards the sun reaches it: scattered, it goes on around the sun."""
        towards = self.world.sun.towards
        return interaction(at.p, -towards, at.time, at.wavelengths)


class _Event:
    """Where a path goes on: a collision in the water, or a body."""

    def __init__(self, medium, at, si, at_body, collides, k):
        self.medium, self.at, self.si, self.k = medium, at, si, k
        self.at_body, self.collides, self.active = at_body, collides, at_body | collides

    def value(self, direction):
        """Reflectance or volume scattering function towards a direction, and the density of `sample` there."""
        context, local = mi.BSDFContext(), self.si.to_local(direction)
        value = self.si.bsdf().eval(context, self.si, local, self.at_body)
        density = self.si.bsdf().pdf(context, self.si, local, self.at_body)
        if self.medium is not None:
            spread, own = self.medium.scattering_towards(self.k, self.at, direction, self.collides)
            value, density = dr.select(self.at_body, value, spread), dr.select(self.at_body, density, own)
        return value, density

    def sample(self, sampler):
        """Return a direction as the event itself chooses it."""
        choice, sample = sampler.next_1d(self.active), sampler.next_2d(self.active)
        bsdf = self.si.bsdf().sample(mi.BSDFContext(), self.si, choice, sample, self.at_body)[0]
        direction = self.si.to_world(bsdf.wo)
        if self.medium is not None:
            onwards = self.medium.scattered_direction(self.k, self.at, choice, sample, self.collides)
            direction = dr.select(self.at_body, direction, onwards)
        return direction

    def origin(self, direction):
        """Where the next segment begins: off the body's face."""
        return dr.select(self.at_body, self.si.spawn_ray(direction).o, self.at.p)


def _water(point, ray):
    """Return an interaction with the water at `point` of light that travels backwards along `ray`."""
    return interaction(point, -ray.d, ray.time, ray.wavelengths)
