"""How noise in the image reaches a line segment of the target: its length, its angle to the optical axis, its weight.

The dissertation's error transfer 5.22-5.30 under para-perspective projection, corrected; each printed form is
`form="as_printed"`. One segment says little about a pose from all points: `uwsim.pose.bound` has the whole answer.
"""

from typing import Literal, NamedTuple, get_args

import numpy as np

Form = Literal["corrected", "as_printed"]


class Segments(NamedTuple):
    """Segments from points at `origin_m` (..., 3) along `along_m` (..., 3) [m], both in the axes of the camera."""

    origin_m: np.ndarray
    along_m: np.ndarray

    @property
    def depth_m(self) -> np.ndarray:
        """z of the origin [m], (...)."""
        return self.origin_m[..., 2]

    @property
    def origin(self) -> np.ndarray:
        """Image of the origin on the plane z = 1, (..., 2)."""
        return self.origin_m[..., :2] / self.origin_m[..., 2:]

    @property
    def image(self) -> np.ndarray:
        """Para-perspective image of the segment on the plane z = 1, (..., 2): 5.25."""
        return (self.along_m[..., :2] - self.origin * self.along_m[..., 2:]) / self.origin_m[..., 2:]

    @property
    def length_m(self) -> np.ndarray:
        """Length [m], (...)."""
        return np.linalg.norm(self.along_m, axis=-1)

    @property
    def angle_rad(self) -> np.ndarray:
        """Angle to the optical axis [rad], (...): 0 away from the camera, pi towards it."""
        return np.arctan2(np.linalg.norm(self.along_m[..., :2], axis=-1), self.along_m[..., 2])


class Rates(NamedTuple):
    """What a segment's length and angle change by, all (...), per unit on the plane z = 1 or per radian.

    `length_by_image_m`, `angle_by_image_rad`: by the image of its far end; `length_by_origin_m`,
    `angle_by_origin_rad`: by the image of its origin; `length_by_angle_m`: by the angle, at one image.
    """

    length_by_image_m: np.ndarray
    length_by_origin_m: np.ndarray
    length_by_angle_m: np.ndarray
    angle_by_image_rad: np.ndarray
    angle_by_origin_rad: np.ndarray


def segments(points_m: np.ndarray, rotation: np.ndarray, translation_m: np.ndarray) -> Segments:
    """Return segments (..., n) from a target's origin to its points (n, 3) [m] at poses (..., 3, 3), (..., 3).

    Raises ValueError for an origin that is not before the camera and for points in the origin.
    """
    points_m, translation_m = np.asarray(points_m, float), np.asarray(translation_m, float)
    if not np.all(translation_m[..., 2] > 0):
        raise ValueError(f"segments: origin at z = {np.min(translation_m[..., 2]):g} m, allowed: above 0 m")
    if not np.all(np.linalg.norm(points_m, axis=-1) > 0):
        raise ValueError("segments: got a point in the target's origin, allowed: points that make a segment with it")
    along_m = points_m @ np.swapaxes(rotation, -1, -2)
    return Segments(np.broadcast_to(translation_m[..., None, :], along_m.shape), along_m)


def rates(found: Segments, *, form: Form = "corrected") -> Rates:
    """Return how length and angle answer to the image, at a known depth of the origin.

    Corrected, they are the lengths of the derivatives by image points, so that equal independent noise on both axes of
    a point makes a deviation of rate times noise. With e the image of the origin, n the segment's direction, r its
    part across the axis over sin b, z the depth of the origin and z' = z - d cos b:
    angle by far end z / (d |cos b + e.r sin b|), length by far end z / |n_xy - e n_z|; by the origin z' instead of z.

    Source: dissertation 5.28 and 5.29 from 5.26 and 5.27.
    Valid: segments short against the depth. The angle is open (infinite) for a segment across the line of sight, the
    length for one along it.
    Errata: 5.27 has cos b where the variance of 2 d^2 sin b cos b db has its square, so that 5.28 and 5.29 print
    sqrt(cos b) for cos b; it takes m and its parts u, v for separate measurements and drops that e moves with the
    origin. m_o is no small or large factor: the origin's image counts as much as the far end's, by z' / z. As
    m = d sin b / z the angle goes by z / (d cos b) on the axis: the depth's first power, no least value at 54.7 deg.
    """
    _check_form(form)
    return _rates_as_printed(found) if form == "as_printed" else _rates(found)


