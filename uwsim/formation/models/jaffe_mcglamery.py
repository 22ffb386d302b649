"""Jaffe-McGlamery model (dissertation eqs. 2.29-2.36): direct, forward scatter and backscatter of lamps.

What it holds that the multistage model does not: light scattered forwards also on its way to and from the particles
that send it back, slab by slab. What it lacks: daylight.
"""

from typing import Literal

import numpy as np

from uwsim.formation import airlight, small_angle
from uwsim.formation.slabs import Lattice, Slabs, blurred
from uwsim.formation.spread import Spread, mean_attenuation, spread
from uwsim.formation.surface import Surface
from uwsim.formation.view import View

PARAMETERS = {"forward_share": (0.0, 1.0), "damping_rad_per_m": (0.0, 2.0)}
"""What may be fitted to a truth: G = c - forward_share b, and B. [-, rad/m]"""


def layers(
    view: View, *, spectral: bool = True, form: Literal["corrected", "as_printed"] = "corrected",
    forward_scatter: bool = True, loss_per_m: np.ndarray | None = None, forward_share: float | None = None,
    damping_rad_per_m: float | None = None,
) -> dict[str, np.ndarray]:  # fmt: skip
    """Return `direct`, `forward_scatter`, `backscatter` and their sum `radiance`, (H, W, 3) float32 each.

    Band radiance in the camera [W m^-2 sr^-1 nm^-1] as the renderer's; in the water, before `view.factor`,

        direct            albedo / pi (E e^(-c d) + E_w [e^(-G d) - e^(-c d)]) e^(-c R)                  2.30, 2.31
        forward_scatter   the same with e^(-G R) - e^(-c R) for e^(-c R), spread by e^(-B R omega)       2.32, 2.33
        backscatter       int_0^R beta (E e^(-c r) + E_w [e^(-G r) - e^(-c r)]) e^(-c s) ds,             2.35, 2.36
                          and the same with e^(-G s) - e^(-c s), slab by slab spread by e^(-B s omega)   2.34

    E is the lamp's irradiance without attenuation, E_w its beam widened by the same rule (`widened.WidenedLamp`).
    `loss_per_m` (G: number or (61,)), `forward_share` (G = c - share b), `damping_rad_per_m` (B): None as in
    `spread.spread`. `forward_scatter` False: all parts with a point-spread function left out. `spectral` False: three
    bands instead of wavelengths. The lens's factors of 2.30 and 2.35 belong to all layers alike (`lens_factor`).
    Raises ValueError for a view with daylight or without lamps, an unknown form, and G or B out of range.
    Source: McGlamery 1980, Proc. SPIE 208:221; Jaffe 1990, IEEE J. Ocean. Eng. 15:101; dissertation eqs. 2.29-2.36.
    Valid: single scattering by large angles, any number by small ones; no interreflection; bodies cast no shadow on the
    water; the scene goes on mirrored beyond the picture.
    Errata: `form="as_printed"` is what the dissertation prints: 2.32 and 2.34 convolve light that is attenuated
    already, so that e^(-c R) stands twice; 2.31 has no scattered light and calls an intensity irradiance; 2.34 blurs
    all slabs by the range of the body; 2.36 has 1/z for 1/z^2 (metres) and attenuates its scattered light twice; B is
    c in rad/m. G, for which nothing is printed, is the same. 2.34 is computed with G and c of the three bands.
    """
    if view.daylight is not None:
        raise ValueError("jaffe_mcglamery: the view has daylight, allowed: lamps only (multistage takes daylight)")
    if not view.lamps:
        raise ValueError("jaffe_mcglamery: the view has no lamp, allowed: at least one")
    if form not in ("corrected", "as_printed"):
        raise ValueError(f"jaffe_mcglamery: form is {form!r}, allowed: 'corrected', 'as_printed'")
    if form == "as_printed" and damping_rad_per_m is None:
        damping_rad_per_m = mean_attenuation(view)
    rule = spread(
        view, spectral=spectral, loss_per_m=loss_per_m, forward_share=forward_share, damping_rad_per_m=damping_rad_per_m
    )
    make = _corrected if form == "corrected" else _as_printed
    found = make(view, rule, spectral=spectral, forward_scatter=forward_scatter)
    factor = np.asarray(view.factor, np.float32)[..., None]
    found = {name: (image * factor).astype(np.float32) for name, image in found.items()}
    return found | {"radiance": found["direct"] + found["forward_scatter"] + found["backscatter"]}


