"""A batch of problems for the core of a solver: checked, sorted by kind, centred, in chunks; and its poses back again.

A core sees targets about their centroid, in units of their root-mean-square size, all flat or all solid, none of them
degenerate; it may return any pose, NaN where it finds none.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from uwsim.pose.reprojection import CHUNK, cost_of
from uwsim.pose.solution import LINE_SHARE, Solution, Status, Twin, accept, check_points

FLAT_SHARE = 1e-6
"""Spread across the plane, as a share of the whole, below which a target counts as flat."""
_SAME_SHARE = 1e-6
_SAME_IMAGE = 1e-12
SAME_POSE = 0.05
"""Entries of rotations closer than this, about 3 deg: near-by minima of a target seen face-on count as one."""
# above so many points a chunk holds fewer problems
_CHUNK_POINTS = 16


class Centred(NamedTuple):
    """Problems of one kind: targets (B, n, 3) about their centroid in units of their size, images (B, n, 2).

    `origin` (B, 3): the target's own origin in those coordinates. Where `flat`, the third axis is the plane's normal.
    """

    target: np.ndarray
    image: np.ndarray
    origin: np.ndarray
    flat: bool


class Poses(NamedTuple):
    """Rotations (..., B, 3, 3) and translations (..., B, 3), and where known the second minima of the same shapes."""

    rotation: np.ndarray
    translation: np.ndarray
    twin_rotation: np.ndarray | None = None
    twin_translation: np.ndarray | None = None


def solved(
    points_m: np.ndarray, points: np.ndarray, core: Callable[[Centred], Poses], *, minimum: int, where: str,
    flat_ok: bool = True, solid_ok: bool = True, flat_share: float = FLAT_SHARE, chunk: int = CHUNK,
) -> Solution:  # fmt: skip
    """Return the poses that a core finds for target points (B, n, 3) [m] and normalised image points (B, n, 2).

    Degenerate targets, and those of a kind that the core cannot do, have a status and no pose. `chunk` problems are
    handed over at once. Raises what `check_points` raises.
    """
    points_m, points = check_points(points_m, points, minimum=minimum, where=where)
    centre_m = points_m.mean(axis=1)
    around_m = points_m - centre_m[:, None]
    size_m = np.sqrt(np.einsum("bni,bni->b", around_m, around_m) / points_m.shape[1])
    target = around_m / np.where(size_m > 0, size_m, 1.0)[:, None, None]
    scatter = np.swapaxes(target, 1, 2) @ target / points_m.shape[1]
    usable, flat = _kinds(target, scatter, points, flat_share)
    status = np.where(usable, Status.OK, Status.DEGENERATE)
    status[usable & ~(flat if not solid_ok else ~flat if not flat_ok else usable)] = Status.WRONG_KIND
    rotation, translation = _nothing(len(points_m))
    twin = _nothing(len(points_m))
    chunk = max(1, min(chunk, chunk * _CHUNK_POINTS // points_m.shape[1]))
    for kind in (False, True):
        chosen = np.flatnonzero((status == Status.OK) & (flat == kind))
        for first in range(0, len(chosen), chunk):
            part = chosen[first : first + chunk]
            origin = -centre_m[part] / size_m[part, None]
            found = _found(core, target[part], points[part], origin, kind, scatter[part])
            rotation[part], translation[part] = found.rotation, found.translation
            if found.twin_rotation is not None:
                twin[0][part], twin[1][part] = found.twin_rotation, found.twin_translation
    twin = _twin(twin, (rotation, translation), target, points)
    solution = accept(rotation, _outside(rotation, translation, size_m, centre_m), points_m, points, status=status)
    twin = twin._replace(translation_m=_outside(twin.rotation, twin.translation_m, size_m, centre_m))
    return solution._replace(twin=Twin(*(np.where(_like(solution.ok, part), part, np.nan) for part in twin)))


def _nothing(count: int) -> tuple[np.ndarray, np.ndarray]:
    return np.full((count, 3, 3), np.nan), np.full((count, 3), np.nan)


def _like(flags: np.ndarray, values: np.ndarray) -> np.ndarray:
    return flags.reshape(-1, *[1] * (values.ndim - 1))


def _outside(rotation: np.ndarray, translation: np.ndarray, size_m: np.ndarray, centre_m: np.ndarray) -> np.ndarray:
    """Return translations [m] of the target's own origin."""
    return size_m[:, None] * translation - (rotation @ centre_m[:, :, None])[..., 0]


