"""LED: a point source with a beam profile and a spectrum that moves with its rig during the exposure."""

import drjit as dr
import mitsuba as mi


class LED(mi.Emitter):
    """Point emitter with rotational symmetry about its axis.

    | parameter | type | meaning |
    |---|---|---|
    | `poses` | (1, n, 12) tensor | rows 1-3 of world_from_lamp at n equal steps of the exposure [m]; beam along +z |
    | `intensity` | spectrum | radiant intensity on the axis [W sr^-1 nm^-1] |
    | `profile` | (1, k, 1) tensor | intensity relative to the axis at k equal angles from 0 to 180 degrees |

    The emitter reads `time` of the illuminated point, in [0, 1) of the exposure.
    """

    def __init__(self, props):
        super().__init__(props)
        poses = props["poses"]
        profile = props["profile"]
        self.intensity = props["intensity"]
        self.steps = poses.shape[1]
        self.angles = profile.shape[1]
        self.poses = mi.Float(poses.array)
        self.profile = mi.Float(profile.array)
        self.m_flags = int(mi.EmitterFlags.DeltaPosition)

    def traverse(self, callback):
        callback.put("intensity", self.intensity, mi.ParamFlags.Differentiable)
        callback.put("poses", self.poses, mi.ParamFlags.NonDifferentiable)
        callback.put("profile", self.profile, mi.ParamFlags.NonDifferentiable)

    def _pose(self, time):
        """Return axis (unit vector) and position in the world at `time`."""
        step = dr.minimum(mi.UInt32(time * self.steps), self.steps - 1)
        rows = [dr.gather(mi.Float, self.poses, step * 12 + k) for k in range(12)]
        return mi.Vector3f(rows[2], rows[6], rows[10]), mi.Point3f(rows[3], rows[7], rows[11])

    def _relative_intensity(self, cos_angle):
        position = dr.safe_acos(cos_angle) * ((self.angles - 1) / dr.pi)
        low = dr.minimum(mi.UInt32(position), self.angles - 2)
        return dr.lerp(
            dr.gather(mi.Float, self.profile, low),
            dr.gather(mi.Float, self.profile, low + 1),
            position - mi.Float(low),
        )

    def sample_direction(self, ref, sample, active=True):
        axis, position = self._pose(ref.time)
        to_lamp = position - ref.p
        squared = dr.squared_norm(to_lamp)
        distance = dr.sqrt(squared)

        ds = dr.zeros(mi.DirectionSample3f)
        ds.p = position
        ds.time = ref.time
        ds.pdf = 1.0
        ds.delta = True
        ds.emitter = mi.EmitterPtr(self)
        ds.d = to_lamp / distance
        ds.n = -ds.d
        ds.dist = distance

        si = dr.zeros(mi.SurfaceInteraction3f)
        si.wavelengths = ref.wavelengths
        relative = self._relative_intensity(dr.dot(axis, -ds.d))
        value = self.intensity.eval(si, active) * (relative / squared)
        return ds, value & active

    def eval_direction(self, ref, ds, active=True):
        axis, _ = self._pose(ref.time)
        si = dr.zeros(mi.SurfaceInteraction3f)
        si.wavelengths = ref.wavelengths
        relative = self._relative_intensity(dr.dot(axis, -ds.d))
        return (self.intensity.eval(si, active) * (relative / dr.square(ds.dist))) & active

    def pdf_direction(self, ref, ds, active=True):
        return mi.Float(0.0)

    def eval(self, si, active=True):
        return mi.Spectrum(0.0)

    def bbox(self):
        position = self._pose(mi.Float(0.5))[1]
        return mi.ScalarBoundingBox3f(mi.ScalarPoint3f(position.x[0], position.y[0], position.z[0]))

    def to_string(self):
        return f"LED[steps={self.steps}, angles={self.angles}]"


mi.register_emitter("led", lambda props: LED(props))
