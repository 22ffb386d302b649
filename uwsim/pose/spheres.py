"""Find bright spheres or LEDs in a turbid picture: their centres to a fraction of a pixel, with a covariance.

Blobs of a fitting size are sought in scale space, the light that the water scatters taken off; each is then fitted by
lit balls, blurred, on a sloping ground (`sphere_search`), in linear light; saturated pixels are at least so bright.
What is fitted is the middle of the outline; with a `lens` the image of the sphere's centre is returned, which lies
nearer to the axis (`sphere_outline`).
"""

from typing import NamedTuple

import numpy as np

from uwsim.camera.lens import Lens
from uwsim.images import check_srgb_uint8, linear_from_srgb_uint8
from uwsim.pose.sphere_candidates import candidates
from uwsim.pose.sphere_fit import Fit
from uwsim.pose.sphere_outline import middle_off_px
from uwsim.pose.sphere_search import Search

SATURATED = 254
POINTS_OVER_MODEL_STD = 1.8
"""Standard deviations in rendered pictures over those of the fit: shadows, light that the water scatters; what
`benchmarks/fits/marker_errors.py` finds on `pose_tuning`."""
_FITTED_MARGIN = 1.5
"""Fitted radii may lie outside the range that is looked for by this factor."""
_SAME = 0.7


class Sphere(NamedTuple):
    """Image of the centre (2,) [px, centres at integer + 0.5], covariance (2, 2) [px^2], radius [px], contrast.

    The radius is that of the circle of the outline's area; the contrast in linear light, 1 = white.
    """

    centre_px: np.ndarray
    covariance_px2: np.ndarray
    radius_px: float
    contrast: float


def detect_spheres(
    image: np.ndarray, *, radius_px: tuple[float, float], lens: Lens | None = None, radius_m: float | None = None,
    model_share: float = 0.01,
) -> list[Sphere]:  # fmt: skip
    """Return the spheres in an (H, W, 3) uint8 sRGB image, those of most contrast first; empty if there are none.

    `radius_px`: least and most that is looked for. `lens`: to return images of centres rather than middles of outlines,
    and to fit ellipses of the right shape; `radius_m` of the spheres, for lenses behind a port. `model_share`: of the
    radius, standard deviation of a centre by what the model leaves out (shadows of other spheres, rods), added to what
    follows from the noise. ValueError for another kind of image or a range that is none.

    Spheres that touch or hide each other are fitted together, the one in front found by trying both; where three and
    more of one size are seen whole, those that something hides in part are fitted with about that size.

    Valid: spheres of one blur, of which no more than two hide each other; radius from 1.5 px. Covariances: of the fit,
    larger where its residuals are correlated, times `POINTS_OVER_MODEL_STD` squared; still too small at high turbidity.
    """
    check_srgb_uint8(image, where="detect_spheres")
    least, most = radius_px
    if not 0 < least <= most < min(image.shape[:2]) / 2:
        raise ValueError(
            f"detect_spheres: radius_px is {radius_px}, allowed: above 0, ascending, below half the image's "
            f"{min(image.shape[:2])} px"
        )
    grey = linear_from_srgb_uint8(image).mean(axis=-1, dtype=float)
    saturated = np.any(image >= SATURATED, axis=-1)
    found = []
    for fits in Search(grey, saturated, lens).spheres(candidates(grey, radius_px=radius_px)):
        spheres = [_sphere(fit, lens, radius_m, model_share) for fit in fits]
        kept = [one for one in spheres if one and least / _FITTED_MARGIN <= one.radius_px <= _FITTED_MARGIN * most]
        found.append(kept)
    return _different(found)


def _sphere(fit: Fit, lens: Lens | None, radius_m: float | None, model_share: float) -> Sphere | None:
    off = np.zeros(2) if lens is None else middle_off_px(lens, fit.centre_px, fit.radius_px, radius_m=radius_m)
    if not np.all(np.isfinite(off)):
        return None
    by_model = (model_share * fit.radius_px) ** 2 * np.eye(2)
    covariance = POINTS_OVER_MODEL_STD**2 * (fit.covariance_px2 + by_model)
    return Sphere(fit.centre_px - off, covariance, fit.radius_px, fit.contrast)


def _different(groups: list[list[Sphere]]) -> list[Sphere]:
    """Return spheres, most contrast first, without those that lie in one of more contrast of another group."""
    order = sorted(
        ((one, number) for number, group in enumerate(groups) for one in group), key=lambda entry: -entry[0].contrast
    )
    kept: list[tuple[Sphere, int]] = []
    for one, number in order:
        if all(
            number == of or np.linalg.norm(one.centre_px - other.centre_px) > _SAME * other.radius_px
            for other, of in kept
        ):
            kept.append((one, number))
    return [one for one, _ in kept]