def _corrected(view: View, rule: Spread, *, spectral: bool, forward_scatter: bool) -> dict[str, np.ndarray]:
    surface = Surface(rule, scattered=forward_scatter)
    direct = surface.reflected("unscattered", "unscattered")
    if not forward_scatter:
        back = _single(view, spectral=spectral)
        return {"direct": direct, "forward_scatter": np.zeros_like(direct), "backscatter": back}
    direct = direct + surface.reflected("scattered", "unscattered")
    forward = surface.reflected("unscattered", "scattered") + surface.reflected("scattered", "scattered")
    return {
        "direct": direct,
        "forward_scatter": rule.blur(forward),
        "backscatter": backscatter(view, rule, spectral=spectral),
    }


def backscatter(view: View, rule: Spread, *, spectral: bool = True) -> np.ndarray:
    """Return the backscatter in the water of `layers` (corrected, before `view.factor`), (H, W, 3) float32."""
    return _single(view, spectral=spectral) + _scattered_back(view, rule)


def _single(view: View, *, spectral: bool) -> np.ndarray:
    return np.sum([airlight.single(view, lamp, spectral=spectral) for lamp in view.lamps], axis=0)


def _scattered_back(view: View, rule: Spread) -> np.ndarray:
    """Return the backscatter of light that was also scattered forwards, before or after, (H, W, 3)."""
    lattice = Lattice(view)
    sharp = spreading = 0.0
    for index in range(len(view.lamps)):
        slabs = Slabs(lattice, rule, index, wide=True)
        sharp = sharp + slabs.per_length("scattered", "unscattered")
        for source in ("unscattered", "scattered"):
            spreading = spreading + slabs.per_length(source, "scattered")
    cumulative = lattice.cumulative(spreading)
    return lattice.to(lattice.cumulative(sharp), view.range_m) + blurred(lattice, cumulative, blur=_slab_blur(rule))


def _slab_blur(rule: Spread):
    def blur(image: np.ndarray, range_m: float, stride: int) -> np.ndarray:
        path = np.full(image.shape[:2], range_m)
        damping = rule.damping_rad_per_m(np.asarray(range_m), side="camera")
        return small_angle.blur(image, path, rule.view.pixel_angle_rad * stride, damping_rad_per_m=damping)

    return blur


def _as_printed(view: View, rule: Spread, *, spectral: bool, forward_scatter: bool) -> dict[str, np.ndarray]:
    surface = Surface(rule, scattered=False)
    direct = surface.reflected("unscattered", "unscattered")
    lattice = Lattice(view)
    back = 0.0
    for index in range(len(view.lamps)):
        slabs = Slabs(lattice, rule, index, wide=forward_scatter, one_over_distance=True)
        back = back + slabs.per_length("unscattered", "unscattered")
        if forward_scatter:
            back = back + slabs.per_length("scattered_twice_dimmed", "unscattered")
    back = lattice.to(lattice.cumulative(back), view.range_m)
    if not forward_scatter:
        return {"direct": direct, "forward_scatter": np.zeros_like(direct), "backscatter": back}
    forward = rule.blur(surface.reflected("unscattered", "scattered_twice_dimmed"))
    share = small_angle.scattered_share(
        view.range_m[..., None], loss_per_m=_band_loss(view, rule), attenuation_per_m=view.band_attenuation
    )
    return {"direct": direct, "forward_scatter": forward, "backscatter": back + rule.blur(back * share)}


def _band_loss(view: View, rule: Spread) -> np.ndarray:
    """Return G on the way to the camera of the three bands, (3,). [1/m]"""
    loss = rule.media[1].loss
    return np.minimum(loss if len(loss) == 3 else loss @ view.band_light, view.band_attenuation)