def _kinds(
    target: np.ndarray, scatter: np.ndarray, points: np.ndarray, flat_share: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return (usable, flat), (B,) bool, from the invariants of the scatter (trace 1): no eigenvalues needed."""
    minors = (
        scatter[:, 0, 0] * scatter[:, 1, 1] - scatter[:, 0, 1] ** 2
        + scatter[:, 1, 1] * scatter[:, 2, 2] - scatter[:, 1, 2] ** 2
        + scatter[:, 0, 0] * scatter[:, 2, 2] - scatter[:, 0, 2] ** 2
    )  # fmt: skip
    off_line = minors > LINE_SHARE**2
    flat = np.linalg.det(scatter) <= flat_share**2 * minors
    spread = np.abs(points - points.mean(axis=1, keepdims=True)).max(axis=(1, 2)) > _SAME_IMAGE
    return off_line & spread & _four_different(target), flat


def _four_different(target: np.ndarray) -> np.ndarray:
    """Return (B,) where at least four of the points (B, n, 3) are different: the farthest from those before, thrice."""
    everyone = np.arange(len(target))
    nearest = ((target - target[:, :1]) ** 2).sum(axis=2)
    for _ in range(2):
        farthest = target[everyone, nearest.argmax(axis=1)]
        nearest = np.minimum(nearest, ((target - farthest[:, None]) ** 2).sum(axis=2))
    return np.sum(nearest > _SAME_SHARE**2, axis=1) >= 1 if target.shape[1] > 3 else np.zeros(len(target), bool)


def _found(core, target, image, origin, flat: bool, scatter: np.ndarray) -> Poses:
    if not flat:
        return core(Centred(target, image, origin, flat))
    # the principal axes, least spread last, right-handed
    axes = np.linalg.eigh(scatter)[1][..., ::-1]
    axes = axes * np.linalg.det(axes)[:, None, None]
    found = core(Centred(target @ axes, image, (origin[:, None] @ axes)[:, 0], flat))
    back = np.swapaxes(axes, 1, 2)
    twin = found.twin_rotation
    return found._replace(
        rotation=found.rotation @ back, twin_rotation=twin if twin is None else found.twin_rotation @ back
    )


def _twin(twin: tuple, pose: tuple, target: np.ndarray, points: np.ndarray) -> Twin:
    """Return second minima with their cost ratio; NaN where they are none or the pose itself."""
    ratio = np.full(len(target), np.nan)
    known = np.flatnonzero(np.all(np.isfinite(twin[0]), axis=(1, 2)) & np.all(np.isfinite(pose[0]), axis=(1, 2)))
    if len(known):
        costs = [cost_of(*(part[known] for part in found), target[known], points[known]) for found in (twin, pose)]
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio[known] = costs[0] / costs[1]
    apart = np.abs(twin[0] - pose[0]).max(axis=(1, 2)) > SAME_POSE
    real = apart & np.isfinite(twin[0][:, 0, 0]) & ~np.isnan(ratio)
    rotation, translation = (np.where(_like(real, part), part, np.nan) for part in twin)
    return Twin(rotation, translation, np.where(real, ratio, np.nan))


def least(candidates: Poses, centred: Centred) -> Poses:
    """Return of candidates (k, B, ...) that of least reprojection error; for flat targets the next different one too.

    NaN where every candidate has points behind the camera.
    """
    costs = np.array(
        [cost_of(r, t, centred.target, centred.image) for r, t in zip(*candidates[:2], strict=True)]
    )  # fmt: skip
    return least_of(candidates, costs, flat=centred.flat)


def least_of(candidates: Poses, costs: np.ndarray, *, flat: bool) -> Poses:
    """Return as `least` from known costs (k, B), infinite for what is no pose."""
    everyone = np.arange(costs.shape[1])
    first = np.argmin(costs, axis=0)
    rotation, translation = candidates.rotation[first, everyone], candidates.translation[first, everyone]
    none = ~np.isfinite(costs[first, everyone])
    rotation[none], translation[none] = np.nan, np.nan
    if not flat or len(costs) < 2:
        return Poses(rotation, translation)
    same = np.abs(candidates.rotation - rotation).max(axis=(2, 3)) <= SAME_POSE
    others = np.where(same, np.inf, costs)
    second = np.argmin(others, axis=0)
    twin = candidates.rotation[second, everyone], candidates.translation[second, everyone]
    none = ~np.isfinite(others[second, everyone])
    twin[0][none], twin[1][none] = np.nan, np.nan
    return Poses(rotation, translation, *twin)
