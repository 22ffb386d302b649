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
from uwsim.pose.sphere_fit import Fit, fit_spheres, places_of_part
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
_WELL_EXPLAINED = 0.97
_TWO_LEAVE, _STREAK_LEAVES = 0.7, 0.7
"""A blob is two spheres, one partly in front of the other, where these leave so much less of it than one or a streak."""
_SOUND, _LEAST_SOUND = 0.99, 3
"""A fit that explains so much shows a whole sphere; what so many in a picture have of size, the others have about."""
_SIZE_SD, _LIKE_SIZE = 0.1, 0.3
_SAME_PART, _AS_WELL = 0.3, 2.0
_LEAST_PART, _FAIR = 0.6, 0.97
_ALIKE = 0.3
_LEAST_SEEN = 0.3
_LEAST_OF_TWO = 0.25
"""And the fainter of the two has such a share of the other's contrast."""


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

    Spheres that touch or hide each other are fitted together, the one in front found by trying both.

    Valid: spheres of one blur, of which no more than two hide each other; radius from 1.5 px. Covariances: of the fit, larger where its
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
    search = _Search(grey, saturated, lens)
    groups = search.mended(search.together(search.alone(candidates(grey, radius_px=radius_px))))
    found = []
    for fits in groups:
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


class _Look(NamedTuple):
    """A blob, pixels that may be its (H, W), shape of an outline there, what it is as one ball, as one that moves, if
    that explains it better, and its middle and second moments where it may be two."""

    blob: Candidate
    usable: np.ndarray
    shape: np.ndarray
    one: Fit | None
    streak: Fit | None
    drawn_out: tuple[np.ndarray, np.ndarray] | None


