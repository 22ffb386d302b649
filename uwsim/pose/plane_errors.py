"""Errors of the angles of a flat target of four markers, by the formulas quoted from Qu and Hou and corrected."""

from itertools import combinations
from typing import NamedTuple, get_args

import numpy as np

from uwsim.pose.error_model import Form

_SQUARE_SHARE = 5e-3  # of lengths: what a square may be off without telling in the errors, 2 % of them
_FLAT_SHARE = 1e-4  # of half an edge: at 100 edges a hundredth of what perspective shows face-on


class AngleErrors(NamedTuple):
    """Standard deviations [rad], (...): about the line of sight, about the axis of the tilt, and about the third."""

    azimuth_rad: np.ndarray
    tilt_rad: np.ndarray
    across_rad: np.ndarray

    @property
    def rotation_rad(self) -> np.ndarray:
        """Root mean square of the angle of the whole rotation [rad]."""
        return np.sqrt(self.azimuth_rad**2 + self.tilt_rad**2 + self.across_rad**2)


class Square(NamedTuple):
    """A square in the target's axes: `centre_m` (3,), unit `normal` (3,) of its plane, and half its edge."""

    centre_m: np.ndarray
    normal: np.ndarray
    arm_m: float


def square_of(points_m: np.ndarray) -> Square | None:
    """Return the square that points (n, 3) [m] are the corners of, in any order and anywhere; None if they are none."""
    if len(points_m) != 4:
        return None
    centre_m = points_m.mean(axis=0)
    around_m = points_m - centre_m
    _, spread_m, axes = np.linalg.svd(around_m)
    arm_m = float(np.sqrt(np.sum(around_m**2) / 8))
    between_m = np.sort([np.linalg.norm(a - b) for a, b in combinations(points_m, 2)])
    wanted_m = 2 * arm_m * np.sqrt([1, 1, 1, 1, 2, 2])
    if spread_m[2] > _FLAT_SHARE * arm_m or np.any(np.abs(between_m / wanted_m - 1) > _SQUARE_SHARE):
        return None
    return Square(centre_m, axes[2], arm_m)


def square_errors(
    square: Square, rotation: np.ndarray, translation_m: np.ndarray, *, noise_px: float, focal_px: float,
    form: Form = "corrected",
) -> AngleErrors:  # fmt: skip
    """Return the angles' errors of a square at poses camera_from_target (..., 3, 3), (..., 3), on the axis or off it.

    The tilt is the angle of the plane's normal to the line of sight to the square's centre. Corrected, the distance is
    that along the line of sight, and the noise is what a camera turned to the centre would have: at an angle a to the
    optical axis an image point moves by cos^2 a as much along the radius and by cos a across it, here the mean of both
    variances. As printed, the distance is the depth.

    Source: this project, on `angle_errors`.
    Valid: as `angle_errors`; off the axis the rotation, as root mean square over the target's orientations, within 2 %
    of the bound up to 27 deg, within 17 % up to 63 deg.
    """
    centre_m = rotation @ square.centre_m + translation_m
    normal = rotation @ square.normal
    range_m, depth_m = np.linalg.norm(centre_m, axis=-1), centre_m[..., 2]
    along = np.sum(normal * centre_m, axis=-1)
    tilt_rad = np.arctan2(np.linalg.norm(np.cross(normal, centre_m), axis=-1), np.abs(along))
    given = {"tilt_rad": tilt_rad, "arm_m": square.arm_m, "focal_px": focal_px, "form": form}
    if form != "corrected":
        return angle_errors(**given, distance_m=depth_m, noise_px=noise_px)
    cosine = depth_m / range_m
    return angle_errors(**given, distance_m=range_m, noise_px=noise_px * cosine * np.sqrt((1 + cosine**2) / 2))


def angle_errors(
    *, tilt_rad: np.ndarray, distance_m: np.ndarray, arm_m: float, noise_px: float | np.ndarray, focal_px: float,
    form: Form = "corrected",
) -> AngleErrors:  # fmt: skip
    """Return the angles' errors of a square of four points on the optical axis, its plane tilted by `tilt_rad`.

    `arm_m`: half of the square's edge. With s = noise_px / (2 focal_px), D = distance_m / arm_m and t the tilt:
    tilt and across s D sqrt(1 + cos^2 t) / sin t where the tilt itself is seen, and s D^2 by perspective alone where it
    is not, information from both added; azimuth s D, less what perspective adds to it,
    sqrt(1 - cos^2 t / (1 + cos^2 t + D^2 sin^2 t)).

    Source: Qu and Hou 2019 in dissertation 5.11-5.13. Their l, "the distance of a neighbouring point", is read as
    half an edge: only so do they hold for a square at right angles to the axis. The rest: this project.
    Valid: square about the axis, and no other figure: the first power of D goes with the points' spread, which has to
    be the same in all directions of the plane, its square with the moment of x y, the one part of the image that no
    affine motion makes of four points. The rotation within 2 % of the bound, each angle within 5 %, at a distance of 5
    edges and beyond and at every tilt; within 15 % at 1.2 edges.
    Errata: 5.12 and 5.13 go with cos t, which leaves no error at all for a plane seen edge-on; they hold next to
    t = 0, and elsewhere the error falls by 1 / sin t and with the first power of D. 5.11 is too high by sqrt(2) at
    t = 0.
    ValueError for another form, and for lengths and noise that are none.
    """
    if form not in get_args(Form):
        raise ValueError(f"angle errors: form is {form!r}, allowed: {', '.join(get_args(Form))}")
    for name, value in (("arm_m", arm_m), ("focal_px", focal_px), ("distance_m", np.min(distance_m))):
        if not value > 0:
            raise ValueError(f"angle errors: {name} is {value}, allowed: above 0")
    if not np.min(noise_px) >= 0:
        raise ValueError(f"angle errors: noise_px is {np.min(noise_px)}, allowed: 0 and above")
    half, ratio = np.asarray(noise_px) / (2 * focal_px), np.asarray(distance_m, float) / arm_m
    azimuth, across = half * ratio, half * ratio**2
    cosine, sine = np.cos(tilt_rad), np.sin(tilt_rad)
    tilt = across * np.abs(cosine)
    if form == "corrected":
        # seen without perspective, tilt and azimuth have the covariance -cos t / sin t (s D)^2
        azimuth = azimuth * np.sqrt(1 - cosine**2 / (1 + cosine**2 + (ratio * sine) ** 2))
        tilt = across = half / np.hypot(1 / ratio**2, sine / (ratio * np.sqrt(1 + cosine**2)))
    return AngleErrors(*np.broadcast_arrays(azimuth, tilt, across))
