"""Pinhole in the water."""

import mitsuba as mi

from uwsim.render.plugins.sensor.base import WaterSensor


class PinholeWater(WaterSensor):
    """Rays from the pinhole itself, without losses; parameters of `WaterSensor`."""

    def leave(self, direction):
        return mi.Vector3f(0.0), direction, mi.Float(1.0)


mi.register_sensor("pinhole_water", lambda props: PinholeWater(props))
