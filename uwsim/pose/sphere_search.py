"""What the bright blobs of a picture are: spheres, two that hide each other, spheres in motion, parts of hidden ones.

Each blob is fitted by one ball (`sphere_fit`). Where that leaves much, it is also tried as a ball in motion, if the
others move alike, and as two balls, one partly in front of the other. Balls that touch are fitted together. What shows
a part of a sphere only, because a rod, a shadow or another sphere hides the rest, is fitted anew with about the size
that the whole ones have.
"""

from typing import NamedTuple

import numpy as np

from uwsim.camera.lens import Lens
from uwsim.pose.sphere_candidates import Candidate
from uwsim.pose.sphere_fit import PART_WINDOW, Alike, Fit, fit_spheres, places_of_part
from uwsim.pose.sphere_outline import local_map, shape_of, shape_of_moments

_LEAST_EXPLAINED, _LEAST_CONTRAST_SDS = 0.6, 3.0
_CLEAN = 0.025
"""A ball that leaves less than this share of its contrast needs no other explanation."""
_WELL_EXPLAINED, _ELONGATED = 0.97, 1.1
"""Below this share explained, or so much longer than wide, a blob may be two spheres; if so long, a streak, too."""
_TWO_LEAVE, _TWO_IN_MOTION, _STREAK_LEAVES = 0.7, 0.1, 0.7
"""What they may leave, of what one ball leaves; two in a picture in motion, of what a streak leaves."""
_TWO_EXPLAINED, _LEAST_OF_TWO, _APART_RADII = 0.97, 0.25, 0.4
"""Least that two explain, contrast of the fainter over the other's, and distance in units of the smaller radius."""
_ALIKE = 0.3
"""Ways that differ by less than this share are one motion."""
_MOMENTS_RADII, _MOMENTS_LEAST = 2.0, 0.2
_OTHERS_RADII, _OTHERS_PX = 1.15, 1.0
_SOUND, _LEAST_SOUND = 0.99, 3
"""A fit that explains so much shows a whole sphere; with so many of them the size of the others is known."""
_ALIKE_PARTS = ("radius_px", "light", "blur_px")
_LIKE_SIZE = (-0.25, 0.35)
"""Logs of radii over that size of whole spheres: parts are smaller, nearer spheres larger."""
_WHOLE_EXPLAINED = 0.97
_SIZE_SDS, _SIZES_ALIKE, _OTHER_SIZE = (0.1, 0.2), 2.0, 0.5
"""Least and most standard deviation that sizes of whole spheres (logs of radii) are taken to have; how many of them
off one of about that size is; the log by which any may differ."""
_MOSTLY_SEEN, _FAIR_EXPLAINED = 0.5, 0.95
"""Share of a sphere of another size that must be seen; what the fit of a whole one must explain."""
_LEAST_SEEN, _AS_WELL = 0.3, 2.0
"""Share of a sphere that must be seen; what it may leave, of what the fit to the part alone leaves."""
_SAME_PLACE = 0.3
"""Parts that come to one place, closer than this in units of the size, are of one sphere."""
_PLACES = 2


class _Look(NamedTuple):
    """A blob, pixels that may be its (H, W), and what it is as one ball and as a ball that moves.

    `middle` (2,) and `moments` (2, 2) of its light where it may be two, None elsewhere; `streak` is None where a ball
    at rest explains the blob about as well.
    """

    blob: Candidate
    usable: np.ndarray
    one: Fit | None
    streak: Fit | None
    middle: np.ndarray | None
    moments: np.ndarray | None

    @property
    def sure(self) -> bool:
        """Whether it surely is the one ball."""
        return self.one is not None and _is_sphere(self.one, least=_SOUND)


