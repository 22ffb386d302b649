"""The lens, from radiance in the camera to irradiance on the sensor: the factors of eqs. 2.30, 2.35, 2.45 and 2.50."""

import numpy as np

from uwsim.optics.checks import require


def lens_factor(
    cos_angle: np.ndarray, *, f_number: float, transmittance: float = 1.0, focal_length_m: float = 0.0,
    focus_distance_m: float = np.inf,
) -> np.ndarray:  # fmt: skip
    """Return irradiance on the sensor over radiance, pi T cos^4 / (4 N^2) [(R_f - f) / R_f]^2, (...) -> (...). [sr]

    `cos_angle` to the optical axis in the camera; focused at `focus_distance_m` from the lens along its axis. The same
    for light of surfaces and of the water, so that formation models give radiance and no layer has a factor of its own.
    Raises ValueError for a cosine out of 0 to 1, and a focus nearer than the focal length.
    Source: thin lens; dissertation eqs. 2.30 (with radiance M E / pi), 2.45, 2.47, 2.50, 2.58, 2.63.
    Errata: the bracket is that of the focus, one for the whole picture; printed with the range of what is seen, it
    diverges for backscatter near the lens (2.35, 2.55, 2.61; dropped in 2.51, 2.57, 2.62). 2.35's cos^3 is cos^4 of the
    lens over the cosine of a slant path through a slab. 2.50 and 2.58 drop the cosines, 2.52 the whole factor.
    """
    cosine = require("lens cos_angle", cos_angle, least=0, most=1 + 1e-9)
    number = require("lens f_number", f_number, above=0)
    passed = require("lens transmittance", transmittance, least=0, most=1)
    focal = float(require("lens focal_length_m", focal_length_m, least=0))
    if not focus_distance_m > focal:
        raise ValueError(f"lens focus_distance_m: got {focus_distance_m}, allowed: above the focal length {focal:g}")
    extension = 1.0 - focal / focus_distance_m
    return np.pi * passed * cosine**4 / (4 * number**2) * extension**2
