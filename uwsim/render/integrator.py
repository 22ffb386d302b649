"""Light transport from lamps and daylight through water to the camera, in layers.

A path is followed from the camera. Every segment of it brings, without waiting for chance,
  - the light of the lamps and the sun that the body at its end reflects, dimmed over the whole segment,
  - light scattered once between lamp and segment, at a scattering angle drawn from the phase function: the 1/d^2 of the
    lamp cancels, so that passing close to a lamp is no rare, huge event (see `angles`), and
  - the sky where it ends at the water surface.
Then the path collides in the water or reaches the body. From there one more segment is drawn around the lamps and the
sun, as light arrives that was scattered near them, for what is scattered on it once; the path itself goes on as the
event chooses, and the two share that light by the balance heuristic. A path sees a lamp of finite size, or of several
LEDs, through one point of it; over many paths that is the whole lamp. All orders of scattering, unbiased; the layers
are sums over the same paths.

Source: next-event estimation and multiple importance sampling (Veach 1997, chapter 9), over wavelengths too
(Wilkie et al. 2014, Comput. Graph. Forum 33:123); the change of variables of Kulla & Fajardo 2012 (Comput. Graph. Forum
31:1519) taken from the angle at the lamp to the scattering angle, where it absorbs the phase function as well.
Valid: bodies without extinction of their own, opaque to light; a flat water surface; no polarisation.
"""

import drjit as dr
import mitsuba as mi

from uwsim.render.angles import scattering_tables
from uwsim.render.build import Built
from uwsim.render.world import World

LAYERS = ("direct", "forward_scatter", "backscatter")
ORDERS = ("direct_unscattered", "backscatter_single")
"""What of `direct` and of `backscatter` was scattered no more than a particle or a body at its last event did."""

MOST_SEGMENTS = 1 << 20  # of a path, from the camera; 1 keeps what was scattered or reflected once

