"""Errors of the angles of a flat target of four markers, by the formulas quoted from Qu and Hou and corrected."""

from typing import NamedTuple, get_args

import numpy as np

from uwsim.pose.error_model import Form


class AngleErrors(NamedTuple):
    """Standard deviations [rad], (...): about the optical axis, about the axis of the tilt, and about the third."""

    azimuth_rad: np.ndarray
    tilt_rad: np.ndarray
    across_rad: np.ndarray

    @property
    def rotation_rad(self) -> np.ndarray:
        """Root mean square of the angle of the whole rotation [rad]."""
        return np.sqrt(self.azimuth_rad**2 + self.tilt_rad**2 + self.across_rad**2)


def angle_errors(
    *, tilt_rad: np.ndarray, distance_m: np.ndarray, arm_m: float, noise_px: float, focal_px: float,
    form: Form = "corrected",
) -> AngleErrors:  # fmt: skip
    """Return the angles' errors of a square of four points on the optical axis, its plane tilted by `tilt_rad`.

    `arm_m`: half of the square's edge. With s = noise_px / (2 focal_px), D = distance_m / arm_m and t the tilt:
    tilt and across s D sqrt(1 + cos^2 t) / sin t where the tilt itself is seen, and s D^2 by perspective alone where it
    is not, information from both added; azimuth s D, less what perspective adds to it,
    sqrt(1 - cos^2 t / (1 + cos^2 t + D^2 sin^2 t)).

    Source: Qu and Hou 2019 in dissertation 5.11-5.13. Their l, "the distance of a neighbouring point", is read as
    half an edge: only so do they hold for a square at right angles to the axis. The rest: this project.
    Valid: square about the axis; the rotation within 2 % of the bound, each angle within 5 %, at a distance of 5 edges
    and beyond and at every tilt.
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
    if not noise_px >= 0:
        raise ValueError(f"angle errors: noise_px is {noise_px}, allowed: 0 and above")
    half, ratio = noise_px / (2 * focal_px), np.asarray(distance_m, float) / arm_m
    azimuth, across = half * ratio, half * ratio**2
    cosine, sine = np.cos(tilt_rad), np.sin(tilt_rad)
    tilt = across * np.abs(cosine)
    if form == "corrected":
        # seen without perspective, tilt and azimuth have the covariance -cos t / sin t (s D)^2
        azimuth = azimuth * np.sqrt(1 - cosine**2 / (1 + cosine**2 + (ratio * sine) ** 2))
        tilt = across = half / np.hypot(1 / ratio**2, sine / (ratio * np.sqrt(1 + cosine**2)))
    return AngleErrors(*np.broadcast_arrays(azimuth, tilt, across))
