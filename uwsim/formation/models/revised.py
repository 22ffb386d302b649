"""The revised formula: J exp(-beta_D R) + A (1 - exp(-beta_B R)), different coefficients for what is seen and the veil.

Source: Akkaynak & Treibitz 2018, CVPR, eqs. 8-11: effective coefficients of a band, averages over the wavelengths
weighted by what the light, the body and the water make of them.
"""

import numpy as np

from uwsim.formation.bands import fine
from uwsim.formation.direct import in_camera, require_no_daylight, seen_range_m, water_free
from uwsim.formation.veil import veiling_light
from uwsim.formation.view import View
from uwsim.optics.checks import require

PARAMETERS: dict[str, tuple[float, float]] = {
    "direct_relative": (0.0, 6.0), "backscatter_relative": (0.0, 60.0), "veil_relative": (0.0, 20.0),
}  # fmt: skip
_EMPTY_M = 1.0
_NEAR_M = 1e-4  # below, the effective coefficient is its limit, the mean


def layers(
    view: View,
    *,
    spectral: bool = True,
    direct_relative: float = 1.0,
    backscatter_relative: float = 1.0,
    veil_relative: float = 1.0,
) -> dict[str, np.ndarray]:
    """Return `direct`, `backscatter` and their sum `radiance`, (H, W, 3) float32.

    J, A and R as in `beer_lambert`; beta_D and beta_B from `coefficients`, the same for all pixels. Fitted to a
    picture: `direct_relative` times beta_D, `backscatter_relative` times beta_B, `veil_relative` times A.
    `spectral` False: coefficients as plain averages over the bands.
    Valid: as `beer_lambert`, at ranges near the one at which the coefficients were taken.
    Raises ValueError for daylight and for negative parameters.
    """
    require_no_daylight(view, "revised")
    given = {"direct": direct_relative, "backscatter": backscatter_relative, "veil": veil_relative}
    relative = {key: require(f"revised: {key}_relative", value, least=0) for key, value in given.items()}
    beta_d, beta_b = coefficients(view, spectral=spectral)
    left = np.exp(-seen_range_m(view)[..., None] * (relative["direct"] * beta_d).astype(np.float32))
    a = veiling_light(view, spectral=spectral) * relative["veil"]
    range_m = np.where(view.has_ray, np.minimum(view.range_m, 1e30), 0).astype(np.float32)
    veil = -np.expm1(-range_m[..., None] * (relative["backscatter"] * beta_b).astype(np.float32))
    return in_camera(view, direct=water_free(view) * left, backscatter=veil * a.astype(np.float32))


def coefficients(view: View, *, spectral: bool = True) -> tuple[np.ndarray, np.ndarray]:
    """Return beta_D and beta_B, (3,) each: effective at the median range of what is seen (1 m without a body). [1/m]

    beta_D = -ln(int r E e^(-c R) / int r E) / R with the lamps' spectrum E, of a grey body; beta_B the same with
    E b / c, the spectrum of light scattered along a ray without end. `spectral` False: the means of c with these
    weights (the limit R -> 0).
    Source: Akkaynak & Treibitz 2018, eqs. 8 and 9; for beta_B: B_inf (1 - e^(-beta_B R)) is the band value of
    B_inf(l) (1 - e^(-c R)).
    """
    range_m = float(np.median(view.range_m[view.has_body])) if view.has_body.any() else _EMPTY_M
    c, b = fine(view.water.attenuation), fine(view.water.scattering)
    weights = view.band_light
    scattered = weights * np.divide(b, c, out=np.zeros_like(b), where=c > 0)[:, None]
    effective = spectral and range_m > _NEAR_M
    found = []
    for kind in (weights, scattered):
        total = kind.sum(axis=0)
        shares = np.where(total > 0, kind / np.where(total > 0, total, 1), weights)
        found.append(-np.log(np.exp(-c * range_m) @ shares) / range_m if effective else c @ shares)
    return found[0], found[1]
