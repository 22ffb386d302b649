"""Tables of rigid frames on the device: gathered by number, or by the time within the exposure."""

from typing import NamedTuple

import drjit as dr
import mitsuba as mi


class Frame(NamedTuple):
    """A rigid frame in another: its unit axes and its origin there."""

    x: object
    y: object
    z: object
    origin: object

    def point_inside(self, point):
        """Return in this frame a point given in the other."""
        return mi.Point3f(self.vector_inside(point - self.origin))

    def vector_inside(self, vector):
        """Return in this frame a vector given in the other."""
        return mi.Vector3f(dr.dot(self.x, vector), dr.dot(self.y, vector), dr.dot(self.z, vector))

    def point_outside(self, point):
        """Return in the other frame a point given in this one."""
        return self.origin + self.vector_outside(point)

    def vector_outside(self, vector):
        """Return in the other frame a vector given in this one."""
        return vector.x * self.x + vector.y * self.y + vector.z * self.z


class Frames:
    """Frames as rows of 12 numbers, the first three rows of target_from_source: `rows` (12 n) and their `count`."""

    def __init__(self, rows):
        self.rows = mi.Float(rows)
        self.count = dr.width(self.rows) // 12

    def number(self, index) -> Frame:
        """Return the frame of a number below `count`."""
        a = [dr.gather(mi.Float, self.rows, index * 12 + k) for k in range(12)]
        x, y, z = (mi.Vector3f(a[k], a[k + 4], a[k + 8]) for k in range(3))
        return Frame(x, y, z, mi.Point3f(a[3], a[7], a[11]))

    def at(self, time) -> Frame:
        """Return the frame at a time in [0, 1) of the exposure, which it passes in equal steps."""
        return self.number(dr.minimum(mi.UInt32(time * self.count), self.count - 1))
