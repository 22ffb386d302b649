"""Light sources as light paths see them: lamps, their images in the water surface, the sun and the sky.

Every source answers for one place in the water: from where light arrives, how much, and how far it has come.
"""

from typing import NamedTuple

import drjit as dr
import mitsuba as mi
import numpy as np

from uwsim.optics.natural_light import surface_transmittance
from uwsim.render.medium import spectrum_at
from uwsim.render.shapes import spectrum


class Arriving(NamedTuple):
    """Light at a place: unit direction to where it comes from, irradiance normal to it without the water's losses,
    optical depth on its way, and whether nothing is in between."""

    direction: object
    irradiance: object
    depth: object
    visible: object


class LampLight:
    """A lamp of the rig, seen straight or, with `surface`, by reflection at the water surface z = 0."""

    def __init__(self, lamp, *, surface: "Surface | None" = None):
        self.lamp, self.surface = lamp, surface
        self.is_refracted = lamp.window == "flat"

    def source(self, at, state, active):
        """Return the point from which the unscattered light seems to come."""
        if self.surface is None:
            return self.lamp.source_seen_from(at, state, active)
        return _mirror(self.lamp.source_seen_from(_mirrored(at), state, active))

    def arriving(self, at, state, world, coefficients, active) -> Arriving:
        """Return the light at an interaction `at`; `state` is the point of the lamp that the path has drawn."""
        if self.surface is None:
            ds, value = self.lamp.sample_direction(at, state, active)
            visible = active & ~world.blocked(at, ds.p, active)
            depth = world.medium_depth(coefficients, at.p, ds.d, ds.dist, visible)
            return Arriving(ds.d, value, depth, visible)
        ds, value = self.lamp.sample_direction(_mirrored(at), state, active)
        direction = _mirror(ds.d)
        to_surface = dr.select(direction.z > 0, -at.p.z / direction.z, dr.inf)
        meets = active & (to_surface < ds.dist)
        bend = at.p + to_surface * direction
        after = _mirror(direction)
        origin = mi.Point3f(bend.x, bend.y, dr.minimum(bend.z, -1e-6))
        visible = meets & ~world.blocked(at, origin, meets)
        visible &= ~world.blocked_ray(mi.Ray3f(origin, after, (ds.dist - to_surface) * (1 - 1e-3), at.time,
                                               at.wavelengths), meets)  # fmt: skip
        depth = world.medium_depth(coefficients, at.p, direction, to_surface, visible)
        depth += world.medium_depth(coefficients, origin, after, ds.dist - to_surface, visible)
        return Arriving(direction, value * self.surface.reflectance(direction.z), depth, visible)


class SunLight:
    """The sun behind a flat surface: parallel light from one direction in the water."""

    def __init__(self, daylight, *, refractive_index: float):
        in_air = daylight.towards_sun_in_air
        across = in_air[:2] / refractive_index
        self.cosine = float(np.sqrt(1 - across @ across))
        self.towards = mi.Vector3f(*[mi.Float(float(v)) for v in (*across, self.cosine)])
        passed = float(surface_transmittance(np.radians(daylight.sun_zenith_deg), n_water=refractive_index))
        normal = daylight.sun_irradiance_w_per_m2 * passed / self.cosine
        self.irradiance = mi.load_dict(spectrum(normal * daylight.relative_spectrum))

    def arriving(self, at, state, world, coefficients, active) -> Arriving:
        """Return the unscattered sun at an interaction `at`."""
        length = dr.maximum(-at.p.z, 0.0) / self.cosine
        ray = mi.Ray3f(at.p, self.towards, at.time, at.wavelengths)
        end = ray(length * (1 - 1e-4))
        visible = active & ~world.blocked(at, end, active)
        depth = world.medium_depth(coefficients, at.p, self.towards, length, visible)
        return Arriving(self.towards, spectrum_at(self.irradiance, at.wavelengths), depth, visible)


class Surface:
    """A flat water surface at z = 0, seen from below: reflects, and lets the sky in."""

    def __init__(self, daylight, *, refractive_index: float):
        self.index = mi.Float(float(refractive_index))
        self.cardioidal = daylight.sky == "cardioidal"
        # radiance of the zenith: E / pi of a uniform sky, 9 E / (7 pi) of (1 + 2 cos) / 3
        zenith = daylight.sky_irradiance_w_per_m2 / np.pi * (9 / 7 if self.cardioidal else 1)
        self.zenith = mi.load_dict(spectrum(zenith * daylight.relative_spectrum))

    def _cosine_in_air(self, cosine):
        """Cosine in air of a ray with a cosine in the water; 0 beyond the critical angle."""
        return dr.safe_sqrt(1 - dr.square(self.index) * (1 - dr.square(cosine)))

    def reflectance(self, cosine):
        """Share of unpolarised light that is reflected back into the water at the cosine of its angle."""
        inside = dr.clip(dr.abs(cosine), 0.0, 1.0)
        outside = self._cosine_in_air(inside)
        total = dr.square(self.index) * (1 - dr.square(inside)) >= 1
        s = (self.index * inside - outside) / dr.maximum(self.index * inside + outside, 1e-12)
        p = (inside - self.index * outside) / dr.maximum(inside + self.index * outside, 1e-12)
        return dr.select(total, 1.0, 0.5 * (dr.square(s) + dr.square(p)))

    def sky(self, cosine, wavelengths):
        """Radiance just below the surface that arrives from above at the cosine of its angle in the water."""
        shape = (1 + 2 * self._cosine_in_air(cosine)) / 3 if self.cardioidal else mi.Float(1.0)
        # radiance over the square of the index is conserved, but for what is reflected
        return spectrum_at(self.zenith, wavelengths) * shape * dr.square(self.index) * (1 - self.reflectance(cosine))


def _mirror(vector):
    return type(vector)(vector.x, vector.y, -vector.z)


def _mirrored(at):
    """Return a place on the other side of the surface, as a mirrored lamp is asked about it."""
    image = dr.zeros(mi.MediumInteraction3f)
    image.p, image.time, image.wavelengths = _mirror(at.p), at.time, at.wavelengths
    return image
