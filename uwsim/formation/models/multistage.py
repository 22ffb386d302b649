"""Multistage attenuation model (dissertation eqs. 2.39-2.66): daylight and lamps, each attenuated stage by stage.

What it holds that the Jaffe-McGlamery model does not: daylight, on bodies and in the water. What it lacks: all forward
scattering in the backscatter, which is that of light scattered once (lamps), or dimmed by G on its way down (daylight).
Direct light and forward scatter of lamps are the same in both.
"""

from typing import Literal

import numpy as np

from uwsim.formation import airlight, daylight_field
from uwsim.formation.multistage_printed import as_printed
from uwsim.formation.saturation import closed_form
from uwsim.formation.spread import Spread, mean_attenuation, spread
from uwsim.formation.surface import Surface
from uwsim.formation.view import View

PARAMETERS = {"forward_share": (0.0, 1.0), "damping_rad_per_m": (0.0, 2.0)}
"""What may be fitted to a truth: G = c - forward_share b, and B. [-, rad/m]"""


def layers(
    view: View, *, spectral: bool = True, form: Literal["corrected", "as_printed"] = "corrected",
    lamp_backscatter: Literal["integral", "closed_form_2_64"] = "integral", forward_scatter: bool = True,
    loss_per_m: np.ndarray | None = None, forward_share: float | None = None, damping_rad_per_m: float | None = None,
) -> dict[str, np.ndarray]:  # fmt: skip
    """Return `direct`, `forward_scatter`, `backscatter` and their sum `radiance`, (H, W, 3) float32 each.

    Band radiance in the camera [W m^-2 sr^-1 nm^-1] as the renderer's; in the water

        direct           albedo / pi (E_s + E_a) e^(-c d_c)                                            2.43-2.46
        forward_scatter  the same with e^(-G d_c) - e^(-c d_c), spread by e^(-B d_c omega)             2.53, 2.54
        backscatter      int_0^(d_c) (beta_s E_s(s) + beta_a E_a(s)) e^(-c s) ds                       2.55, 2.61, 2.66
        E_s              sun and sky below the surface, e^(-G d_s) on the slant path, times cosine     2.40, 2.56
        E_a              of bodies: E e^(-c d_a) + E_w [e^(-G d_a) - e^(-c d_a)], times cosine         2.41
                         of the water: E e^(-c d_a)                                                    2.61

    E is a lamp's irradiance without attenuation, E_w its beam widened. `lamp_backscatter` "closed_form_2_64": the lamp
    lights the whole ray as it does the point seen (`saturation.closed_form`).
    `loss_per_m` (G: number or (61,)), `forward_share` (G = c - share b), `damping_rad_per_m` (B): None as in
    `spread.spread`. `forward_scatter` False: all parts with a point-spread function left out, which leaves daylight
    e^(-c d_s). `spectral` False: three bands instead of wavelengths. Camera factors (2.45, 2.50, 2.58): `lens_factor`.
    Raises ValueError for a view without light, an unknown form, and G or B out of range.
    Source: dissertation eqs. 2.39-2.66. Valid: a flat surface and a uniform sky; lamps' light scattered once by large
    angles; no shadows of daylight, none of bodies on the water; the scene goes on mirrored beyond the picture.
    Errata: 2.40 and 2.56 attenuate daylight by c and add a convolution of what is attenuated already; here both parts
    are e^(-G d_s), a + b_b per length of slant path, which is Gordon's K_d mu. For the others, and what
    `form="as_printed"` computes, see `multistage_printed.as_printed`.
    """
    if view.daylight is None and not view.lamps:
        raise ValueError("multistage: the view has neither lamps nor daylight, allowed: at least one of them")
    for name, value, allowed in (
        ("form", form, ("corrected", "as_printed")),
        ("lamp_backscatter", lamp_backscatter, ("integral", "closed_form_2_64")),
    ):
        if value not in allowed:
            raise ValueError(f"multistage: {name} is {value!r}, allowed: {', '.join(allowed)}")
    if form == "as_printed" and damping_rad_per_m is None:
        damping_rad_per_m = mean_attenuation(view)
    if not forward_scatter:
        loss_per_m, forward_share = None, 0.0
    rule = spread(
        view, spectral=spectral, loss_per_m=loss_per_m, forward_share=forward_share, damping_rad_per_m=damping_rad_per_m
    )
    settings = {"forward_scatter": forward_scatter, "integral": lamp_backscatter == "integral"}
    if form == "as_printed":
        found = as_printed(view, rule, **settings)
    else:
        found = _corrected(view, rule, spectral=spectral, **settings)
    factor = np.asarray(view.factor, np.float32)[..., None]
    found = {name: (image * factor).astype(np.float32) for name, image in found.items()}
    return found | {"radiance": found["direct"] + found["forward_scatter"] + found["backscatter"]}


def _corrected(
    view: View, rule: Spread, *, spectral: bool, forward_scatter: bool, integral: bool
) -> dict[str, np.ndarray]:
    surface = Surface(rule, scattered=forward_scatter)
    forward = np.zeros((*view.shape, 3), np.float32)
    direct = _reflected(surface, "unscattered", forward_scatter)
    if forward_scatter:
        forward = rule.blur(_reflected(surface, "scattered", forward_scatter))
    back = np.zeros((*view.shape, 3), np.float32)
    for index, lamp in enumerate(view.lamps):
        back = back + (airlight.single(view, lamp, spectral=spectral) if integral else closed_form(rule, index))
    if view.daylight is not None:
        back = back + daylight_field.backscatter(rule, view.daylight)
    return {"direct": direct, "forward_scatter": forward, "backscatter": back}


def _reflected(surface: Surface, camera, forward_scatter: bool) -> np.ndarray:
    """Return what bodies reflect of lamps and daylight, with a law on the way to the camera, (H, W, 3)."""
    total = surface.reflected("unscattered", camera)
    if forward_scatter:
        total = total + surface.reflected("scattered", camera)
    daylight = surface.view.daylight
    if daylight is not None:
        total = total + daylight_field.reflected(surface, daylight, source="both", camera=camera)
    return total
