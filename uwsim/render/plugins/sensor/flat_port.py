"""Lens in air behind a flat window of glass."""

import drjit as dr
import mitsuba as mi

from uwsim.render.plugins.sensor.base import WaterSensor, reflectances, refract, transmittance


class FlatPort(WaterSensor):
    """Rays from the outer face of a flat window at any tilt; parameters of `WaterSensor`, and

    | parameter | type | meaning |
    |---|---|---|
    | `normal` | (1, 3, 1) tensor | unit vector from the lens to the water, in the camera frame |
    | `gap`, `thickness` | float | of air before the glass along the normal, and of the glass [m] |
    | `n_air`, `n_glass`, `n_water` | float | indices |
    | `glass_absorption` | float | of power [1/m] |
    """

    def __init__(self, props):
        super().__init__(props)
        self.normal = [dr.opaque(mi.Float, float(value)) for value in props["normal"].array.numpy()]
        names = ("gap", "thickness", "n_air", "n_glass", "n_water", "glass_absorption")
        self.numbers = [dr.opaque(mi.Float, props[name]) for name in names]

    def leave(self, direction):
        gap, thickness, n_air, n_glass, n_water, absorption = self.numbers
        normal = mi.Vector3f(*self.normal)
        direction = dr.normalize(direction)
        cos_air = dr.dot(direction, normal)
        is_ahead = cos_air > 1e-6
        direction = dr.select(is_ahead, direction, normal)
        cos_air = dr.select(is_ahead, cos_air, 1.0)
        in_glass, cos_glass = refract(direction, normal, n_air / n_glass)
        in_water, cos_water = refract(direction, normal, n_air / n_water)
        origin = gap / cos_air * direction + thickness / cos_glass * in_glass
        passed = transmittance(
            reflectances(cos_air, cos_glass, n_air, n_glass),
            reflectances(cos_glass, cos_water, n_glass, n_water),
            dr.exp(-absorption * thickness / cos_glass),
        )
        return origin, in_water, dr.select(is_ahead, passed * dr.square(n_air / n_water), 0.0)


mi.register_sensor("flat_port", lambda props: FlatPort(props))
