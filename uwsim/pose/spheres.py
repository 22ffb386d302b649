"""Find bright spheres or LEDs in a turbid picture: their centres to a fraction of a pixel, with a covariance.

Blobs of a fitting size are sought in scale space, the light that the water scatters taken off; each is then fitted by a
lit ball, blurred, on a sloping ground (`sphere_fit`), in linear light; saturated pixels are at least so bright. What is
fitted is the middle of the outline; with a `lens` the image of the sphere's centre is returned, which lies nearer to
the axis (`sphere_outline`).
"""

from typing import NamedTuple

import numpy as np

from uwsim.camera.lens import Lens
from uwsim.images import check_srgb_uint8, linear_from_srgb_uint8
from uwsim.pose.sphere_candidates import Candidate, candidates
from uwsim.pose.sphere_fit import fit_sphere
from uwsim.pose.sphere_outline import local_map, middle_off_px, shape_of, shape_of_moments

SATURATED = 254
POINTS_OVER_MODEL_STD = 1.5
"""Standard deviations in rendered pictures over those of the fit: shadows, light that the water scatters; what
`benchmarks/fits/marker_errors.py` finds on `pose_tuning`."""
_LEAST_EXPLAINED = 0.6
_LEAST_CONTRAST_SDS = 3.0
_FITTED_MARGIN = 1.5
_OTHERS_RADII, _OTHERS_PX = 1.15, 1.0
_SAME = 0.7
_ELONGATED = 1.1
"""A blob so much longer than wide is fitted with the outline that its second moments have, too: a streak's."""
_STREAK_RADII = 2.0


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

    Valid: spheres apart from each other, of one blur; radius from 1.5 px. Covariances: of the fit, larger where its
    residuals are correlated, times `POINTS_OVER_MODEL_STD` squared; still too small at high turbidity.
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
    blobs = candidates(grey, radius_px=radius_px)
    found = []
    for number, blob in enumerate(blobs):
        others = blobs[:number] + blobs[number + 1 :]
        one = _fitted(grey, saturated, others, blob, lens, radius_m)
        if one is not None and least / _FITTED_MARGIN <= one.radius_px <= _FITTED_MARGIN * most:
            by_model = (model_share * one.radius_px) ** 2 * np.eye(2)
            covariance = POINTS_OVER_MODEL_STD**2 * (one.covariance_px2 + by_model)
            found.append(one._replace(covariance_px2=covariance))
    return _different(sorted(found, key=lambda one: -one.contrast))


def _fitted(
    grey, saturated, others: list[Candidate], blob: Candidate, lens: Lens | None, radius_m: float | None
) -> Sphere | None:
    slope = None if lens is None else local_map(lens, blob.centre_px)
    if lens is not None and slope is None:
        return None
    shape = np.eye(2) if slope is None else shape_of(slope)
    usable = ~_covered(grey.shape, others, blob)
    fit = fit_sphere(grey, usable, saturated, centre_px=blob.centre_px, radius_px=blob.radius_px, shape=shape)
    streak = _streak_shape(grey, usable, blob)
    if streak is not None and np.linalg.cond(streak) > _ELONGATED * np.linalg.cond(shape):
        other = fit_sphere(
            grey, usable, saturated, centre_px=blob.centre_px, radius_px=blob.radius_px, shape=streak
        )  # fmt: skip
        fit = max((one for one in (fit, other) if one is not None), key=lambda one: one.explained, default=None)
    if fit is None or fit.explained < _LEAST_EXPLAINED or fit.contrast <= 0:
        return None
    # a centre that is not known to its own radius is none
    if np.sqrt(np.linalg.eigvalsh(fit.covariance_px2)[-1]) * _LEAST_CONTRAST_SDS > fit.radius_px:
        return None
    off = np.zeros(2) if lens is None else middle_off_px(lens, fit.centre_px, fit.radius_px, radius_m=radius_m)
    if not np.all(np.isfinite(off)):
        return None
    return Sphere(fit.centre_px - off, fit.covariance_px2, fit.radius_px, fit.contrast)


def _streak_shape(grey: np.ndarray, usable: np.ndarray, blob: Candidate) -> np.ndarray | None:
    """Return the shape (2, 2), of determinant 1, of the ellipse with a blob's second moments; None where it has none.

    A ball that moves during the exposure is drawn out along its way, symmetrically about its place in the middle of it:
    taken for round it would be a ball lit from one side, and its centre off.
    """
    reach = _STREAK_RADII * blob.radius_px
    low = np.maximum(np.floor(blob.centre_px - reach).astype(int), 0)
    high = np.ceil(blob.centre_px + reach).astype(int)
    part = np.s_[low[1] : high[1], low[0] : high[0]]
    rows, columns = np.mgrid[: grey.shape[0], : grey.shape[1]][:, *part] + 0.5
    values = np.where(usable[part], grey[part] - np.median(grey[part]), 0.0)
    light = np.where(values > 0.2 * max(values.max(), 0), values, 0.0)
    if not light.sum() > 0:
        return None
    aside = np.stack([columns, rows], axis=-1) - [
        (light * columns).sum() / light.sum(), (light * rows).sum() / light.sum()
    ]  # fmt: skip
    moments = np.einsum("ij,ijk,ijl->kl", light, aside, aside) / light.sum()
    return shape_of_moments(moments) if np.linalg.eigvalsh(moments)[0] > 0 else None


def _covered(shape: tuple[int, int], others: list[Candidate], blob: Candidate) -> np.ndarray:
    """Return which pixels belong to other blobs than this one."""
    mask = np.zeros(shape, bool)
    for other in others:
        reach = _OTHERS_RADII * other.radius_px + _OTHERS_PX
        low = np.maximum(np.floor(other.centre_px - reach).astype(int), 0)
        high = np.ceil(other.centre_px + reach).astype(int)
        rows, columns = np.mgrid[low[1] : min(high[1], shape[0]), low[0] : min(high[0], shape[1])]
        places = np.stack([columns, rows], axis=-1) + 0.5
        to_other = np.linalg.norm(places - other.centre_px, axis=-1)
        nearer = to_other / other.radius_px < np.linalg.norm(places - blob.centre_px, axis=-1) / blob.radius_px
        mask[rows, columns] |= (to_other <= reach) & nearer
    return mask


def _different(found: list[Sphere]) -> list[Sphere]:
    """Return spheres without those that lie in one of more contrast."""
    kept: list[Sphere] = []
    for one in found:
        if all(np.linalg.norm(one.centre_px - other.centre_px) > _SAME * other.radius_px for other in kept):
            kept.append(one)
    return kept
