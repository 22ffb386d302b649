"""Lens in air inside a dome of glass."""

import drjit as dr
import mitsuba as mi

from uwsim.render.plugins.sensor.base import WaterSensor, reflectances, refract, transmittance


class DomePort(WaterSensor):
    """Rays from the outer one of two concentric spheres around the lens; parameters of `WaterSensor`, and

    | parameter | type | meaning |
    |---|---|---|
    | `decentring` | (1, 3, 1) tensor | the lens as seen from the centre of the spheres, in the camera frame [m] |
    | `inner_radius`, `outer_radius` | float | of the glass [m] |
    | `n_air`, `n_glass`, `n_water` | float | indices |
    | `glass_absorption` | float | of power [1/m] |
    """

    def __init__(self, props):
        super().__init__(props)
        self.decentring = [dr.opaque(mi.Float, float(value)) for value in props["decentring"].array.numpy()]
        names = ("inner_radius", "outer_radius", "n_air", "n_glass", "n_water", "glass_absorption")
        self.numbers = [dr.opaque(mi.Float, props[name]) for name in names]

    def leave(self, direction):
        inner_radius, outer_radius, n_air, n_glass, n_water, absorption = self.numbers
        lens = mi.Vector3f(*self.decentring)  # places from the centre of the spheres
        in_air = dr.normalize(direction)
        _, inner = _exit(lens, in_air, inner_radius)
        inner_normal = inner / inner_radius
        in_glass, cos_glass_in = refract(in_air, inner_normal, n_air / n_glass)
        path, outer = _exit(inner, in_glass, outer_radius)
        outer_normal = outer / outer_radius
        in_water, cos_water = refract(in_glass, outer_normal, n_glass / n_water)
        passed = transmittance(
            reflectances(dr.dot(in_air, inner_normal), cos_glass_in, n_air, n_glass),
            reflectances(dr.dot(in_glass, outer_normal), cos_water, n_glass, n_water),
            dr.exp(-absorption * path),
        )
        return outer - lens, in_water, passed * dr.square(n_air / n_water)


def _exit(start, direction, radius):
    """Return how far it is to a sphere around the origin from inside or from its surface, and the point met."""
    along = dr.dot(start, direction)
    nearest = start - along * direction
    distance = dr.safe_sqrt(dr.square(radius) - dr.squared_norm(nearest)) - along
    return distance, start + distance * direction


mi.register_sensor("dome_port", lambda props: DomePort(props))