class _Search(NamedTuple):
    """The picture (H, W) in linear light, where it is saturated, and the lens."""

    grey: np.ndarray
    saturated: np.ndarray
    lens: Lens | None

    def alone(self, blobs: list[Candidate]) -> list[list[Fit]]:
        """Return what each blob is: one sphere, one that moves where about all do, or two."""
        looked = [self._look(blob, blobs[:number] + blobs[number + 1 :]) for number, blob in enumerate(blobs)]
        looks = [look for look in looked if look is not None]
        moving = _move_alike([look.streak.way_px for look in looks if look.streak is not None], len(looks))
        found = [self._chosen(look, moving=moving) for look in looks]
        return [fits for fits in found if fits]

    def together(self, groups: list[list[Fit]]) -> list[list[Fit]]:
        """Return the groups with those that touch fitted together, the nearest first."""
        single = [fits[0] for fits in groups if len(fits) == 1]
        kept = [fits for fits in groups if len(fits) > 1]
        while True:
            pairs = [(_gap(a, b), i, j) for i, a in enumerate(single) for j, b in enumerate(single) if i < j]
            touching = sorted(pair for pair in pairs if pair[0] < 0)
            if not touching:
                return kept + [[one] for one in single]
            _, i, j = touching[0]
            pair = [single[i], single[j]]
            rest = [one for one in single if all(one is not other for other in pair)]
            others = rest + [fit for fits in kept for fit in fits]
            centres, radii = np.array([one.centre_px for one in pair]), np.array([one.radius_px for one in pair])
            shape = self._shape(centres.mean(axis=0))
            usable = ~_covered(self.grey.shape, others, pair)
            kept.append(self._two(usable, shape, centres, radii) or pair)
            single = rest

    def mended(self, groups: list[list[Fit]]) -> list[list[Fit]]:
        """Return the groups, spheres that something hides in part fitted anew with about the size of the others."""
        fits = [fit for group in groups for fit in group]
        sound = [fit for fit in fits if fit.explained > _SOUND]
        if len(sound) < _LEAST_SOUND or any(fit.way_px.any() for fit in fits):
            return groups
        size = float(np.median([fit.radius_px for fit in sound]))
        whole = [fit for group in groups for fit in group if _is_whole(fit, size, alone=len(group) == 1)]
        found, places = [], [fit.centre_px for fit in whole]
        for group in groups:
            kept = []
            for fit in group:
                one = fit if any(fit is other for other in whole) else self._whole(fit, size, whole)
                if one is None:
                    continue
                if one is not fit:
                    # parts of one sphere come to the same place
                    if any(np.linalg.norm(one.centre_px - place) < _SAME_PART * size for place in places):
                        continue
                    places.append(one.centre_px)
                kept.append(one)
            found.append(kept)
        return found

    def _whole(self, fit: Fit, size_px: float, others: list[Fit]) -> Fit | None:
        """Return the sphere of about that size of which a fit shows a part, or the fit; None where it is neither."""
        shape, usable = self._shape(fit.centre_px), ~_discs(self.grey.shape, others)
        blur = float(np.median([one.blur_px for one in others])) if others else fit.blur_px
        starts = places_of_part(
            self.grey, usable, centre_px=fit.centre_px, radius_px=size_px, blur_px=blur, shape=shape, count=2
        )
        tried = [
            fit_spheres(
                self.grey, usable, self.saturated, centres_px=start, radii_px=size_px, shape=shape,
                within=(fit.centre_px, 2.0 * size_px), size_sd=_SIZE_SD,
            )
            for start in starts
        ]  # fmt: skip
        best = min((one[0] for one in tried if one), key=lambda one: one.left, default=None)
        if best is not None and _is_sphere(best) and best.seen > _LEAST_SEEN and best.left < _AS_WELL * fit.left:
            return best
        return fit if fit.radius_px > _LEAST_PART * size_px else None

    def _shape(self, place_px: np.ndarray) -> np.ndarray | None:
        """Return the shape (2, 2) of a small outline there; None where no ray goes."""
        if self.lens is None:
            return np.eye(2)
        slope = local_map(self.lens, place_px)
        return None if slope is None else shape_of(slope)

    def _look(self, blob: Candidate, others: list[Candidate]) -> "_Look | None":
        shape = self._shape(blob.centre_px)
        if shape is None:
            return None
        usable = ~_covered(self.grey.shape, others, [blob])
        one, streak = self._one(usable, shape, blob), None
        drawn_out = _moments(self.grey, usable, blob)
        if drawn_out is not None:
            elongated = np.linalg.cond(shape_of_moments(drawn_out[1])) > _ELONGATED * np.linalg.cond(shape)
            if elongated:
                streak = self._one(usable, shape, blob, way_px=_way(drawn_out[1]))
                if streak and one and streak.left > _STREAK_LEAVES * one.left:
                    streak = None
            if not elongated and one is not None and one.explained > _WELL_EXPLAINED:
                drawn_out = None
        return _Look(blob, usable, shape, one, streak, drawn_out)

    def _chosen(self, look: "_Look", *, moving: bool) -> list[Fit]:
        one = look.streak if moving and look.streak else look.one
        if not moving and look.drawn_out is not None:
            two = self._split(look.usable, look.shape, look.blob, *look.drawn_out)
            if two is not None and (one is None or two[0].left < _TWO_LEAVE * one.left):
                return two
        return [one] if one is not None and _is_sphere(one) else []

    def _one(self, usable: np.ndarray, shape: np.ndarray, blob: Candidate, way_px=None) -> Fit | None:
        fits = fit_spheres(
            self.grey, usable, self.saturated, centres_px=blob.centre_px, radii_px=blob.radius_px, shape=shape,
            within=(blob.centre_px, blob.radius_px), way_px=way_px,
        )  # fmt: skip
        return fits[0] if fits else None

    def _split(self, usable, shape: np.ndarray, blob: Candidate, middle, moments: np.ndarray) -> list[Fit] | None:
        """Return two spheres from a blob's middle (2,) and second moments (2, 2)."""
        spread, ways = np.linalg.eigh(moments)
        radius = float(np.clip(2 * np.sqrt(spread[0]), 0.6 * blob.radius_px, 1.1 * blob.radius_px))
        apart = float(np.clip(2 * np.sqrt(spread[1] - spread[0]), 0.5 * radius, 1.6 * radius))
        centres = middle + np.outer([0.5, -0.5], apart * ways[:, 1])
        return self._two(usable, shape, centres, np.full(2, radius), within=(blob.centre_px, blob.radius_px))

    def _two(self, usable, shape, centres_px, radii_px, *, within=None) -> list[Fit] | None:
        """Return the fits of two spheres, the front one first; None where they are not two."""
        tried = [
            fit_spheres(
                self.grey, usable, self.saturated, centres_px=centres_px[order], radii_px=radii_px[order],
                shape=shape, within=within,
            )
            for order in ([0, 1], [1, 0])
        ]  # fmt: skip
        fits = min((one for one in tried if one), key=lambda one: one[0].left, default=None)
        if fits is None or not all(map(_is_sphere, fits)):
            return None
        contrasts = sorted(fit.contrast for fit in fits)
        return fits if contrasts[0] > _LEAST_OF_TWO * contrasts[1] else None


