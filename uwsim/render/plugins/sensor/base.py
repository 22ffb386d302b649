"""What the sensors share: from a place in the image and a time to a ray in the water, on a path and row by row."""

import drjit as dr
import mitsuba as mi

_NEWTON_STEPS = 12
_MISSED = 2e-6  # of the distorted coordinates; float32 leaves some 1e-7


class WaterSensor(mi.Sensor):
    """Lens on a moving rig whose rays start in the water; subclasses say how they get there from the lens.

    | parameter | type | meaning |
    |---|---|---|
    | `poses` | (1, n, 12) tensor | rows 1-3 of world_from_camera at n equal steps of the span [m]; camera along +z |
    | `inverse_K` | (1, 9, 1) tensor | inverse of K [1/px], rows first |
    | `distortion` | (1, 9, 1) tensor, optional | k1 k2 p1 p2 k3 k4 k5 k6 (OpenCV), and the radius of the fold [1] |
    | `exposure_share` | float, 1 | share of the span that one row is exposed; the rows start one after the other |

    The span goes from the first row's start to the last one's end; `time` of the rays is its share that is over, in
    [0, 1). Film, sampler and medium are nested as in Mitsuba's own sensors. All numbers are opaque: new ones do not
    compile anew.
    """

    def __init__(self, props):
        super().__init__(props)
        poses = props["poses"]
        self.steps = dr.opaque(mi.UInt32, poses.shape[1])
        self.poses = mi.Float(poses.array)
        self.inverse_K = _numbers(props, "inverse_K")
        self.coefficients = _numbers(props, "distortion") if "distortion" in props else None
        self.exposure_share = dr.opaque(mi.Float, props.get("exposure_share", 1.0))
        self.height = dr.opaque(mi.Float, float(self.film().size()[1]))

    def traverse(self, callback):
        callback.put("poses", self.poses, mi.ParamFlags.NonDifferentiable)

    def leave(self, direction):
        """Return origin and unit direction in the water of a ray from the lens, in the camera frame, and its weight.

        The weight is radiance in the camera over that in the water; 0 where there is no ray, all finite.
        """
        raise NotImplementedError

    def rays(self, place, time):
        """Return rays from places in the image [px] at times in [0, 1) of the exposure there, and their weights."""
        m = self.inverse_K
        inverse_K = mi.Matrix3f([m[0:3], m[3:6], m[6:9]])
        lens, weight = inverse_K @ mi.Vector3f(place.x, place.y, 1.0), mi.Float(1.0)
        if self.coefficients is not None:
            lens, is_imaged = _undistorted(lens, self.coefficients)
            weight = dr.select(is_imaged, weight, 0.0)
        origin, direction, passed = self.leave(lens)
        row = (dr.floor(place.y) + 0.5) / self.height
        time = self.exposure_share * time + (1 - self.exposure_share) * row
        to_world, position = self._pose(time)
        # the direction is normalised in the world: the rotation of the table is one to float32 only
        ray = mi.Ray3f(position + to_world @ origin, dr.normalize(to_world @ direction))
        ray.time = time
        return ray, weight * passed

    def _pose(self, time):
        """Return rotation and position of the camera in the world at `time`."""
        step = dr.minimum(mi.UInt32(time * mi.Float(self.steps)), self.steps - 1)
        m = [dr.gather(mi.Float, self.poses, step * 12 + k) for k in range(12)]
        return mi.Matrix3f([[m[0], m[1], m[2]], [m[4], m[5], m[6]], [m[8], m[9], m[10]]]), mi.Vector3f(
            m[3], m[7], m[11]
        )

    def sample_ray(self, time, wavelength_sample, position_sample, aperture_sample, active=True):
        film = self.film()
        size, corner = film.crop_size(), film.crop_offset()
        place = mi.Point2f(position_sample.x * size[0] + corner[0], position_sample.y * size[1] + corner[1])
        ray, weight = self.rays(place, time)
        wavelengths, spectral = self.sample_wavelengths(dr.zeros(mi.SurfaceInteraction3f), wavelength_sample, active)
        ray.wavelengths = wavelengths
        return ray, (spectral * weight) & active

    def sample_ray_differential(self, time, wavelength_sample, position_sample, aperture_sample, active=True):
        ray, weight = self.sample_ray(time, wavelength_sample, position_sample, aperture_sample, active)
        return mi.RayDifferential3f(ray), weight

    def bbox(self):
        m = [self.poses[k] for k in (3, 7, 11)]
        return mi.ScalarBoundingBox3f(mi.ScalarPoint3f(*m))

    def to_string(self):
        return f"{type(self).__name__}[steps={self.steps[0]}]"