class Search(NamedTuple):
    """The picture (H, W) in linear light, where it is saturated (H, W) bool, and the lens if known."""

    grey: np.ndarray
    saturated: np.ndarray
    lens: Lens | None

    def spheres(self, blobs: list[Candidate]) -> list[list[Fit]]:
        """Return the spheres that the blobs show, those that were fitted together in one list."""
        looks: list[_Look] = []
        for number, blob in enumerate(blobs):
            # pixels of spheres that are surely known belong to them
            known = [look.one for look in looks if look.sure]
            others = [look.blob for look in looks if not look.sure] + blobs[number + 1 :]
            look = self._look(blob, others, known)
            if look is not None:
                looks.append(look)
        moving = _move_alike([look.streak.way_px for look in looks if look.streak is not None], len(looks))
        found = [fits for fits in (self._chosen(look, looks, moving=moving) for look in looks) if fits]
        return found if moving else self._mended(self._together(found))

    def _look(self, blob: Candidate, others: list[Candidate], known: list[Fit]) -> _Look | None:
        shape = self._shape(blob.centre_px)
        if shape is None or any(np.linalg.norm(blob.centre_px - one.centre_px) < one.radius_px for one in known):
            return None
        usable = ~_covered(self.grey.shape, others, [blob]) & ~_discs(self.grey.shape, known)
        one = self._one(blob, usable)
        if one is not None and one.left < (_CLEAN * one.contrast) ** 2:
            return _Look(blob, usable, one, None, None, None)
        middle, moments = _moments(self.grey, usable, blob)
        if moments is None:
            return _Look(blob, usable, one, None, None, None)
        streak, elongated = None, np.linalg.cond(shape_of_moments(moments)) > _ELONGATED * np.linalg.cond(shape)
        if elongated:
            streak = self._one(blob, usable, way_px=_way(moments))
            if streak and one and streak.left > _STREAK_LEAVES * one.left:
                streak = None
        elif one is not None and one.explained > _WELL_EXPLAINED:
            middle = moments = None
        return _Look(blob, usable, one, streak, middle, moments)

    def _chosen(self, look: _Look, looks: list[_Look], *, moving: bool) -> list[Fit]:
        """Return what a blob is: one sphere, where all move one in motion, or two, or none."""
        one = look.streak if moving and look.streak else look.one
        whole = one is not None and _is_sphere(one)
        two = None if look.moments is None else self._split(look)
        if two and (one is None or two[0].left < (_TWO_IN_MOTION if moving else _TWO_LEAVE) * one.left):
            others = [other.one for other in looks if other is not look and other.one and _is_sphere(other.one)]
            if moving or not whole or not self._light_of_another(one, two, others):
                return two
        return [one] if whole else []

    def _light_of_another(self, one: Fit, two: list[Fit], others: list[Fit]) -> bool:
        """Whether what is left of one, for which it was taken for two, may be light of a sphere that it touches."""
        near = [other for other in others if any(_gap(part, other) < 0 for part in two)]
        return any(self._touching([one, other], others) for other in near)

    def _together(self, groups: list[list[Fit]]) -> list[list[Fit]]:
        """Return the groups with single spheres that touch fitted together, the nearest first."""
        single = [fits[0] for fits in groups if len(fits) == 1]
        kept = [fits for fits in groups if len(fits) > 1]
        while True:
            pairs = [(_gap(a, b), i, j) for i, a in enumerate(single) for j, b in enumerate(single) if i < j]
            gap, *chosen = min(pairs, default=(0.0,))
            if gap >= 0:
                return kept + [[one] for one in single]
            pair = [single[number] for number in chosen]
            single = [one for number, one in enumerate(single) if number not in chosen]
            kept.append(self._touching(pair, single + [fit for fits in kept for fit in fits]) or pair)

    def _touching(self, pair: list[Fit], others: list[Fit]) -> list[Fit] | None:
        """Return the fits of two spheres together; None where they are not two."""
        apart = [other for other in others if not any(other is one for one in pair)]
        places, radii = np.array([one.centre_px for one in pair]), np.array([one.radius_px for one in pair])
        return self._two(~_covered(self.grey.shape, apart, pair), places, radii)

    def _mended(self, groups: list[list[Fit]]) -> list[list[Fit]]:
        """Return the groups, spheres that something hides in part fitted anew with about the size of the others."""
        sound = [fit for group in groups for fit in group if fit.explained > _SOUND]
        if len(sound) < _LEAST_SOUND:
            return groups
        size_sd = float(np.clip(np.std([np.log(fit.radius_px) for fit in sound], ddof=1), *_SIZE_SDS))
        alike = Alike(*(np.median([getattr(fit, part) for fit in sound], axis=0) for part in _ALIKE_PARTS), size_sd)
        size = alike.radius_px
        groups = [self._one_of_two(group, alike) if len(group) > 1 else group for group in groups]
        whole = [fit for group in groups for fit in group if _is_whole(fit, group, size)]
        found, places = [], [fit.centre_px for fit in whole]
        for group in groups:
            kept = []
            for fit in group:
                if any(fit is other for other in whole):
                    kept.append(fit)
                    continue
                one = self._completed(fit, alike, whole)
                # parts of one sphere come to the same place
                if one and all(np.linalg.norm(one.centre_px - place) >= _SAME_PLACE * size for place in places):
                    places.append(one.centre_px)
                    kept.append(one)
            found.append(kept)
        return found

    def _one_of_two(self, pair: list[Fit], alike: Alike) -> list[Fit]:
        """Return two spheres, or the one of which they may be parts, if something hides it in between."""
        if pair[0].left < (_CLEAN * max(fit.contrast for fit in pair)) ** 2:
            return pair
        tried = [self._completed(fit, alike, []) for fit in pair]
        best = min((fit for fit in tried if fit), key=lambda fit: fit.left, default=None)
        return [best] if best is not None and best.left < pair[0].left else pair

    def _completed(self, fit: Fit, alike: Alike, whole: list[Fit]) -> Fit | None:
        """Return the sphere like the others of which a fit shows a part; None where it is not surely one."""
        shape, usable = self._shape(fit.centre_px), ~_discs(self.grey.shape, whole)
        if shape is None:
            return None
        starts = places_of_part(self.grey, usable, alike, centre_px=fit.centre_px, shape=shape, count=_PLACES)
        tried = [
            fit_spheres(
                self.grey, usable, self.saturated, centres_px=start, radii_px=alike.radius_px, shape=shape,
                within=(fit.centre_px, PART_WINDOW * alike.radius_px), alike=alike,
            )
            for start in starts
        ]  # fmt: skip
        best = min((one[0] for one in tried if one), key=lambda one: one.left, default=None)
        if best is None or not _about(best, alike):
            fair = fit.explained > _FAIR_EXPLAINED and _size_off(fit, alike) < _OTHER_SIZE
            return fit if fair else None
        return best if _is_sphere(best) and best.seen > _LEAST_SEEN and best.left < _AS_WELL * fit.left else None

    def _shape(self, place_px: np.ndarray) -> np.ndarray | None:
        """Return the shape (2, 2) of a small outline there; None where no ray goes."""
        if self.lens is None:
            return np.eye(2)
        slope = local_map(self.lens, place_px)
        return None if slope is None else shape_of(slope)

    def _one(self, blob: Candidate, usable: np.ndarray, way_px: np.ndarray | None = None) -> Fit | None:
        fits = fit_spheres(
            self.grey, usable, self.saturated, centres_px=blob.centre_px, radii_px=blob.radius_px,
            shape=self._shape(blob.centre_px), within=(blob.centre_px, blob.radius_px), way_px=way_px,
        )  # fmt: skip
        return fits[0] if fits else None

    def _split(self, look: _Look) -> list[Fit] | None:
        """Return two spheres of a blob, from its middle and second moments; None where they are not two."""
        spread, ways = np.linalg.eigh(look.moments)
        most = look.blob.radius_px
        radius = float(np.clip(2 * np.sqrt(spread[0]), 0.6 * most, 1.1 * most))
        apart = float(np.clip(2 * np.sqrt(spread[1] - spread[0]), 0.5 * radius, 1.6 * radius))
        centres = look.middle + np.outer([0.5, -0.5], apart * ways[:, 1])
        return self._two(look.usable, centres, np.full(2, radius), within=(look.blob.centre_px, most))

    def _two(self, usable: np.ndarray, centres_px: np.ndarray, radii_px: np.ndarray, within=None) -> list[Fit] | None:
        """Return the fits of two spheres, the front one first, from rough ones; None where they are not two."""
        shape = self._shape(centres_px.mean(axis=0))
        if shape is None:
            return None
        tried = [
            fit_spheres(
                self.grey, usable, self.saturated, centres_px=centres_px[order], radii_px=radii_px[order],
                shape=shape, within=within,
            )
            for order in ([0, 1], [1, 0])
        ]  # fmt: skip
        fits = min((one for one in tried if one), key=lambda one: one[0].left, default=None)
        if fits is None or not all(_is_sphere(fit, least=_TWO_EXPLAINED) for fit in fits):
            return None
        faint, bright = sorted(fit.contrast for fit in fits)
        apart = np.linalg.norm(fits[0].centre_px - fits[1].centre_px) / min(fit.radius_px for fit in fits)
        return fits if faint > _LEAST_OF_TWO * bright and apart > _APART_RADII else None


