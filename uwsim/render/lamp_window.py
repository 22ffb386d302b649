"""Windows of lamps in Dr.Jit: the ray from a point in the air behind the glass to a point in the water, and back.

Frame of the lamp: window's normal and light along +z, outer face at z = `front`. Indices are relative to the air.
With u the tangent of the ray's angle in air, g and w the indices of glass and water, roots G = sqrt(g^2 + (g^2-1) u^2)
and W = sqrt(w^2 + (w^2-1) u^2), the tangents in glass and water are u/G and u/W, and the distance from the axis after
air gap d, glass t and depth z is u (d + t/G + z/W): only sums of like signs, so float32 keeps its digits.
"""

from typing import NamedTuple

import drjit as dr
import mitsuba as mi

STEPS = 4
"""Of Halley's method: in exact arithmetic they leave 4e-7 of the irradiance at most (air gap 0.5 to 200 mm, glass to
100 mm, indices of water to 1.5 and of glass to 1.9, depths 1 mm to 10 m, distances to 3 depths); float32 adds 7e-6 in
999 of 1000 points and 1.3e-4 in the worst, grazing rays of lamps that almost touch the glass."""

_LEAST = 1e-6


class Tube(NamedTuple):
    """A thin bundle of rays: square of the tangent in air, roots G and W, radius per tangent and its derivative."""

    square: object
    glass_root: object
    water_root: object
    per_tangent: object
    slope: object


class FlatWindow:
    """Flat window with all its numbers held on the device: other numbers are no other kernel.

    See `uwsim.optics.window.FlatWindow`, whose exact forms these are in float32.
    """

    def __init__(
        self, *, front_m, thickness_m, radius_m, n_glass, n_water, glass_absorption_per_m, through_window: bool
    ):
        given = (front_m, thickness_m, radius_m, n_glass, n_water, glass_absorption_per_m)
        self.front, self.thickness, self.radius, self.n_glass, self.n_water, self.absorption = (
            dr.opaque(mi.Float, value) for value in given
        )
        self.through_window = through_window

    def _roots(self, square):
        glass, water = dr.square(self.n_glass), dr.square(self.n_water)
        return dr.sqrt(glass + (glass - 1) * square), dr.sqrt(water + (water - 1) * square)

    def gap(self, point):
        """Air between a point behind the window and the glass, along the normal. [m]"""
        return self.front - self.thickness - point.z

    def tube(self, gap, radius, depth) -> Tube:
        """Return the rays from a point with this air gap to a point at a depth, `radius` from the first's normal.

        Starts at the larger of two lower bounds, the tangent at 0 and the asymptote.
        """
        glass, water = dr.square(self.n_glass), dr.square(self.n_water)
        paraxial = radius / (gap + self.thickness / self.n_glass + depth / self.n_water)
        saturated = self.thickness * dr.rsqrt(dr.maximum(glass - 1, _LEAST)) + depth * dr.rsqrt(
            dr.maximum(water - 1, _LEAST)
        )
        tangent = dr.maximum(paraxial, (radius - saturated) / gap)
        for _ in range(STEPS):
            glass_root, water_root = self._roots(dr.square(tangent))
            in_glass, in_water = self.thickness / glass_root, depth / water_root
            glass_part = in_glass * glass / dr.square(glass_root)
            water_part = in_water * water / dr.square(water_root)
            short = tangent * (gap + in_glass + in_water) - radius
            slope = gap + glass_part + water_part
            bend = glass_part * (glass - 1) / dr.square(glass_root) + water_part * (water - 1) / dr.square(water_root)
            tangent -= 2 * short * slope / (2 * dr.square(slope) + 3 * short * tangent * bend)
        return self._tube(dr.square(tangent), gap, depth)

    def _tube(self, square, gap, depth) -> Tube:
        glass_root, water_root = self._roots(square)
        in_glass, in_water = self.thickness / glass_root, depth / water_root
        slope = gap + in_glass * dr.square(self.n_glass / glass_root) + in_water * dr.square(self.n_water / water_root)
        return Tube(square, glass_root, water_root, gap + in_glass + in_water, slope)

    def irradiance(self, tube: Tube):
        """Irradiance on a plane normal to the ray, per intensity in air and transmittance. [1/m^2]"""
        return self.n_water / ((1 + tube.square) * tube.per_tangent * tube.slope * tube.water_root)

    def transmittance(self, square, glass_root, water_root):
        """Share of flux measured as calibrated that enters the water.

        Fresnel's equations with all cosines multiplied by sqrt(1 + u^2): 1 in air, G/g in glass, W/w in water.
        """
        g, w = self.n_glass, self.n_water
        into_glass = (
            dr.square((1 - glass_root) / (1 + glass_root)),
            dr.square((dr.square(g) - glass_root) / (dr.square(g) + glass_root)),
        )
        p_glass, p_water = dr.square(w) * glass_root, dr.square(g) * water_root
        into_water = (
            dr.square((glass_root - water_root) / (glass_root + water_root)),
            dr.square((p_glass - p_water) / (p_glass + p_water)),
        )
        inner = dr.exp(-self.absorption * self.thickness * g * dr.sqrt(1 + square) / glass_root)
        passed = _slab(into_glass, into_water, inner)
        return passed / _slab(into_glass, into_glass, inner) if self.through_window else passed

    def apparent_distance(self, tube: Tube):
        """Distance D along the ray at which a source of the intensity in the water would give E = I / D^2. [m]

        The geometric mean of the distances of the two line images, across and in the plane of incidence.
        """
        wide = 1 + tube.square
        across = tube.per_tangent * self.n_water * dr.sqrt(wide)
        in_plane = tube.slope * dr.square(tube.water_root) * dr.sqrt(wide) / self.n_water
        return dr.sqrt(across * in_plane)

    def backwards(self, origin, direction, active):
        """Follow a ray from the water into the air behind the window.

        Returns the distance to the outer face, whether the ray passes, the point on the inner face, the direction in
        air and the radiance in the water relative to that in air, T w^2.
        """
        lit = active & (direction.z < 0) & (origin.z > self.front)
        down = dr.select(lit, direction.z, -1)
        distance = (self.front - origin.z) / down
        face = origin + distance * direction
        sine_square = dr.square(self.n_water) * (dr.square(direction.x) + dr.square(direction.y))
        lit &= (sine_square < 1) & (dr.square(face.x) + dr.square(face.y) <= dr.square(self.radius))
        square = dr.select(lit, sine_square / (1 - sine_square), 0)
        glass_root, water_root = self._roots(square)
        # lateral step per depth in air; in the water direction.xy / |direction.z|, smaller by the root W
        step = mi.Vector2f(direction.x, direction.y) * (-water_root / down)
        inner = mi.Point2f(face.x, face.y) + step * (self.thickness / glass_root)
        point = mi.Point3f(inner.x, inner.y, self.front - self.thickness)
        in_air = dr.normalize(mi.Vector3f(step.x, step.y, -1.0))
        gain = self.transmittance(square, glass_root, water_root) * dr.square(self.n_water)
        return distance, lit, point, in_air, gain


def _slab(first, second, inner):
    """Mean over the polarisations of the share that passes two faces with inter-reflections."""
    passed = [
        (1 - near) * (1 - far) * inner / (1 - near * far * dr.square(inner))
        for near, far in zip(first, second, strict=True)
    ]
    return 0.5 * (passed[0] + passed[1])
