"""Formulas of the dissertation as printed, where they differ from the right ones; in radiance, without camera factors.

Irradiance in the image is pi T_l / (4 F^2) times radiance, the T_sb of eqs. 2.58 and 2.63, which is left out of all
terms alike; what 2.52 forgets (T_c) counts as put back, or no sum of its terms would have a unit.
"""

import numpy as np

from uwsim.formation.bands import PathTable
from uwsim.formation.direct import seen_range_m
from uwsim.formation.view import View

_ANGLES = np.linspace(np.pi / 2, np.pi, 721)


def backward_integral(view: View) -> np.ndarray:
    """Return the integral of beta over the angle, (61,), in 1/(m sr) times radians, as eqs. 2.59 and 2.64 print it.

    The set of angles Theta is not defined there; here it is 90 to 180 degrees: all angles would include the forward
    peak, over which the integral of measured phase functions diverges in this measure.
    Errata: the measure of solid angle (2 pi sin) is missing, and light arrives from one direction only.
    """
    density = view.water.phase.density_at(_ANGLES)
    return view.water.scattering * np.trapezoid(density, _ANGLES, axis=0)


def lamp_backscatter(view: View, *, spectral: bool = True) -> np.ndarray:
    """Return B_ba (1 - exp(-c d_c)), summed over the lamps, (H, W, 3) float32: radiance in the water.

    B_ba = E_a / c x the integral of beta, with E_a = I e^(-c d_a) / d_a^2 at the point seen.
    Pixels that see no body have no d_a: they get none.
    Source: dissertation eqs. 2.64 and 2.65 (with 2.41 for E_a, without its convolution). The place of E_a,
    (x'_vs, y'_vs, z'_vs), is not defined; the only one that the formula knows is that of the point seen.
    Errata: a lamp's irradiance varies as 1/r^2 along the ray, so that nothing saturates with 1/c: `airlight.single`.
    """
    seen, range_m = view.has_body, seen_range_m(view)
    total = np.zeros((*view.shape, 3), np.float32)
    for lamp in view.lamps:
        came = lamp.arriving(view.points_m)
        path = np.where(seen, came.path_m, 0).astype(np.float32)
        irradiance = np.where(seen, came.irradiance_per_intensity, 0).astype(np.float32)
        total += _veil(view, lamp.spectrum, path, range_m, spectral=spectral) * irradiance[..., None]
    return total


def sun_backscatter(view: View, *, spectral: bool = True) -> np.ndarray:
    """Return B_inf (1 - exp(-c d_c)), (H, W, 3) float32: radiance in the water; zeros without sun.

    B_inf = E_s / c x the integral of beta, with E_s the sun's irradiance at the camera; infinite range included.
    Source: dissertation eqs. 2.59 and 2.60 (2.56 for E_s, without its convolution).
    Errata: see `sunlight.sun_backscatter`.
    """
    if view.daylight is None:
        return np.zeros((*view.shape, 3), np.float32)
    origins = np.where(view.has_ray[..., None], view.origins_m, 0.0)
    path = view.daylight.sun_path_m(origins).astype(np.float32)
    range_m = np.where(view.has_ray, view.range_m, 0).astype(np.float32)
    return _veil(view, view.daylight.sun_irradiance, path, range_m, spectral=spectral)


def _veil(view: View, spectrum: np.ndarray, path_m: np.ndarray, range_m: np.ndarray, *, spectral: bool) -> np.ndarray:
    """Return spectrum x integral of beta / c x e^(-c path) (1 - e^(-c range)), (H, W, 3)."""
    attenuation = np.maximum(view.water.attenuation, 1e-12)
    table = PathTable(view, spectrum * backward_integral(view) / attenuation, spectral=spectral)
    return table(path_m) - table(path_m + range_m)