def errors(found: Segments, *, noise: float, form: Form = "corrected") -> tuple[np.ndarray, np.ndarray]:
    """Return standard deviations (...) of length [m] and angle [rad] from `noise` of each coordinate of both ends.

    `noise` is on the plane z = 1: pixels by focal length. Valid and Errata: see `rates`.
    """
    _check_noise(noise)
    rate = rates(found, form=form)
    length_m = noise * np.hypot(rate.length_by_image_m, rate.length_by_origin_m)
    return length_m, noise * np.hypot(rate.angle_by_image_rad, rate.angle_by_origin_rad)


def weights(found: Segments, *, form: Form = "corrected") -> np.ndarray:
    """Return weights (...) of squared lengths in a least-squares fit, to a common factor.

    Corrected: the inverse variance of the squared length, 1 / (2 d sigma_d)^2, on the plane z = 1.
    Valid: for one length. Several lengths of one target share noise: diagonal weights gain nothing there, and
    `solvers.parallel_covariance` takes the full covariance.
    Source: dissertation 5.30, d^2 / (z^2 m_o m).
    Errata: a product of two rates is no variance, the residual is a squared length, and with the origin on the axis,
    m_o = 0, the printed weight is infinite.
    """
    _check_form(form)
    if form == "as_printed":
        size, off_axis = np.linalg.norm(found.image, axis=-1), np.linalg.norm(found.origin, axis=-1)
        with np.errstate(divide="ignore"):
            return found.length_m**2 / (found.depth_m**2 * off_axis * size)
    deviation_m, _ = errors(found, noise=1.0)
    return 1 / (2 * found.length_m * deviation_m) ** 2


def angle_factor(angle_rad: np.ndarray, *, form: Form = "corrected") -> np.ndarray:
    """Return how the error of a segment's angle depends on that angle: 1 / cos b, on the optical axis.

    As printed: 1 / (sin b sqrt(cos b)), which has a least value of 1.6119 at 54.7356 deg.
    Source: dissertation, after Figure 5.24.
    Errata: the printed factor leaves out that m is proportional to sin b, and has the root of 5.27; what is called its
    inflection is its minimum. The factor of the physics rises throughout.
    """
    _check_form(form)
    sine, cosine = np.sin(angle_rad), np.cos(angle_rad)
    with np.errstate(divide="ignore", invalid="ignore"):
        return 1 / (sine * np.sqrt(cosine)) if form == "as_printed" else 1 / cosine


def _rates(found: Segments) -> Rates:
    length_m, depth_m = found.length_m, found.depth_m
    direction = found.along_m / length_m[..., None]
    across, cosine = direction[..., :2], direction[..., 2]
    sine = np.linalg.norm(across, axis=-1)
    # a segment along the axis tilts in whatever direction: any unit vector serves
    radial = np.where(sine[..., None] > 0, across / np.where(sine > 0, sine, 1.0)[..., None], [1.0, 0.0])
    offset = np.sum(found.origin * radial, axis=-1)
    seen = np.linalg.norm(across - found.origin * cosine[..., None], axis=-1)
    turned = cosine + offset * sine
    near_m = depth_m - found.along_m[..., 2]
    with np.errstate(divide="ignore", over="ignore"):
        return Rates(
            depth_m / seen,
            np.abs(near_m) / seen,
            length_m * np.abs(turned) / np.abs(sine - offset * cosine),
            depth_m / (length_m * np.abs(turned)),
            np.abs(near_m) / (length_m * np.abs(turned)),
        )


def _rates_as_printed(found: Segments) -> Rates:
    length_m, depth_m, angle_rad = found.length_m, found.depth_m, found.angle_rad
    # the angle of a line and the axis is at most a right one
    sine, root = np.sin(angle_rad), np.sqrt(np.abs(np.cos(angle_rad)))
    by_image = depth_m**2 * np.linalg.norm(found.image, axis=-1)
    by_off_axis = found.along_m[..., 2] ** 2 * np.linalg.norm(found.origin, axis=-1)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        along, turned = length_m * sine**2, length_m**2 * sine * root
        return Rates(
            by_image / along, by_off_axis / along, length_m * root / sine, by_image / turned, by_off_axis / turned
        )


def _check_form(form: str) -> None:
    if form not in get_args(Form):
        raise ValueError(f"error model: form is {form!r}, allowed: {', '.join(get_args(Form))}")


def _check_noise(noise: float) -> None:
    if not (np.isfinite(noise) and noise >= 0):
        raise ValueError(f"error model: noise is {noise}, allowed: 0 and above")
