"""The multistage model with the formulas of the dissertation as they are printed, for comparison only."""

import numpy as np

from uwsim.formation.as_printed import backward_integral
from uwsim.formation.bands import fine
from uwsim.formation.saturation import closed_form, saturating
from uwsim.formation.slabs import Lattice, Slabs
from uwsim.formation.spread import Spread
from uwsim.formation.surface import Surface
from uwsim.formation.two_paths import Law
from uwsim.formation.view import View


def as_printed(view: View, rule: Spread, *, forward_scatter: bool, integral: bool) -> dict[str, np.ndarray]:
    """Return direct, forward_scatter, backscatter in the water as printed, (H, W, 3) each.

    Where print leaves a choice: `*` in 2.43-2.47 is a product (a convolution elsewhere); the camera factors of 2.45
    and 2.55, which carry M / (4 F^2) and pi / (4 F^2), are divided out; daylight's "initial irradiance" is that of a
    horizontal plane just below the surface, d_s the slant path of the sun's rays (without sun: the depth); 2.59's E_s
    is that at the camera; int beta d(psi) as in
    `as_printed.backward_integral`.
    Errata: printed without the cosine of incidence (2.41, 2.47); with c for daylight and its convolution with itself
    (2.40, 2.56); light convolved that is attenuated already (2.41, 2.53); + c in e^(+c d) (2.54), which makes
    forward_scatter negative; irradiance times an integral of beta over angles (2.55, 2.61) for beta E; 2.60 with a
    constant E_s at any depth.
    """
    surface = Surface(rule, scattered=forward_scatter, cosine=False)
    direct = _reflected(surface, "unscattered", forward_scatter)
    forward = np.zeros_like(direct)
    if forward_scatter:
        # 2.53 with 2.54: e^(-c d) (e^(-G d) - e^(+c d))
        forward = rule.blur(
            _reflected(surface, "both_twice_dimmed", True) - _reflected(surface, "free", True)
        )  # fmt: skip
    coefficient = backward_integral(view)
    back = np.zeros_like(direct)
    if view.lamps and integral:
        lattice = Lattice(view)
        parts = [Slabs(lattice, rule, index, wide=False, angular=coefficient) for index in range(len(view.lamps))]
        per_length = sum(part.per_length("unscattered", "unscattered") for part in parts)
        back = back + lattice.to(lattice.cumulative(per_length), view.range_m)
    elif view.lamps:
        back = back + sum(closed_form(rule, index, angular=coefficient) for index in range(len(view.lamps)))
    if view.daylight is not None:
        back = back + _daylight_back(rule, coefficient, forward_scatter)
    return {"direct": direct, "forward_scatter": forward, "backscatter": back}


def _reflected(surface: Surface, camera: Law, forward_scatter: bool) -> np.ndarray:
    view = surface.view
    sources: list[Law] = ["unscattered", "scattered_twice_dimmed"] if forward_scatter else ["unscattered"]
    total = sum(surface.reflected(source, camera) for source in sources)
    if view.daylight is not None:
        path = _slant(view.daylight, view.points_m[surface.seen]).astype(np.float32)
        spectrum, ones = _plane_irradiance(view.daylight), np.ones(len(path), np.float32)
        total = total + surface.picture(
            sum(surface.through(spectrum, ones, path, source, camera) for source in sources)
        )  # fmt: skip
    return total


def _plane_irradiance(daylight) -> np.ndarray:
    return daylight.sun_irradiance * daylight.towards_sun[2] + daylight.sky_irradiance


def _slant(daylight, points_m: np.ndarray) -> np.ndarray:
    depth = np.maximum(-points_m[..., 2], 0)
    return depth / daylight.towards_sun[2] if np.any(daylight.sun_irradiance > 0) else depth


def _daylight_back(rule: Spread, coefficient: np.ndarray, forward_scatter: bool) -> np.ndarray:
    """Return 2.59-2.60 with 2.56: B_inf (1 - e^(-c d_c)), (H, W, 3)."""
    view, source = rule.view, rule.media[0]
    origin = view.origins_m[view.has_ray].mean(axis=0) if view.has_ray.any() else np.zeros(3)
    path = float(_slant(view.daylight, origin))
    left = source.left("unscattered", np.array([path]))[0]
    if forward_scatter:
        left = left * (1 + source.left("both", np.array([path]))[0] - left)
    weighted = (fine(_plane_irradiance(view.daylight)) * fine(coefficient))[:, None] * view.weights
    # the three bands have a value each, wavelengths one for all bands
    weighted = weighted * (left[None, :] if len(left) == 3 else left[:, None])
    return saturating(rule, weighted, np.zeros(view.shape)) * view.has_ray[..., None]
