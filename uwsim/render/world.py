"""Everything that a light path may meet: bodies, housings, the water surface."""

import drjit as dr
import mitsuba as mi

from uwsim.render.build import Built
from uwsim.render.lights import LampLight, SunLight, Surface
from uwsim.render.medium import Medium


class Meeting:
    """What ends a segment: `si` of a body, `length` (inf for nothing), and masks of what is there."""

    def __init__(self, si, length, body, surface, particle):
        self.si, self.length = si, length
        self.body, self.surface, self.particle = body, surface, particle


class World:
    """A built scene as an integrator asks about it."""

    def __init__(self, built: Built):
        self.scene, self.housings = built.scene, built.housings
        self.medium = None if built.medium is None else Medium(built)
        self.snow = [shape for shape in built.scene.shapes() if shape.id() in built.particles]
        by_id = {shape.id(): shape for shape in built.scene.shapes()}
        self.glowing = [(by_id[name], radiance) for name, radiance in built.glowing.items()]
        daylight = built.daylight
        lamps = list(built.scene.emitters())
        self.surface, self.sun, self.lamps = None, None, [LampLight(lamp) for lamp in lamps]
        if daylight is not None:
            self.surface = Surface(daylight, refractive_index=built.refractive_index)
            self.lamps += [LampLight(lamp, surface=self.surface) for lamp in lamps]
            if daylight.sun_irradiance_w_per_m2 > 0:
                self.sun = SunLight(daylight, refractive_index=built.refractive_index)

    @property
    def lights(self) -> list:
        """All sources of unscattered light: lamps, their images in the surface, and the sun."""
        return self.lamps + ([] if self.sun is None else [self.sun])

    def meet(self, ray, active) -> Meeting:
        """Return what a ray meets first."""
        si = self.scene.ray_intersect(ray, active)
        body = active & si.is_valid()
        length = dr.select(body, si.t, dr.inf)
        if self.housings is not None:
            black = self.housings.intersect(ray, active)
            body &= length < black
            length = dr.minimum(length, black)
        surface = mi.Bool(False)
        if self.surface is not None:
            above = dr.select(ray.d.z > 0, dr.maximum(-ray.o.z, 0.0) / ray.d.z, dr.inf)
            surface = active & (above < length)
            body &= ~surface
            length = dr.minimum(length, above)
        particle = mi.Bool(False)
        for shape in self.snow:
            particle |= body & (si.shape == mi.ShapePtr(shape))
        return Meeting(si, length, body, surface, particle)

    def glow(self, si, active):
        """Radiance of bodies that shine by themselves; None without any."""
        if not self.glowing:
            return None
        total = mi.Spectrum(0.0)
        for shape, radiance in self.glowing:
            total += dr.select(active & (si.shape == mi.ShapePtr(shape)), radiance.eval(si, active), 0.0)
        return total

    def blocked(self, at, point, active):
        """Whether something stands between an interaction and a point."""
        return self.blocked_ray(at.spawn_ray_to(point), active)

    def blocked_ray(self, ray, active):
        """Whether a ray meets something before its end."""
        hidden = self.scene.ray_test(ray, active)
        if self.housings is not None:
            hidden |= self.housings.intersect(ray, active) < ray.maxt
        return hidden

    def medium_depth(self, coefficients, origin, direction, length, active):
        """Optical depth of a leg; 0 without water."""
        if self.medium is None:
            return mi.Spectrum(0.0)
        return self.medium.depth(coefficients, origin, direction, length, active)

    def seen_lamps(self, ray, length, active):
        """Return for every lamp of the rig how far it is along a camera ray, and its radiance; 0 where not seen."""
        found = []
        for light in self.lamps:
            if light.surface is None:
                distance, radiance = light.lamp.seen(ray, active)
                found.append((distance, dr.select(active & (distance <= length), radiance, 0.0)))
        return found
