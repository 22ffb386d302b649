"""LED lamp: points or discs with a beam profile and a spectrum, bare or behind a window, moving with their rig."""

import drjit as dr
import mitsuba as mi

from uwsim.render.lamp_window import FlatWindow
from uwsim.render.moving import Frames

_LEAST_M = 1e-9  # nearer, as where a place of scattering is rounded onto an LED, there is no direction to it


class LED(mi.Emitter):
    """One LED or several that shine alike, behind at most one window.

    | parameter | type | meaning |
    |---|---|---|
    | `poses` | (1, n, 12) tensor | rows 1-3 of world_from_lamp at n equal steps of the exposure [m]; beam along +z |
    | `intensity` | spectrum | intensity as calibrated, summed over the LEDs, each on its axis [W sr^-1 nm^-1] |
    | `profile` | (1, a, k) tensor | intensity over the axis'; a azimuths in a turn, k equal angles, 0 to 180 deg |
    | `leds` | (1, m, 12) tensor | rows 1-3 of lamp_from_led of each LED; default: one, in the lamp's origin |
    | `die_radius` | float | radius of the disc, normal to its axis, that each LED is; 0 (default): a point [m] |
    | `window` | string | `none` (default), `flat` or `dome` |
    | `front`, `thickness`, `radius` | float | flat: outer face from the LEDs' plane, glass, exit aperture [m] |
    | `n_glass`, `n_water`, `glass_absorption` | float | flat: indices relative to air, absorption [1/m] |
    | `through_window` | bool | flat: intensity calibrated behind the window in air, not without it |
    | `radius`, `transmittance` | float | dome: outer radius about the LED [m], flux in the water over that calibrated |
    | `cos_half_aperture` | float | dome: cosine of the largest angle at which light leaves it |

    `sample` stands for a place on the dies, uniform over all of them: the same number is always the same place. `value`
    is the spectral irradiance on a plane normal to the ray, without attenuation by the water, that all LEDs together
    would give from that place; its mean over `sample` is the lamp's. Light enters the water at `ds.p`, a distance
    `ds.dist` in the water away; `ds.uv` repeats `sample`. The emitter reads `time` of the illuminated point, in
    [0, 1) of the exposure. All numbers are held on the device: changing them compiles nothing again.

    Valid: unscattered light; the window wide against the offset of rays reflected inside it; no LED hides another.
    """

    def __init__(self, props):
        super().__init__(props)
        poses, profile = props["poses"], props["profile"]
        self.frames = Frames(poses.array)
        self.azimuths, self.angles = profile.shape[1], profile.shape[2]
        self.profile = mi.Float(profile.array)
        self.intensity = props["intensity"]
        self.leds = Frames(props["leds"].array) if "leds" in props else None
        self.count = 1 if self.leds is None else self.leds.count
        die_radius = props.get("die_radius", 0.0)
        self.has_die = die_radius > 0
        self.die_radius = dr.opaque(mi.Float, die_radius)
        self.window = props.get("window", "none")
        self._read_window(props)
        self.is_plain = self.window == "none" and self.leds is None and self.azimuths == 1 and not self.has_die
        self.m_flags = int(mi.EmitterFlags.DeltaPosition)

    def _read_window(self, props):
        if self.window == "flat":
            self.flat = FlatWindow(
                front_m=props["front"],
                thickness_m=props["thickness"],
                radius_m=props["radius"],
                n_glass=props["n_glass"],
                n_water=props["n_water"],
                glass_absorption_per_m=props["glass_absorption"],
                through_window=props["through_window"],
            )
        elif self.window == "dome":
            keys = ("radius", "transmittance", "cos_half_aperture")
            self.dome_radius, self.dome_transmittance, self.cos_half_aperture = (
                dr.opaque(mi.Float, props[key]) for key in keys
            )
            if self.leds is not None or self.has_die:
                raise ValueError("led: window dome: got several LEDs or a die, allowed: one point at its centre")
        elif self.window != "none":
            raise ValueError(f"led: window: got {self.window!r}, allowed: none, flat, dome")

    def traverse(self, callback):
        callback.put("intensity", self.intensity, mi.ParamFlags.Differentiable)
        callback.put("poses", self.frames.rows, mi.ParamFlags.NonDifferentiable)
        callback.put("profile", self.profile, mi.ParamFlags.NonDifferentiable)

    # ---- what the LEDs emit ----

    def _by_angle(self, row, angle):
        """Profile of one row at an angle to the axis."""
        position = angle * ((self.angles - 1) / dr.pi)
        low = dr.minimum(mi.UInt32(position), self.angles - 2)
        first = row * self.angles + low
        return dr.lerp(
            dr.gather(mi.Float, self.profile, first),
            dr.gather(mi.Float, self.profile, first + 1),
            position - mi.Float(low),
        )

    def _relative_intensity(self, direction):
        """Profile at a direction in the frame of an LED."""
        across = dr.square(direction.x) + dr.square(direction.y)
        angle = dr.atan2(dr.sqrt(across), direction.z)
        if self.azimuths == 1:
            return self._by_angle(0, angle)
        turn = dr.select(across > 1e-12, dr.atan2(direction.y, direction.x), 0.0) * (self.azimuths / dr.two_pi)
        turn = dr.select(turn < 0, turn + self.azimuths, turn)
        row = dr.minimum(mi.UInt32(turn), self.azimuths - 1)
        following = dr.select(row == self.azimuths - 1, 0, row + 1)
        return dr.lerp(self._by_angle(row, angle), self._by_angle(following, angle), turn - mi.Float(row))

    def _led(self, index):
        return None if self.leds is None else self.leds.number(index)

    def _place(self, sample):
        """Return the LED that a sample means (None: the only one, in the origin) and the point of its die."""
        point = mi.Point3f(0.0)
        index = mi.UInt32(0)
        if self.count > 1:
            scaled = sample.x * self.count
            index = dr.minimum(mi.UInt32(scaled), self.count - 1)
            sample = mi.Point2f(scaled - mi.Float(index), sample.y)
        if self.has_die:
            disc = self.die_radius * mi.warp.square_to_uniform_disk_concentric(sample)
            point = mi.Point3f(disc.x, disc.y, 0.0)
        led = self._led(index)
        return led, point if led is None else led.point_outside(point)

    def _emitted(self, led, direction):
        """Profile at a direction in the frame of the lamp."""
        return self._relative_intensity(direction if led is None else led.vector_inside(direction))

    # ---- how it arrives ----

    def _arrival(self, ref, sample):
        """Return how light from the place of a sample arrives, in the lamp's frame.

        Where it enters the water, the direction in which it arrives, the path in the water, irradiance over intensity
        on the axis, and the distance at which the source seems to be. Where there is no light: the point, direction
        and distance of the place itself.
        """
        led, place = self._place(sample)
        if self.window == "flat":
            return self._through_flat(ref, led, place)
        offset = ref - place
        distance = dr.maximum(dr.norm(offset), _LEAST_M)
        direction = offset / distance
        factor = dr.select(distance > _LEAST_M, self._emitted(led, direction) / dr.square(distance), 0.0)
        if self.window == "none":
            return place, direction, distance, factor, distance
        lit = (distance > self.dome_radius) & (direction.z >= self.cos_half_aperture)
        entry = place + dr.select(lit, self.dome_radius, 0.0) * direction
        path = dr.select(lit, distance - self.dome_radius, distance)
        return entry, direction, path, dr.select(lit, factor * self.dome_transmittance, 0.0), distance

    def _through_flat(self, ref, led, place):
        flat, gap = self.flat, self.flat.gap(place)
        offset = mi.Vector2f(ref.x - place.x, ref.y - place.y)
        lit = ref.z > flat.front
        depth = dr.select(lit, ref.z - flat.front, 1.0)
        tube = flat.tube(gap, dr.norm(offset), depth)
        per_air = offset / tube.per_tangent  # lateral step per depth in air
        exit_offset = per_air * (gap + flat.thickness / tube.glass_root)
        entry = mi.Point3f(place.x + exit_offset.x, place.y + exit_offset.y, flat.front)
        lit &= dr.square(entry.x) + dr.square(entry.y) <= dr.square(flat.radius)

        in_water = mi.Vector3f(per_air.x / tube.water_root, per_air.y / tube.water_root, 1.0)
        steepness = dr.norm(in_water)
        emitted = self._emitted(led, dr.normalize(mi.Vector3f(per_air.x, per_air.y, 1.0)))
        passed = flat.transmittance(tube.square, tube.glass_root, tube.water_root)
        factor = emitted * passed * flat.irradiance(tube)

        # without light: as from the paraxial image of the place
        image = mi.Point3f(place.x, place.y, flat.front - flat.n_water * (gap + flat.thickness / flat.n_glass))
        to_ref = ref - image
        straight = dr.maximum(dr.norm(to_ref), 1e-9)
        return (
            dr.select(lit, entry, image),
            dr.select(lit, in_water / steepness, to_ref / straight),
            dr.select(lit, depth * steepness, straight),
            dr.select(lit, factor, 0.0),
            dr.select(lit, flat.apparent_distance(tube), straight),
        )

    def sample_direction(self, ref, sample, active=True):
        frame = self.frames.at(ref.time)
        ds = dr.zeros(mi.DirectionSample3f)
        if self.is_plain:
            to_lamp = frame.origin - ref.p
            squared = dr.squared_norm(to_lamp)
            ds.p, ds.dist = frame.origin, dr.sqrt(squared)
            apart = ds.dist > _LEAST_M
            ds.d = to_lamp / dr.select(apart, ds.dist, 1.0)
            factor = self._by_angle(0, dr.safe_acos(dr.dot(frame.z, -ds.d))) / squared
            factor = dr.select(apart, factor, 0.0)
        else:
            entry, direction, ds.dist, factor, _ = self._arrival(frame.point_inside(ref.p), sample)
            ds.p, ds.d = frame.point_outside(entry), -frame.vector_outside(direction)
        ds.n, ds.uv, ds.time = -ds.d, sample, ref.time
        ds.pdf, ds.delta = 1.0, True
        ds.emitter = mi.EmitterPtr(self)
        return ds, (self._spectrum(ref, active) * factor) & active

    def _spectrum(self, ref, active):
        si = dr.zeros(mi.SurfaceInteraction3f)
        si.wavelengths = ref.wavelengths
        return self.intensity.eval(si, active)

    def eval_direction(self, ref, ds, active=True):
        return self.sample_direction(ref, ds.uv, active)[1]

    def source_seen_from(self, ref, sample, active=True):
        """Return the point in the world from which the light of a sample's place seems to come at `ref`.

        Near `ref` the irradiance changes as 1 / (distance to it)^2. Where the place gives no light: its paraxial image.
        """
        frame = self.frames.at(ref.time)
        if self.is_plain:
            return frame.origin
        _, direction, _, _, distance = self._arrival(frame.point_inside(ref.p), sample)
        return ref.p - frame.vector_outside(direction) * distance

    # ---- what a ray sees ----

    def seen(self, ray, active=True):
        """Return the distance in the water to the shining disc that a ray meets, and its radiance there.

        (infinity, 0) where it meets none. Radiance is that in the water, T n_water^2 times the one in air behind a
        window. Bodies and housings in between are for the caller to test.
        """
        if not self.has_die:
            return mi.Float(dr.inf), mi.Spectrum(0.0)
        frame = self.frames.at(ray.time)
        origin, direction = frame.point_inside(ray.o), frame.vector_inside(ray.d)
        if self.window == "flat":
            to_face, lit, origin, direction, gain = self.flat.backwards(origin, direction, mi.Bool(active))
        else:
            to_face, lit, gain = mi.Float(0.0), mi.Bool(active), mi.Float(1.0)
        if self.count > 1:
            distance, radiance = self._nearest_disc(origin, direction, lit)
        else:
            distance, radiance = self._disc(self._led(mi.UInt32(0)), origin, direction, lit)
        met = dr.isfinite(distance)
        in_water = to_face if self.window == "flat" else distance
        factor = dr.select(met, radiance * gain / (self.count * dr.pi * dr.square(self.die_radius)), 0.0)
        return dr.select(met, in_water, dr.inf), self._spectrum(ray, met) * factor

    def _disc(self, led, origin, direction, active):
        """Return the distance along a ray in air to the disc of an LED and profile / cosine there."""
        if led is not None:
            origin, direction = led.point_inside(origin), led.vector_inside(direction)
        facing = active & (direction.z < -1e-6)
        distance = -origin.z / dr.select(facing, direction.z, -1)
        point = origin + distance * direction
        met = facing & (distance > 0)
        met &= dr.square(point.x) + dr.square(point.y) <= dr.square(self.die_radius)
        relative = self._relative_intensity(-direction) / dr.select(facing, -direction.z, 1)
        return dr.select(met, distance, dr.inf), dr.select(met, relative, 0.0)

    @dr.syntax
    def _nearest_disc(self, origin, direction, active):
        nearest, radiance, index = mi.Float(dr.inf), mi.Float(0.0), mi.UInt32(0)
        while index < self.count:
            distance, found = self._disc(self.leds.number(index), origin, direction, active)
            radiance = dr.select(distance < nearest, found, radiance)
            nearest = dr.minimum(nearest, distance)
            index += 1
        return nearest, radiance

    def pdf_direction(self, ref, ds, active=True):
        return mi.Float(0.0)

    def eval(self, si, active=True):
        return mi.Spectrum(0.0)

    def bbox(self):
        position = self.frames.at(mi.Float(0.5)).origin
        return mi.ScalarBoundingBox3f(mi.ScalarPoint3f(position.x[0], position.y[0], position.z[0]))

    def to_string(self):
        return f"LED[steps={self.frames.count}, leds={self.count}, window={self.window}]"


mi.register_emitter("led", lambda props: LED(props))
