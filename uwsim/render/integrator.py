"""Light transport from small lamps through homogeneous water to the camera, in layers.

A path is followed from the camera. Every segment of it brings, without waiting for chance,
  - the light of the lamps that the body at its end reflects, dimmed over the whole segment, and
  - light scattered once between lamp and segment, at a scattering angle drawn from the phase function: the 1/d^2 of the
    lamp cancels, so that passing close to a lamp is no rare, huge event (see `angles`).
Then the path collides in the water or reaches the body, and goes on in a direction drawn partly as the event itself
would choose it and partly as light arrives that was scattered near a lamp. All orders of scattering, unbiased;
the three layers are sums over the same paths.

Source: next-event estimation and one-sample multiple importance sampling (Veach 1997, chapter 9), over wavelengths too
(Wilkie et al. 2014, Comput. Graph. Forum 33:123); the change of variables of Kulla & Fajardo 2012 (Comput. Graph. Forum
31:1519) taken from the angle at the lamp to the scattering angle, where it absorbs the phase function as well.
Valid: lamps without extent, one homogeneous body of water, camera inside it, bodies without extinction of their own.
"""

import drjit as dr
import mitsuba as mi
import numpy as np

from uwsim.render.angles import scattering_tables
from uwsim.render.build import LEAST_ATTENUATION_PER_M, Built
from uwsim.render.shapes import spectrum

LAYERS = ("direct", "forward_scatter", "backscatter")

MOST_SEGMENTS = 1 << 20  # of a path, from the camera; 1 keeps what was scattered or reflected once

_WAVELENGTHS = 4
_FIRST_COLLISION = 0.5  # least probability of a collision before the body that the camera sees
_GUIDED_AT_BODY = 0.5  # share of directions drawn around the lamps
_GUIDED_IN_WATER = 0.2
_ROULETTE_DEPTH = 5
_TINY = 1e-7