def _is_sphere(fit: Fit, *, least: float = _LEAST_EXPLAINED) -> bool:
    # a centre that is not known to its own radius is none
    sure = np.sqrt(np.linalg.eigvalsh(fit.covariance_px2)[-1]) * _LEAST_CONTRAST_SDS <= fit.radius_px
    return bool(fit.explained >= least and fit.contrast > 0 and sure)


def _size_off(fit: Fit, alike: Alike) -> float:
    """Return the size of the log of a radius over that of the others."""
    return float(abs(np.log(fit.radius_px / alike.radius_px)))


def _about(fit: Fit, alike: Alike) -> bool:
    """Whether a fit has about the size of the others, or leaves next to nothing with another."""
    off, clean = _size_off(fit, alike), fit.left < (_CLEAN * fit.contrast) ** 2
    return off < _SIZES_ALIKE * alike.size_sd or (off < _OTHER_SIZE and clean and fit.seen > _MOSTLY_SEEN)


def _is_whole(fit: Fit, group: list[Fit], size_px: float) -> bool:
    """Whether a fit shows a whole sphere, surely or of about that size, or is one of a group of such."""
    like = _LIKE_SIZE[0] < np.log(fit.radius_px / size_px) < _LIKE_SIZE[1]
    return like if len(group) > 1 else fit.explained > (_WHOLE_EXPLAINED if like else _SOUND)