def _numbers(props, name):
    """Return the entries of a parameter as opaque numbers."""
    return [dr.opaque(mi.Float, float(value)) for value in props[name].array.numpy()]


def _undistorted(lens, coefficients):
    """Return the direction (x, y, 1) that the distortion makes the direction `lens`, and where there is one.

    Newton's method, kept before the fold of the distortion.
    Source: as `uwsim.camera.distortion`.
    """
    target = mi.Point2f(lens.x / lens.z, lens.y / lens.z)
    fold = coefficients[8]
    guess = mi.Point2f(target) * dr.minimum(1.0, 0.8 * fold / dr.maximum(dr.norm(target), 1e-20))
    for _ in range(_NEWTON_STEPS):
        reached, slopes = _distorted(guess, coefficients)
        missing = target - reached
        xx, xy, yy = slopes
        determinant = xx * yy - xy * xy
        step = mi.Point2f(yy * missing.x - xy * missing.y, xx * missing.y - xy * missing.x) / determinant
        trial = guess + step
        # beyond the fold: half of the way that is left
        radius, before = dr.norm(trial), dr.norm(guess)
        trial = dr.select(radius < fold, trial, trial * (0.5 * (before + fold) / radius))
        guess = dr.select(dr.isfinite(trial.x) & dr.isfinite(trial.y), trial, guess)
    missing = dr.norm(target - _distorted(guess, coefficients)[0])
    return mi.Vector3f(guess.x, guess.y, 1.0), missing < _MISSED * (1 + dr.norm(target))


def _distorted(point, coefficients):
    """Return distorted coordinates, and their derivatives dx/dx, dx/dy = dy/dx, dy/dy."""
    k1, k2, p1, p2, k3, k4, k5, k6, _ = coefficients
    x, y = point.x, point.y
    s = x * x + y * y
    numerator, denominator = 1 + s * (k1 + s * (k2 + s * k3)), 1 + s * (k4 + s * (k5 + s * k6))
    radial = numerator / denominator
    slope = (k1 + s * (2 * k2 + 3 * k3 * s) - radial * (k4 + s * (2 * k5 + 3 * k6 * s))) / denominator
    distorted = mi.Point2f(
        x * radial + 2 * p1 * x * y + p2 * (s + 2 * x * x), y * radial + p1 * (s + 2 * y * y) + 2 * p2 * x * y
    )
    mixed = 2 * x * y * slope + 2 * p1 * x + 2 * p2 * y
    xx = radial + 2 * x * x * slope + 2 * p1 * y + 6 * p2 * x
    yy = radial + 2 * y * y * slope + 6 * p1 * y + 2 * p2 * x
    return distorted, (xx, mixed, yy)


def refract(direction, normal, ratio):
    """Return the direction behind a face and its cosine to the normal; `ratio`: index before over that behind."""
    tangential = ratio * (direction - dr.dot(direction, normal) * normal)
    cosine = dr.safe_sqrt(1 - dr.squared_norm(tangential))
    return tangential + cosine * normal, cosine


def reflectances(cos_before, cos_behind, n_before, n_behind):
    """Return the shares of power that a face reflects of the s and the p polarisation.

    Source: Fresnel equations (Born & Wolf, Principles of Optics, 1.5.2), squared amplitudes.
    """
    s = (n_before * cos_before - n_behind * cos_behind) / (n_before * cos_before + n_behind * cos_behind)
    p = (n_behind * cos_before - n_before * cos_behind) / (n_behind * cos_before + n_before * cos_behind)
    return dr.square(s), dr.square(p)


def transmittance(inner, outer, passed):
    """Return the share of unpolarised power through glass with inter-reflections.

    `inner`, `outer`: reflectances of its faces, `passed`: share that one passage through the glass does not absorb.
    Source: as `uwsim.optics.fresnel.slab`.
    """
    shares = [(1 - a) * (1 - b) * passed / (1 - a * b * passed * passed) for a, b in zip(inner, outer, strict=True)]
    return 0.5 * (shares[0] + shares[1])