def _way(moments: np.ndarray) -> np.ndarray:
    """Return the way (2,) [px] of a ball that leaves a streak of these second moments (2, 2): a line's and a disc's."""
    spread, ways = np.linalg.eigh(moments)
    return np.sqrt(12 * (spread[1] - spread[0])) * ways[:, 1]


def _is_sphere(fit: Fit) -> bool:
    # a centre that is not known to its own radius is none
    sure = np.sqrt(np.linalg.eigvalsh(fit.covariance_px2)[-1]) * _LEAST_CONTRAST_SDS <= fit.radius_px
    return bool(fit.explained >= _LEAST_EXPLAINED and fit.contrast > 0 and sure)


def _move_alike(ways: list[np.ndarray], count: int) -> bool:
    """Whether half of all blobs and more are drawn out, in about the same way."""
    if not ways or 2 * len(ways) < count:
        return False
    longest = max(ways, key=np.linalg.norm)
    turned = np.array([way if way @ longest >= 0 else -way for way in ways])
    middle = np.median(turned, axis=0)
    return bool(np.median(np.linalg.norm(turned - middle, axis=1)) < _ALIKE * np.linalg.norm(middle))


def _is_whole(fit: Fit, size_px: float, *, alone: bool) -> bool:
    """Whether a fit shows a whole sphere of about that size, or one of two such."""
    return (fit.explained > _FAIR or not alone) and abs(np.log(fit.radius_px / size_px)) < _LIKE_SIZE


def _gap(one: Fit, other: Fit) -> float:
    """Return the width of the ground between two spheres [px] less what is blurred."""
    between = np.linalg.norm(one.centre_px - other.centre_px) - one.radius_px - other.radius_px
    return float(between - one.blur_px - other.blur_px)


def _moments(grey: np.ndarray, usable: np.ndarray, blob: Candidate) -> tuple[np.ndarray, np.ndarray] | None:
    """Return the middle (2,) [px] and the second moments (2, 2) [px^2] of a blob's light; None where it has none.

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
    middle = np.array([(light * columns).sum(), (light * rows).sum()]) / light.sum()
    aside = np.stack([columns, rows], axis=-1) - middle
    moments = np.einsum("ij,ijk,ijl->kl", light, aside, aside) / light.sum()
    return (middle, moments) if np.linalg.eigvalsh(moments)[0] > 0 else None


def _covered(shape: tuple[int, int], others: list, own: list) -> np.ndarray:
    """Return which pixels belong to other blobs or spheres than these."""
    mask = np.zeros(shape, bool)
    for other in others:
        reach = _OTHERS_RADII * other.radius_px + _OTHERS_PX
        low = np.maximum(np.floor(other.centre_px - reach).astype(int), 0)
        high = np.ceil(other.centre_px + reach).astype(int)
        rows, columns = np.mgrid[low[1] : min(high[1], shape[0]), low[0] : min(high[0], shape[1])]
        places = np.stack([columns, rows], axis=-1) + 0.5
        to_other = np.linalg.norm(places - other.centre_px, axis=-1)
        to_own = np.min([np.linalg.norm(places - one.centre_px, axis=-1) / one.radius_px for one in own], axis=0)
        mask[rows, columns] |= (to_other <= reach) & (to_other / other.radius_px < to_own)
    return mask


def _discs(shape: tuple[int, int], spheres: list[Fit]) -> np.ndarray:
    """Return which pixels (H, W) the spheres cover, with their borders."""
    rows, columns = np.mgrid[: shape[0], : shape[1]] + 0.5
    places = np.stack([columns, rows], axis=-1)
    mask = np.zeros(shape, bool)
    for one in spheres:
        mask |= np.linalg.norm(places - one.centre_px, axis=-1) <= one.radius_px + one.blur_px + _OTHERS_PX
    return mask


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
