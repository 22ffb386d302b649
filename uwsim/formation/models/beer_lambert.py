"""J t + A (1 - t): the formula of restoration papers, with one transmission for what is seen and for the veil."""

import numpy as np

from uwsim.formation.bands import PathTable
from uwsim.formation.direct import in_camera, reflected, require_no_daylight, seen_range_m
from uwsim.formation.veil import veiling_light
from uwsim.formation.view import View
from uwsim.optics.checks import require

PARAMETERS: dict[str, tuple[float, float]] = {"attenuation_relative": (0.0, 6.0), "veil_relative": (0.0, 20.0)}


def layers(
    view: View, *, spectral: bool = True, attenuation_relative: float = 1.0, veil_relative: float = 1.0
) -> dict[str, np.ndarray]:
    """Return `direct` = J t, `backscatter` = A (1 - t) and their sum `radiance`, (H, W, 3) float32.

    J: the picture without water; t = exp(-c R) with the range R from the camera; A: `veil.veiling_light`, mean over the
    picture of the lamps' light scattered once without end. Physics has no parameter left; fitted to a picture, the
    attenuation is `attenuation_relative` times that of the water (its colour kept) and A `veil_relative` times its own.
    `spectral` False: t, J and A by three bands.
    Source: Schechner & Karpel 2005, IEEE J. Ocean. Eng. 30:570; Chiang & Chen 2012, IEEE Trans. Image Process. 21:1756;
    dissertation eqs. 2.52, 2.60 and 2.67 are this formula with J t = J_s e^(-c (d_s + d_c)) + ...
    Valid: light that does not depend on the range: daylight on horizontal rays; lamps far away. It leaves out what the
    water takes between lamp and body, and saturates with 1/c instead of with the lamp's distance from the ray.
    Raises ValueError for daylight and for negative parameters.
    """
    require_no_daylight(view, "beer_lambert")
    relative = float(require("beer_lambert: attenuation_relative", attenuation_relative, least=0))
    strength = float(require("beer_lambert: veil_relative", veil_relative, least=0))
    direct = reflected(view, relative * seen_range_m(view), spectral=spectral)
    backscatter = veil(view, relative * _range(view), spectral=spectral) * np.float32(strength)
    return in_camera(view, direct=direct, backscatter=backscatter)


def _range(view: View) -> np.ndarray:
    """Return the range (H, W), infinite without a body, 0 without a ray."""
    return np.where(view.has_ray, view.range_m, 0).astype(np.float32)


def veil(view: View, path_m: np.ndarray, *, spectral: bool = True) -> np.ndarray:
    """Return A (1 - exp(-c path)), (H, W, 3) float32; A has the spectrum of the lamps times b.

    An infinite path with a relative attenuation of 0 counts as 0.
    """
    light = sum((lamp.spectrum for lamp in view.lamps), np.zeros(61))
    table = PathTable(view, np.stack([light, view.water.scattering]), spectral=spectral)
    scale = veiling_light(view, spectral=spectral) / np.where(table.at_zero > 0, table.at_zero, 1)
    path = np.where(np.isnan(path_m), 0, path_m).astype(np.float32)
    found = table(path)
    np.subtract(table.at_zero.astype(np.float32), found, out=found)
    found *= scale.astype(np.float32)
    # rounding at range 0
    return np.maximum(found, 0, out=found)
