"""Backscatter in closed form, B (1 - e^(-c d)) of eqs. 2.59-2.60 and 2.64-2.65: light that is constant along a ray."""

import numpy as np

from uwsim.formation.bands import fine
from uwsim.formation.scattering import density_of, groups
from uwsim.formation.spread import Spread
from uwsim.formation.two_paths import TwoPaths

_SATURATED = 15.0  # optical depth at which 1 - e^(-c d) is 1
_LEAST = 1e-12


def ranges_m(rule: Spread) -> np.ndarray:
    """Return the ranges of a view cut where 1 - e^(-c d) is 1, (H, W). [m]"""
    clearest = max(float(rule.media[1].attenuation.min()), 1e-3)
    return np.minimum(rule.view.range_m, _SATURATED / clearest)


def saturating(rule: Spread, weighted: np.ndarray, path_m: np.ndarray) -> np.ndarray:
    """Return the band values of a spectrum x weights (121, 3) x e^(-c path) (1 - e^(-c R)) / c, (H, W, 3)."""
    ranges = ranges_m(rule)
    table = TwoPaths(rule.media, weighted, ("unscattered", "saturation"), (path_m.max(), ranges.max()))
    return table(path_m, ranges)


def closed_form(rule: Spread, index: int, *, angular: np.ndarray | None = None) -> np.ndarray:
    """Return the backscatter of a lamp by eqs. 2.64-2.65, (beta E_a / c) (1 - e^(-c d_c)), (H, W, 3) in the water.

    The irradiance E_a (attenuated) and the scattering angle are those at the point seen, "an imaging distance d_c as
    an effective backscattering distance"; without a body, those at 1/c along the ray. `angular` (61,): a coefficient
    instead of beta at that angle [1/(m sr)].
    Source: dissertation eqs. 2.61-2.65, with beta E instead of an irradiance times an integral over angles.
    Errata: a lamp's irradiance is not constant along a ray: near the lamp it is far greater than at the point seen, so
    that this form lacks most of the backscatter of a lamp beside the camera. `airlight.single` is the true integral.
    """
    view, lamp = rule.view, rule.view.lamps[index]
    free_path = 1.0 / max(float(np.mean(view.band_attenuation)), 1e-3)
    distance = np.where(view.has_body, view.range_m, free_path)[..., None]
    directions = np.where(view.has_ray[..., None], view.directions, [0.0, 0.0, 1.0])
    came = lamp.arriving(np.where(view.has_ray[..., None], view.origins_m, 0.0) + distance * directions)
    if angular is not None:
        parts = [(fine(lamp.spectrum) * fine(angular), 1.0)]
    else:
        cosine = np.einsum("ijk,ijk->ij", came.towards, directions)
        half = np.clip((1 - cosine) / 2, _LEAST, 1.0)
        power = fine(lamp.spectrum) * fine(view.water.scattering)
        parts = [
            (power * fine(share), sum(weight * density_of(term, half) for weight, term in terms))
            for share, terms in groups(view.water.phase)
        ]
    total = np.zeros((*view.shape, 3), np.float32)
    for spectrum, density in parts:
        found = saturating(rule, spectrum[:, None] * view.weights, came.path_m)
        total += found * (density * came.irradiance_per_intensity * view.has_ray)[..., None].astype(np.float32)
    return total
