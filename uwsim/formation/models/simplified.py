"""The dissertation's simplified model (eqs. 2.47-2.67): direct light, its forward scatter if asked for, backscatter."""

from typing import Literal

import numpy as np

from uwsim.formation import airlight, as_printed, sunlight
from uwsim.formation.direct import direct as lamps_direct
from uwsim.formation.direct import in_camera
from uwsim.formation.spread import mean_attenuation, spread
from uwsim.formation.surface import Surface
from uwsim.formation.view import View

PARAMETERS: dict[str, tuple[float, float]] = {"forward_share": (0.0, 1.0), "damping_rad_per_m": (0.0, 2.0)}
"""Only with `forward_scatter`."""


def layers(
    view: View,
    *,
    spectral: bool = True,
    forward_scatter: bool = False,
    form: Literal["corrected", "as_printed"] = "corrected",
    forward_share: float | None = None,
    damping_rad_per_m: float | None = None,
) -> dict[str, np.ndarray]:
    """Return `direct`, `backscatter`, with `forward_scatter` that too, and their sum `radiance`, (H, W, 3) float32.

    corrected: direct = albedo / pi [sum of I cos(gamma) e^(-c (d_a + R)) / d_a^2 + E_sun cos(gamma) e^(-c (d_s + R))];
    forward_scatter = the same light, on the way to the camera scattered by small angles: (e^(-G R) - e^(-c R)) in place
    of e^(-c R), spread by B R; backscatter = the lamps' and the sun's light scattered once, the true integrals. Light
    scattered on its way to the body is neglected, as the dissertation does (2.47): that is what is simplified.
    as_printed: without cos(gamma) (2.48, 2.49, 2.52), backscatter (B_ba + B_bs)(1 - e^(-c R)) (2.59-2.66), forward
    scatter of the direct light as attenuated already (2.53, 2.67), with B = c. What is not kept of the print, because
    its terms could not be summed: the missing T_c of 2.52, and the sign of e^(+c d_c) in 2.54.
    G = c - `forward_share` b and B = `damping_rad_per_m`; None: by physics (`formation.spread`).
    Source: dissertation eqs. 2.47-2.67. Errata: see `formation.direct`, `airlight`, `sunlight`, `small_angle`,
    `as_printed`. Valid: optical depths to the body and back well below 1.
    Raises ValueError for daylight from the sky, another form, and parameters of forward scatter without it.
    """
    _check(view, form, forward_scatter=forward_scatter, given=(forward_share, damping_rad_per_m))
    printed = form == "as_printed"
    direct = lamps_direct(view, spectral=spectral, cosine=not printed)
    direct += sunlight.sun_direct(view, spectral=spectral, cosine=not printed)
    if printed:
        backscatter = as_printed.lamp_backscatter(view, spectral=spectral)
        backscatter += as_printed.sun_backscatter(view, spectral=spectral)
    else:
        backscatter = sunlight.sun_backscatter(view, spectral=spectral)
        for lamp in view.lamps:
            backscatter += airlight.single(view, lamp, spectral=spectral)
    found = {"direct": direct, "backscatter": backscatter}
    if forward_scatter:
        found["forward_scatter"] = _forward(
            view, printed=printed, spectral=spectral, forward_share=forward_share, damping_rad_per_m=damping_rad_per_m
        )
    return in_camera(view, **found)


def _forward(view: View, *, printed: bool, spectral: bool, forward_share, damping_rad_per_m) -> np.ndarray:
    """Return the light of the bodies that is scattered by small angles on the way to the camera, (H, W, 3)."""
    if printed and damping_rad_per_m is None:
        damping_rad_per_m = mean_attenuation(view)
    spreading = spread(view, spectral=spectral, forward_share=forward_share, damping_rad_per_m=damping_rad_per_m)
    bodies = Surface(spreading, scattered=False, cosine=not printed)
    law = "scattered_twice_dimmed" if printed else "scattered"
    return spreading.blur(bodies.reflected("unscattered", law))


def _check(view: View, form: str, *, forward_scatter: bool, given: tuple) -> None:
    if form not in ("corrected", "as_printed"):
        raise ValueError(f"simplified: form is {form!r}, allowed: 'corrected', 'as_printed'")
    if not forward_scatter and given != (None, None):
        raise ValueError(
            "simplified: got forward_share or damping_rad_per_m, allowed: with forward_scatter = True only"
        )
    if view.daylight is None:
        return
    if view.daylight.sky_irradiance.any():
        raise ValueError("simplified: daylight.sky_irradiance is above 0, allowed: 0 (the sun only)")
    if forward_scatter:
        raise ValueError("simplified: daylight with forward_scatter = True, allowed: False (lamps only)")