_WAVELENGTHS = 4
_FIRST_COLLISION = 0.5  # least probability of a collision before the body that the camera sees
_ROULETTE_DEPTH = 5
EXTRA, TURN_WATER, TURN_AHEAD, TURN_BODY, AHEAD = 1.0, 0.2, 0.0, 0.5, 0.88
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
        share = mi.Float(1.0)  # and of what is scattered on it once: the rest came by the guided segment
        from_body = mi.Bool(False)  # the last event before the camera was a body
        met_body = mi.Bool(False)  # some event was a body
        depth, active = mi.UInt32(0), mi.Bool(True)

        while active:
            met = world.meet(ray, active)
            passed = mi.Spectrum(1.0)  # share of light that crosses the whole segment
            if dr.hint(medium is not None, mode="scalar"):
                passed = dr.exp(-medium.depth(k, ray.o, ray.d, met.length, active))

            # ---- what the segment brings, by layer ----
            first = depth == 0
            reflected = throughput * passed * self._reflected(met, k, state, met.body)
            entering = throughput * passed * self._sky(ray, met.surface)
            entering += dr.select(first, self._lamps_seen(ray, met.length, k, active & first), 0.0)
            scattered = throughput * share * self._scattered_once(ray, met.length, k, state, sampler, active)
            seen = dr.select(met.particle, 0.0, reflected)
            scattered += reflected - seen
            directly = first | from_body
            direct += dr.select(directly, seen + entering, 0.0)
            unscattered += dr.select(first, seen + entering, 0.0)
            single += dr.select(first, scattered, 0.0)
            # the sky comes in by a particle where the last event was one
            scattered += dr.select(directly, 0.0, entering)
            forward += dr.select(directly, 0.0, seen)

            # ---- the event: a collision in the water, or the end of the segment ----
            collides, place = mi.Bool(False), ray(dr.select(dr.isfinite(met.length), met.length, 0.0))
            if dr.hint(medium is not None, mode="scalar"):
                collision = dr.mean(1 - passed)
                raised = dr.maximum(collision, _FIRST_COLLISION)
                collision = dr.select(met.body & first & (collision > 0), raised, collision)
                collides = active & (sampler.next_1d(active) < collision)
                distance, survived, density = self._collision(ray, met.length, passed, k, sampler, collides)
                in_water = survived / dr.maximum(density * collision, 1e-30)
                throughput *= dr.select(collides, in_water, passed / dr.maximum(1 - collision, _TINY))
                place = dr.select(collides, ray(distance), place)
            at_body = met.body & ~collides
            reflects = met.surface & ~collides
            at_particle = collides | (at_body & met.particle)

            # ---- light scattered once on a segment towards the lamps, which no chance event would find ----
            event = _Event(self, _water(place, ray), met.si, at_body, collides, k)
            guided = mi.Spectrum(0.0)
            if dr.hint(self.guides > 0 and EXTRA > 0, mode="scalar"):
                guided = throughput * self._guided(event, state, sampler)
            body_first = from_body | (first & ~at_particle)
            body_met = met_body | ~at_particle
            direct += dr.select(from_body, scattered, 0.0) + dr.select(body_first, guided, 0.0)
            forward += dr.select(met_body & ~from_body, scattered, 0.0) + dr.select(body_met & ~body_first, guided, 0.0)
            backward += dr.select(met_body | from_body, 0.0, scattered) + dr.select(body_met, 0.0, guided)

            # ---- the direction in which the path goes on ----
            direction, weight, share = self._onwards(event, state, sampler)
            origin = event.origin(direction)
            if dr.hint(world.surface is not None, mode="scalar"):
                mirror = world.surface.reflectance(ray.d.z)
                reflects &= sampler.next_1d(active) < mirror
                direction = dr.select(reflects, mi.Vector3f(ray.d.x, ray.d.y, -ray.d.z), direction)
                weight, share = dr.select(reflects, 1.0, weight), dr.select(reflects, 1.0, share)
                origin.z = dr.select(reflects, dr.minimum(origin.z, -1e-6), origin.z)
            throughput *= weight
            active &= collides | at_body | reflects
            ray = mi.Ray3f(origin, direction, ray.time, ray.wavelengths)
            from_body |= first & at_body & ~met.particle
            met_body |= at_body & ~met.particle
            depth += 1

            # ---- Russian roulette ----
            survival = dr.select(depth > _ROULETTE_DEPTH, dr.minimum(dr.max(throughput), 0.95), 1.0)
            active &= (dr.max(throughput) > 0) & (depth < MOST_SEGMENTS) & (sampler.next_1d(active) < survival)
            throughput /= dr.maximum(survival, _TINY)

        return [direct, forward, backward, unscattered, single]

    def _reflected(self, met, k, state, active):
        """Radiance that a body sends back along the ray of light straight from lamps and sun."""
        total = mi.Spectrum(0.0)
        lights = self.world.lamps + ([] if self.world.sun is None else [self.world.sun])
        for light in lights:
            came = light.arriving(met.si, state, self.world, k, active)
            bsdf = met.si.bsdf().eval(mi.BSDFContext(), met.si, met.si.to_local(came.direction), came.visible)
            total += dr.select(came.visible, bsdf * came.irradiance * dr.exp(-came.depth), 0.0)
        return total

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
            distance, density = self._place_by_angle(light, ray, length, state, sampler.next_1d(active), active)
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

    def _place_by_angle(self, light, ray, length, state, uniform, active):
        """Return a distance along a segment, drawn by scattering angle about a lamp, and its density; 0 for none."""
        offset = light.source(_water(ray.o, ray), state, active) - ray.o
        apart, along = dr.maximum(dr.norm(dr.cross(offset, ray.d)), _TINY * dr.norm(offset)), dr.dot(offset, ray.d)
        nearest = dr.atan2(apart, along)  # scattering angle at the start of the segment, the smallest
        farthest = dr.select(dr.isfinite(length), dr.atan2(apart, along - length), dr.pi)
        low, high = self.along.mass_beyond(farthest), self.along.mass_beyond(nearest)
        angle = self.along.angle_with_mass_beyond(dr.lerp(low, high, uniform))
        angle = dr.clip(angle, nearest, farthest)
        usable = active & (high > low) & (angle < dr.pi - 1e-5)
        # law of sines in the triangle of segment start, lamp and place of scattering
        distance = dr.select(usable, dr.norm(offset) * dr.sin(angle - nearest) / dr.sin(angle), 0.0)
        distance = dr.clip(distance, 0.0, dr.select(dr.isfinite(length), length, dr.largest(mi.Float)))
        # d(distance) / d(angle) = d^2 / apart
        reach = dr.square(apart) + dr.square(along - distance)
        density = self.along.density(angle) / (high - low) * apart / reach
        return distance, dr.select(usable, density, 0.0)

    def _place_in_sun(self, ray, length, k, sampler, active):
        """Return a distance along a segment at which the sun is scattered, and its density."""
        channel = _channel(sampler.next_1d(active))
        uniform = sampler.next_1d(active)
        if self.medium.grid is not None:
            within = 1 - dr.exp(-self.medium.depth(k, ray.o, ray.d, length, active))
            return self._free_path(ray, length, within, k, channel, uniform, active)[::2]
        # the light that arrives falls as exp(-rate x distance), which rises where the segment leads up to the sun
        rate = k.c * (1 - ray.d.z / self.world.sun.cosine)
        reach = dr.select(dr.isfinite(length), length, 1e6)
        rate = dr.select(dr.abs(rate * reach) < 1e-4, 1e-4 / reach, rate)
        drawn = _pick(rate, channel)
        share = -dr.expm1(-drawn * reach)
        distance = dr.clip(-dr.log1p(-uniform * share) / drawn, 0.0, reach)
        density = dr.mean(rate * dr.exp(-rate * distance) / -dr.expm1(-rate * reach))
        return distance, dr.select(active & dr.isfinite(distance) & dr.isfinite(density), density, 0.0)

    def _collision(self, ray, length, passed, k, sampler, active):
        """Return the distance of a collision within a segment, exp(-depth) there, and its density."""
        channel = _channel(sampler.next_1d(active))
        return self._free_path(ray, length, 1 - passed, k, channel, sampler.next_1d(active), active)

    def _free_path(self, ray, length, within, k, channel, uniform, active):
        """Draw a distance before `length` from one wavelength; its density is mixed over the ray's wavelengths."""
        depth = -dr.log(1 - uniform * _pick(within, channel))
        distance = self.medium.free_path(k, channel, ray.o, ray.d, depth, active)
        distance = dr.minimum(distance, length)
        distance = dr.select(active & dr.isfinite(distance), distance, 0.0)
        survived = dr.exp(-self.medium.depth(k, ray.o, ray.d, distance, active))
        attenuation = self.medium.attenuation_at(k, ray(distance), active)
        density = dr.mean(attenuation * survived / dr.maximum(within, _TINY))
        return distance, survived, density

    def _onwards(self, event, state, sampler):
        """Return the direction of the path's next segment, value over density, and its share of what is scattered once."""
        direction = event.sample(sampler)
        if self.guides == 0:
            value, density = event.value(direction)
            return direction, dr.select(event.active & (density > 0), value / density, 0.0), mi.Float(1.0)
        towards = self._guiding_direction(event, state, sampler)
        turn = self._turn(event, state)
        guided = sampler.next_1d(event.active) < turn
        direction = dr.select(guided, towards, direction)
        value, density = event.value(direction)
        around = self._guiding_density(event, direction, state)
        density = (1 - turn) * density + turn * around
        weight = dr.select(event.active & (density > 0), value / density, 0.0)
        return direction, weight, density / dr.maximum(density + EXTRA * around, 1e-30)

    def _turn(self, event, state):
        """Probability that a path turns to a lamp or the sun: not where it goes there already."""
        onwards, closest = -event.at.wi, mi.Float(-1.0)
        for light in self.world.lamps:
            aim = dr.normalize(light.source(event.at, state, event.active) - event.at.p)
            closest = dr.maximum(closest, dr.dot(aim, onwards))
        if self.world.sun is not None:
            closest = dr.maximum(closest, dr.dot(self.world.sun.towards, onwards))
        in_water = dr.select(closest < AHEAD, mi.Float(TURN_WATER), TURN_AHEAD)
        return dr.select(event.at_body, mi.Float(TURN_BODY), in_water)

    def _guided(self, event, state, sampler):
        """Light that an event sends on which was scattered once on a segment drawn around a lamp or the sun.

        Weighted by the balance heuristic against the segment on which the path itself goes on.
        """
        active = event.active & (MOST_SEGMENTS > 1)
        direction = self._guiding_direction(event, state, sampler)
        value, own = event.value(direction)
        turn, around = self._turn(event, state), self._guiding_density(event, direction, state)
        density = (1 - turn) * own + (turn + EXTRA) * around
        active &= (density > 0) & (dr.max(value) > 0)
        ray = mi.Ray3f(event.origin(direction), direction, event.at.time, event.at.wavelengths)
        length = self.world.meet(ray, active).length
        light = self._scattered_once(ray, length, event.k, state, sampler, active)
        return EXTRA * dr.select(active, value * light / dr.maximum(density, 1e-30), 0.0)

    def _guiding_direction(self, event, state, sampler):
        """Return a direction drawn around a lamp or around the sun's."""
        at, active = event.at, event.active
        choice, sample = sampler.next_1d(active), sampler.next_2d(active)
        sine, cosine = dr.sincos(self.around.angle_with_mass_beyond(sample.x))
        turn_sine, turn_cosine = dr.sincos(dr.two_pi * sample.y)
        pick = dr.minimum(mi.UInt32(choice * self.guides), self.guides - 1)
        aim = mi.Vector3f(0, 0, 1)
        for index, light in enumerate(self.world.lamps):
            aim = dr.select(pick == index, dr.normalize(light.source(at, state, active) - at.p), aim)
        direction = mi.Frame3f(aim).to_world(mi.Vector3f(sine * turn_cosine, sine * turn_sine, cosine))
        if self.world.sun is not None:
            again = choice * self.guides - pick
            by_sun = self.medium.scattered_direction(event.k, self._in_sun(at), again, sample, active)
            direction = dr.select(pick == len(self.world.lamps), by_sun, direction)
        return direction

    def _guiding_density(self, event, direction, state):
        total = mi.Float(0.0)
        for light in self.world.lamps:
            aim = dr.normalize(light.source(event.at, state, event.active) - event.at.p)
            sine = _sine(aim, direction)
            angle = dr.atan2(sine, dr.dot(aim, direction))
            total += self.around.density(angle) / (dr.two_pi * sine)
        if self.world.sun is not None:
            total += self.medium.scattering_towards(event.k, self._in_sun(event.at), direction, event.active)[1]
        return total / self.guides

    def _in_sun(self, at):
        """Return a place as light that travels towards the sun reaches it: scattered, it goes on around the sun."""
        towards = self.world.sun.towards
        return _interaction(at.p, -towards, at.time, at.wavelengths)


class _Event:
    """Where a path goes on: a collision in the water, or a body."""

    def __init__(self, walk: LampWalk, at, si, at_body, collides, k):
        self.medium, self.at, self.si, self.k = walk.medium, at, si, k
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


def _channel(uniform):
    return dr.minimum(mi.UInt32(uniform * _WAVELENGTHS), _WAVELENGTHS - 1)


def _pick(values, channel):
    """Return one entry of a spectrum."""
    picked = values[0]
    for index in range(1, _WAVELENGTHS):
        picked = dr.select(channel == index, values[index], picked)
    return picked


def _water(point, ray):
    """Return an interaction with the water at `point` of light that travels backwards along `ray`."""
    return _interaction(point, -ray.d, ray.time, ray.wavelengths)


def _interaction(point, wi, time, wavelengths):
    at = dr.zeros(mi.MediumInteraction3f)
    at.p, at.time, at.wavelengths, at.wi = point, time, wavelengths, wi
    at.sh_frame = mi.Frame3f(wi)
    return at


def _sine(first, second):
    """Sine of the angle between two unit vectors, never 0."""
    return dr.maximum(dr.norm(dr.cross(first, second)), _TINY)
