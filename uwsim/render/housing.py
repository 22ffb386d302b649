"""Housings of lamps and cameras in Dr.Jit: black closed cylinders, some with a dome, that move with the rig."""

import drjit as dr
import mitsuba as mi
import numpy as np

from uwsim.render.moving import Frames

_INSET = 1e-3  # of the smaller of radius and length: what stands in the front face is never hidden by it
_ROUNDING = 1e-6  # of the coordinates, some steps of float32


class Housings:
    """Cylinders z in [-length, 0] about the z axes of their own frames.

    Each is (poses, radius_m, length_m) or (poses, radius_m, length_m, dome_radius_m): `poses` hold rows 1-3 of
    world_from_cylinder at n equal steps of the exposure, (n, 12) values in any shape; a dome is a sphere about the
    origin of the frame, as black as the rest. `time` of a ray picks the step.

    All surfaces stand back by a thousandth of the radius or length (the smaller; the dome: of its radius), and by the
    rounding of the coordinates: rays that start or end on the front face or on the dome do not meet it.
    Numbers are held on the device: other numbers are no other kernel.
    """

    def __init__(self, cylinders):
        self.cylinders = [_Cylinder(*one) for one in cylinders]

    def intersect(self, ray, active=True):
        """Return the distance along a ray to the first housing; inf for none, 0 for a ray that starts in one.

        `ray.maxt` is not looked at.
        """
        nearest = mi.Float(dr.inf)
        for cylinder in self.cylinders:
            nearest = dr.minimum(nearest, cylinder.intersect(ray))
        return dr.select(active, nearest, dr.inf)

    def blocks(self, ray, active=True):
        """Return whether a ray meets a housing before `ray.maxt`."""
        return self.intersect(ray, active) < ray.maxt


class _Cylinder:
    def __init__(self, poses, radius_m: float, length_m: float, dome_radius_m: float = 0.0):
        values = np.asarray(poses, np.float32).ravel()
        self.frames = Frames(values)
        rounding = _ROUNDING * float(np.abs(values.reshape(-1, 3, 4)[..., 3]).max())
        inset = _INSET * min(radius_m, length_m) + rounding
        self.radius, self.front, self.back = (
            dr.opaque(mi.Float, value) for value in (radius_m - inset, -inset, inset - length_m)
        )
        self.has_dome = dome_radius_m > 0
        self.dome_radius = dr.opaque(mi.Float, dome_radius_m * (1 - _INSET) - rounding)

    def intersect(self, ray):
        frame = self.frames.at(ray.time)
        origin, direction = frame.point_inside(ray.o), frame.vector_inside(ray.d)
        distance = self._body(origin, direction)
        return dr.minimum(distance, _ball(origin, direction, self.dome_radius)) if self.has_dome else distance

    def _body(self, origin, direction):
        across = mi.Vector2f(direction.x, direction.y)
        enter_side, leave_side = _round(mi.Vector2f(origin.x, origin.y), across, self.radius)
        # a ray along the faces: between them always or never
        steep = dr.select(dr.abs(direction.z) > 1e-12, direction.z, 1e-12)
        first, second = (self.front - origin.z) / steep, (self.back - origin.z) / steep
        enter = dr.maximum(enter_side, dr.minimum(first, second))
        leave = dr.minimum(leave_side, dr.maximum(first, second))
        return dr.select((enter < leave) & (leave > 0), dr.maximum(enter, 0.0), dr.inf)


def _round(origin, direction, radius):
    """Return where a line enters and leaves the circle or ball about the origin; (inf, -inf) where it misses it.

    From the point nearest to the centre: for far rays the quadratic formula would lose the digits.
    """
    square = dr.maximum(dr.squared_norm(direction), 1e-24)
    middle = -dr.dot(origin, direction) / square
    inside = dr.square(radius) - dr.squared_norm(origin + middle * direction)
    half = dr.safe_sqrt(inside / square)
    return dr.select(inside > 0, middle - half, dr.inf), dr.select(inside > 0, middle + half, -dr.inf)


def _ball(origin, direction, radius):
    enter, leave = _round(origin, direction, radius)
    return dr.select((enter < leave) & (leave > 0), dr.maximum(enter, 0.0), dr.inf)
