"""A batch of problems for the core of a solver: checked, sorted by kind, centred, in chunks; and its poses back again.

A core sees targets about their centroid, in units of their root-mean-square size, all of one kind, none of them
degenerate; it may return any pose, NaN where it finds none.

Three kinds: flat, nearly flat, solid. The image of a flat target has two minima of the reprojection error, mirror
images of each other about the line of sight or nearly so. A target that leaves its plane by less than noise can show,
as a board does whose corners have been measured, has both as well: a core has to try both there, although the points
span a space, and which one is right only the points' true places say.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from uwsim.pose.reprojection import CHUNK, cost_of
from uwsim.pose.solution import LINE_SHARE, Solution, Status, Twin, accept, check_points

FLAT_SHARE = 1e-6
"""Spread across the plane, as a share of the whole, up to which a target counts as flat."""
NEARLY_FLAT = 0.1
"""The same share up to which a target counts as nearly flat: the second minimum is to be tried.

Of four corners of a square seen 6 times its edge away with 0.2 px of noise on 117 px, a start that takes them for solid
ends in the wrong minimum in 48 % at shares to 3e-3, 30 at 0.01, 11 at 0.03, 2 at 0.06, 0.2 at 0.1; with ten times the
noise in 15 at 0.03 and in no more than the least reprojection error does at 0.1. The share does not ask for the noise.
"""
_SAME_SHARE = 1e-6
_SAME_IMAGE = 1e-12
SAME_POSE = 0.05
"""Entries of rotations closer than this, about 3 deg: near-by minima of a target seen face-on count as one."""
# above so many points a chunk holds fewer problems
_CHUNK_POINTS = 16


class Centred(NamedTuple):
    """Problems of one kind: targets (B, n, 3) about their centroid in units of their size, images (B, n, 2).

    `origin` (B, 3): the target's own origin in those coordinates. Where `flat`, the third axis is the plane's normal,
    and there are two minima to try; where `relief` too, the target is nearly flat, and its points are off that plane.
    """

    target: np.ndarray
    image: np.ndarray
    origin: np.ndarray
    flat: bool
    relief: bool = False


class Poses(NamedTuple):
    """Rotations (..., B, 3, 3) and translations (..., B, 3), and where known the second minima of the same shapes."""

    rotation: np.ndarray
    translation: np.ndarray
    twin_rotation: np.ndarray | None = None
    twin_translation: np.ndarray | None = None


def solved(
    points_m: np.ndarray, points: np.ndarray, core: Callable[[Centred], Poses], *, minimum: int, where: str,
    flat_ok: bool = True, solid_ok: bool = True, flat_share: float = NEARLY_FLAT, chunk: int = CHUNK,
) -> Solution:  # fmt: skip
    """Return the poses that a core finds for target points (B, n, 3) [m] and normalised image points (B, n, 2).

    Targets are handed over as flat up to `flat_share` (`FLAT_SHARE` at least). Degenerate ones, and those of a kind
    that the core cannot do, have a status and no pose. `chunk` problems are handed over at once. Raises what
    `check_points` raises.
    """
    points_m, points = check_points(points_m, points, minimum=minimum, where=where)
    centre_m = points_m.mean(axis=1)
    around_m = points_m - centre_m[:, None]
    size_m = np.sqrt(np.einsum("bni,bni->b", around_m, around_m) / points_m.shape[1])
    target = around_m / np.where(size_m > 0, size_m, 1.0)[:, None, None]
    scatter = scatter_of(target)
    usable = _usable(target, scatter, points)
    flat = flat_up_to(flat_share, scatter)
    relief = flat & ~flat_up_to(FLAT_SHARE, scatter)
    status = np.where(usable, Status.OK, Status.DEGENERATE)
    status[usable & ~(flat if not solid_ok else ~flat if not flat_ok else usable)] = Status.WRONG_KIND
    rotation, translation = _nothing(len(points_m))
    twin = _nothing(len(points_m))
    chunk = max(1, min(chunk, chunk * _CHUNK_POINTS // points_m.shape[1]))
    for kind in (~flat, flat & ~relief, relief):
        chosen = np.flatnonzero((status == Status.OK) & kind)
        for first in range(0, len(chosen), chunk):
            part = chosen[first : first + chunk]
            origin = -centre_m[part] / size_m[part, None]
            centred = Centred(target[part], points[part], origin, bool(flat[part[0]]), bool(relief[part[0]]))
            found = _found(core, centred, scatter[part])
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


def scatter_of(target: np.ndarray) -> np.ndarray:
    """Return mean p p^T (B, 3, 3) of points (B, n, 3)."""
    return np.swapaxes(target, 1, 2) @ target / target.shape[1]


def _minors(scatter: np.ndarray) -> np.ndarray:
    """Return the second invariants (B,) of scatters of trace 1."""
    return (
        scatter[:, 0, 0] * scatter[:, 1, 1] - scatter[:, 0, 1] ** 2
        + scatter[:, 1, 1] * scatter[:, 2, 2] - scatter[:, 1, 2] ** 2
        + scatter[:, 0, 0] * scatter[:, 2, 2] - scatter[:, 0, 2] ** 2
    )  # fmt: skip


def flat_up_to(share: float, scatter: np.ndarray) -> np.ndarray:
    """Return (B,) where targets of scatter (B, 3, 3) are flat up to a share of their size.

    By the invariants of the scatter, whose trace is 1: no eigenvalues needed.
    """
    return np.linalg.det(scatter) <= share**2 * _minors(scatter)


def _usable(target: np.ndarray, scatter: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return (B,) where points and images say something of the pose."""
    spread = np.abs(points - points.mean(axis=1, keepdims=True)).max(axis=(1, 2)) > _SAME_IMAGE
    return (_minors(scatter) > LINE_SHARE**2) & spread & _four_different(target)


def _four_different(target: np.ndarray) -> np.ndarray:
    """Return (B,) where at least four of the points (B, n, 3) are different: the farthest from those before, thrice."""
    everyone = np.arange(len(target))
    nearest = ((target - target[:, :1]) ** 2).sum(axis=2)
    for _ in range(2):
        farthest = target[everyone, nearest.argmax(axis=1)]
        nearest = np.minimum(nearest, ((target - farthest[:, None]) ** 2).sum(axis=2))
    return np.sum(nearest > _SAME_SHARE**2, axis=1) >= 1 if target.shape[1] > 3 else np.zeros(len(target), bool)


def _found(core: Callable[[Centred], Poses], centred: Centred, scatter: np.ndarray) -> Poses:
    if not centred.flat:
        return core(centred)
    # the principal axes, least spread last, right-handed
    axes = np.linalg.eigh(scatter)[1][..., ::-1]
    axes = axes * np.linalg.det(axes)[:, None, None]
    found = core(
        centred._replace(target=centred.target @ axes, origin=(centred.origin[:, None] @ axes)[:, 0])
    )  # fmt: skip
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


def together(found: list[Poses]) -> Poses:
    """Return poses as candidates (k, B, ...)."""
    return Poses(np.stack([one.rotation for one in found]), np.stack([one.translation for one in found]))


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