class LampWalk:
    """Estimator of the layers of radiance along camera rays."""

    def __init__(self, built: Built):
        self.scene, self.medium = built.scene, built.medium
        self.phase = self.medium.phase_function()
        self.lamps = list(built.scene.emitters())
        attenuation = np.maximum(built.water.attenuation, LEAST_ATTENUATION_PER_M)
        self.attenuation = mi.load_dict(spectrum(attenuation))
        self.scattering = mi.load_dict(spectrum(built.water.scattering))
        self.along, self.around = scattering_tables(built.water.phase)

    @dr.syntax
    def __call__(self, rays, sampler):
        """Return the layers of radiance of each ray, in the order of LAYERS, as spectra."""
        c, b = _at(self.attenuation, rays.wavelengths), _at(self.scattering, rays.wavelengths)

        # ---- state of the loop ----
        ray = mi.Ray3f(rays.o, rays.d, rays.time, rays.wavelengths)
        direct, forward, backward = mi.Spectrum(0.0), mi.Spectrum(0.0), mi.Spectrum(0.0)
        throughput = mi.Spectrum(1.0)  # weight of what the next segment brings
        from_body = mi.Bool(False)  # the last event before the camera was a body
        met_body = mi.Bool(False)  # some event was a body
        depth, active = mi.UInt32(0), mi.Bool(True)

        while active:
            si = self.scene.ray_intersect(ray, active)
            hit = active & si.is_valid()
            length = dr.select(hit, si.t, dr.inf)
            passed = dr.select(hit, dr.exp(-c * length), 0.0)  # share of light that crosses the whole segment

            # ---- what the segment brings, by layer ----
            reflected = throughput * passed * self._reflected(si, c, hit)
            scattered = throughput * self._scattered_once(ray, length, c, b, sampler, active)
            first = depth == 0
            seen_directly = first | from_body
            direct += dr.select(seen_directly, reflected, 0.0) + dr.select(from_body, scattered, 0.0)
            forward += dr.select(seen_directly, 0.0, reflected) + dr.select(met_body & ~from_body, scattered, 0.0)
            backward += dr.select(met_body, 0.0, scattered)

            # ---- the event: a collision in the water, or the body ----
            collision = dr.mean(1 - passed)
            collision = dr.select(hit & first, dr.maximum(collision, _FIRST_COLLISION), collision)
            collides = active & (sampler.next_1d(active) < collision)
            at_body = hit & ~collides
            distance, density = self._collision(length, passed, c, sampler, active)
            in_water = b * dr.exp(-c * distance) / (density * collision)
            throughput *= dr.select(collides, in_water, passed / dr.maximum(1 - collision, _TINY))
            active &= collides | at_body

            # ---- the direction in which the path goes on ----
            place = dr.select(at_body, si.p, ray.o + distance * ray.d)
            direction, weight = self._direction(_water(place, ray), si, at_body, collides, sampler)
            throughput *= weight
            origin = dr.select(at_body, si.spawn_ray(direction).o, place)
            ray = mi.Ray3f(origin, direction, ray.time, ray.wavelengths)
            from_body |= first & at_body
            met_body |= at_body
            depth += 1

            # ---- Russian roulette ----
            survival = dr.select(depth > _ROULETTE_DEPTH, dr.minimum(dr.max(throughput), 0.95), 1.0)
            active &= (dr.max(throughput) > 0) & (depth < MOST_SEGMENTS) & (sampler.next_1d(active) < survival)
            throughput /= dr.maximum(survival, _TINY)

        return [direct, forward, backward]

    def _reflected(self, si, c, active):
        """Radiance that a body sends back along the ray of light straight from the lamps."""
        total = mi.Spectrum(0.0)
        for lamp in self.lamps:
            ds, light = lamp.sample_direction(si, mi.Point2f(0.5), active)
            lit = active & ~self.scene.ray_test(si.spawn_ray_to(ds.p), active)
            bsdf = si.bsdf().eval(mi.BSDFContext(), si, si.to_local(ds.d), lit)
            total += dr.select(lit, bsdf * light * dr.exp(-c * ds.dist), 0.0)
        return total

    def _scattered_once(self, ray, length, c, b, sampler, active):
        """Radiance at the start of a segment of light scattered once on it, one scattering angle per lamp."""
        total = mi.Spectrum(0.0)
        for lamp in self.lamps:
            ds, _ = lamp.sample_direction(_water(ray.o, ray), mi.Point2f(0.5), active)
            apart, along = ds.dist * _sine(ds.d, ray.d), ds.dist * dr.dot(ds.d, ray.d)
            nearest = dr.atan2(apart, along)  # scattering angle at the start of the segment, the smallest
            farthest = dr.select(dr.isfinite(length), dr.atan2(apart, along - length), dr.pi)
            low, high = self.along.mass_beyond(farthest), self.along.mass_beyond(nearest)
            angle = self.along.angle_with_mass_beyond(dr.lerp(low, high, sampler.next_1d(active)))
            angle = dr.clip(angle, nearest, farthest)
            density = self.along.density(angle) / (high - low)
            usable = active & (high > low) & (angle < dr.pi - 1e-5)
            # law of sines in the triangle of segment start, lamp and place of scattering
            distance = dr.select(usable, ds.dist * dr.sin(angle - nearest) / dr.sin(angle), 0.0)
            distance = dr.clip(distance, 0.0, dr.select(dr.isfinite(length), length, dr.largest(mi.Float)))

            at = _water(ray.o + distance * ray.d, ray)
            ds, light = lamp.sample_direction(at, mi.Point2f(0.5), usable)
            usable &= ~self.scene.ray_test(at.spawn_ray_to(ds.p), usable)
            phase, _ = self.phase.eval_pdf(mi.PhaseFunctionContext(), at, ds.d, usable)
            # d(distance) / d(angle) = d^2 / apart
            value = b * phase * light * dr.exp(-c * (distance + ds.dist)) * dr.square(ds.dist) / (apart * density)
            total += dr.select(usable, value, 0.0)
        return total

    def _collision(self, length, passed, c, sampler, active):
        """Return the distance of a collision before `length`, and its density mixed over the ray's wavelengths."""
        channel = dr.minimum(mi.UInt32(sampler.next_1d(active) * _WAVELENGTHS), _WAVELENGTHS - 1)
        drawn = c[0]
        for index in range(1, _WAVELENGTHS):
            drawn = dr.select(channel == index, c[index], drawn)
        within = 1 - dr.exp(-drawn * length)
        distance = -dr.log(1 - sampler.next_1d(active) * within) / drawn
        distance = dr.minimum(distance, length)
        density = dr.mean(c * dr.exp(-c * distance) / dr.maximum(1 - passed, _TINY))
        return distance, dr.maximum(density, 1e-30)

    def _direction(self, at, si, at_body, collides, sampler):
        """Return a direction to go on, and reflectance or phase function over its density."""
        active = at_body | collides
        to_lamps = [lamp.sample_direction(at, mi.Point2f(0.5), active)[0].d for lamp in self.lamps]
        pick = dr.minimum(mi.UInt32(sampler.next_1d(active) * len(to_lamps)), len(to_lamps) - 1)
        aim = to_lamps[0]
        for index in range(1, len(to_lamps)):
            aim = dr.select(pick == index, to_lamps[index], aim)

        choice, sample = sampler.next_1d(active), sampler.next_2d(active)
        share = dr.select(at_body, mi.Float(_GUIDED_AT_BODY), mi.Float(_GUIDED_IN_WATER))
        guided = sampler.next_1d(active) < share
        by_body, _ = si.bsdf().sample(mi.BSDFContext(), si, choice, sample, at_body)
        by_water, _, _ = self.phase.sample(mi.PhaseFunctionContext(), at, choice, sample, collides)
        sine, cosine = dr.sincos(self.around.angle_with_mass_beyond(sample.x))
        turn_sine, turn_cosine = dr.sincos(dr.two_pi * sample.y)
        by_lamp = mi.Frame3f(aim).to_world(mi.Vector3f(sine * turn_cosine, sine * turn_sine, cosine))
        direction = dr.select(guided, by_lamp, dr.select(at_body, si.to_world(by_body.wo), by_water))

        local = si.to_local(direction)
        phase, phase_density = self.phase.eval_pdf(mi.PhaseFunctionContext(), at, direction, collides)
        value = dr.select(at_body, si.bsdf().eval(mi.BSDFContext(), si, local, at_body), phase)
        own = dr.select(at_body, si.bsdf().pdf(mi.BSDFContext(), si, local, at_body), phase_density)
        lampward = mi.Float(0.0)
        for to_lamp in to_lamps:
            sine = _sine(to_lamp, direction)
            angle = dr.atan2(sine, dr.dot(to_lamp, direction))
            lampward += self.around.density(angle) / (dr.two_pi * sine * len(to_lamps))
        density = (1 - share) * own + share * lampward
        return direction, dr.select(active & (density > 0), value / density, 0.0)


def _at(texture, wavelengths):
    """Return a spectrum at the wavelengths of the rays."""
    si = dr.zeros(mi.SurfaceInteraction3f)
    si.wavelengths = wavelengths
    return texture.eval(si)


def _water(point, ray):
    """Return an interaction with the water at `point` of light that travels backwards along `ray`."""
    at = dr.zeros(mi.MediumInteraction3f)
    at.p, at.time, at.wavelengths = point, ray.time, ray.wavelengths
    at.wi = -ray.d
    at.sh_frame = mi.Frame3f(at.wi)
    return at


def _sine(first, second):
    """Sine of the angle between two unit vectors, never 0."""
    return dr.maximum(dr.norm(dr.cross(first, second)), _TINY)
