"""Single-scattered light of a point lamp that a camera ray collects in homogeneous water."""

import math
from collections.abc import Callable

import numpy as np
from scipy import integrate, special

from uwsim.optics.checks import require

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(400)


def _lamp(*, lamp_offset_m: float, path_m: float, scattering_per_m: float, attenuation_per_m: float) -> None:
    require("airlight lamp_offset_m", lamp_offset_m, above=0)
    require("airlight path_m", path_m, least=0)
    require("airlight scattering_per_m", scattering_per_m, least=0)
    require("airlight attenuation_per_m (absorption and scattering)", attenuation_per_m, least=scattering_per_m)


def airlight(
    *,
    lamp_offset_m: float,
    path_m: float,
    scattering_per_m: float,
    attenuation_per_m: float,
    phase: Callable[[np.ndarray], np.ndarray],
    intensity_w_per_sr: float = 1.0,
    lamp_ahead_m: float = 0.0,
) -> float:
    """Return the radiance along a ray of length `path_m` from an isotropic lamp beside it. [W/(m^2 sr)]

    The lamp is `lamp_offset_m` off the ray and `lamp_ahead_m` along it; `phase` maps cosines to 1/sr.
    Source: L = integral of I beta(psi) exp(-c (s + r)) / r^2 ds; with s = s_0 + h tan(e), ds / r^2 = de / h, by
    Gauss-Legendre (400 nodes in e).
    Valid: single scattering; 1e-8 for phase functions smooth over a degree, and for any seen only from the side.
    Errata: replaces dissertation eqs. 2.64-2.65, whose 1 - exp(-c d) assumes a lamp of constant irradiance.
    """
    _lamp(lamp_offset_m=lamp_offset_m, path_m=path_m, scattering_per_m=scattering_per_m,
          attenuation_per_m=attenuation_per_m)  # fmt: skip
    require("airlight intensity_w_per_sr", intensity_w_per_sr, least=0)
    require("airlight lamp_ahead_m", lamp_ahead_m)
    h = lamp_offset_m
    start, end = math.atan2(-float(lamp_ahead_m), h), math.atan2(path_m - lamp_ahead_m, h)
    angle = start + 0.5 * (end - start) * (_NODES + 1)
    travelled = lamp_ahead_m + h * np.tan(angle) + h / np.cos(angle)
    # the lamp's light moves by (-h, s - s_0); towards the camera is -z
    values = phase(-np.sin(angle)) * np.exp(-attenuation_per_m * travelled)
    total = 0.5 * (end - start) * np.sum(_WEIGHTS * values)
    return float(intensity_w_per_sr * scattering_per_m / h * total)


def airlight_isotropic_sun2005(
    *,
    lamp_offset_m: float,
    path_m: float,
    scattering_per_m: float,
    attenuation_per_m: float,
    intensity_w_per_sr: float = 1.0,
) -> float:
    """Return `airlight` of isotropic scattering for a lamp beside the camera in closed form. [W/(m^2 sr)]

    Source: Sun, Ramamoorthi, Narasimhan & Nayar 2005, ACM Trans. Graph. 24:1040, with
    F(u, v) = integral of exp(-u tan x) over 0..v and u = c h.
    """
    _lamp(lamp_offset_m=lamp_offset_m, path_m=path_m, scattering_per_m=scattering_per_m,
          attenuation_per_m=attenuation_per_m)  # fmt: skip
    optical = attenuation_per_m * lamp_offset_m
    end = math.atan2(path_m, lamp_offset_m)
    # F(u, pi/4 + end/2) - F(u, pi/4)
    special_function, _ = integrate.quad(
        lambda x: math.exp(-optical * math.tan(x)), math.pi / 4, math.pi / 4 + end / 2, epsrel=1e-12
    )
    return intensity_w_per_sr * scattering_per_m / (4 * math.pi) * 2 / lamp_offset_m * special_function


def airlight_colocated(
    *,
    start_m: float,
    path_m: float,
    scattering_per_m: float,
    attenuation_per_m: float,
    phase_at_180_per_sr: float,
    intensity_w_per_sr: float = 1.0,
) -> float:
    """Return the radiance from `start_m` to `path_m` of a lamp at the camera itself. [W/(m^2 sr)]

    Source: beta(180 deg) I times the integral of exp(-2 c s) / s^2, by exponential integrals.
    Valid: single scattering; diverges as the start approaches 0.
    """
    require("airlight start_m", start_m, above=0)
    require("airlight path_m", path_m, least=start_m)
    require("airlight phase_at_180_per_sr", phase_at_180_per_sr, least=0)
    _lamp(lamp_offset_m=start_m, path_m=path_m, scattering_per_m=scattering_per_m,
          attenuation_per_m=attenuation_per_m)  # fmt: skip
    c = attenuation_per_m
    ends = [math.exp(-2 * c * s) / s for s in (start_m, path_m)]
    tail = special.exp1(2 * c * start_m) - special.exp1(2 * c * path_m) if c > 0 else 0.0
    return float(intensity_w_per_sr * scattering_per_m * phase_at_180_per_sr * (ends[0] - ends[1] - 2 * c * tail))