def _gap(one: Fit, other: Fit) -> float:
    """Return the width of the ground between two spheres [px] less what is blurred."""
    between = np.linalg.norm(one.centre_px - other.centre_px) - one.radius_px - other.radius_px
    return float(between - one.blur_px - other.blur_px)


def _move_alike(ways: list[np.ndarray], count: int) -> bool:
    """Whether more than half of all blobs are drawn out, in about the same way."""
    if 2 * len(ways) <= count:
        return False
    longest = max(ways, key=np.linalg.norm)
    # a way turned round is the same
    turned = np.array([way if way @ longest >= 0 else -way for way in ways])
    middle = np.median(turned, axis=0)
    return bool(np.median(np.linalg.norm(turned - middle, axis=1)) < _ALIKE * np.linalg.norm(middle))


def _way(moments: np.ndarray) -> np.ndarray:
    """Return the way (2,) [px] of a ball that leaves a streak of these second moments (2, 2): a line's and a disc's."""
    spread, ways = np.linalg.eigh(moments)
    return np.sqrt(12 * (spread[1] - spread[0])) * ways[:, 1]


def _moments(grey: np.ndarray, usable: np.ndarray, blob: Candidate) -> tuple[np.ndarray | None, np.ndarray | None]:
    """Return the middle (2,) [px] and the second moments (2, 2) [px^2] of a blob's light; None where it has none.

    A ball that moves during the exposure is drawn out along its way, symmetrically about its place in the middle of it:
    taken for round it would be a ball lit from one side, and its centre off.
    """
    reach = _MOMENTS_RADII * blob.radius_px
    low = np.maximum(np.floor(blob.centre_px - reach).astype(int), 0)
    high = np.ceil(blob.centre_px + reach).astype(int)
    part = np.s_[low[1] : high[1], low[0] : high[0]]
    rows, columns = np.mgrid[: grey.shape[0], : grey.shape[1]][:, *part] + 0.5
    values = np.where(usable[part], grey[part] - np.median(grey[part]), 0.0)
    light = np.where(values > _MOMENTS_LEAST * max(values.max(), 0), values, 0.0)
    if not light.sum() > 0:
        return None, None
    middle = np.array([(light * columns).sum(), (light * rows).sum()]) / light.sum()
    aside = np.stack([columns, rows], axis=-1) - middle
    moments = np.einsum("ij,ijk,ijl->kl", light, aside, aside) / light.sum()
    return (middle, moments) if np.linalg.eigvalsh(moments)[0] > 0 else (None, None)


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
