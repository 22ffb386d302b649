"""Which of the points that a picture shows is which of a body: markers without a name.

By the places that they should be at (`nearest`), or without any (`search`): every three points of the body on a few
triples of points seen give poses (P3P); the pose counts that takes the most points of the body to points seen, of
those the one of least error. A body that turns into itself can be found only up to these turns (`symmetries`): an
octahedron up to 24, a square up to 4 and over the other side, and no picture can tell these apart.
"""

from itertools import combinations, permutations
from typing import NamedTuple

import numpy as np

_TRIPLES = 12
_SAME_SHARE = 1e-3
_MOST_POINTS = 24
_FLATTEST = 0.05
# pairs that have to agree before another is called a stranger; how rarely that is wrong; errors that are none
_LEAST_AGREEING, _BY_CHANCE, _EXACT_SHARE = 6, 1e-3, 0.01


class Match(NamedTuple):
    """Indices of points of the body and of points seen, (k,) each, that belong together; `cost`: mean squared error.

    `rivals`: how many other poses, but for turns of the body into itself, explain as many points as well to within a
    factor of four in the error.
    """

    body: np.ndarray
    seen: np.ndarray
    cost: float
    rivals: int = 0


def nearest(expected: np.ndarray, seen: np.ndarray, *, within: float) -> Match:
    """Return the pairs of expected places (n, 2) and points seen (m, 2) of least total distance, up to `within`.

    Places that are NaN have no pair. Source: the assignment problem, `scipy.optimize.linear_sum_assignment`.
    """
    from scipy.optimize import linear_sum_assignment

    expected, seen = np.asarray(expected, float).reshape(-1, 2), np.asarray(seen, float).reshape(-1, 2)
    gaps = np.linalg.norm(expected[:, None] - seen[None], axis=-1)
    costs = np.where(np.isfinite(gaps), np.minimum(gaps, within) ** 2, within**2)
    rows, columns = linear_sum_assignment(costs)
    kept = gaps[rows, columns] <= within
    rows, columns = rows[kept], columns[kept]
    return Match(rows, columns, float(np.mean(gaps[rows, columns] ** 2)) if len(rows) else np.inf)


def search(points_m: np.ndarray, seen: np.ndarray, *, within: float, least: int = 5) -> Match | None:
    """Return which of the body's points (n, 3) [m] are the normalised image points (m, 2) seen; None if that is open.

    `within`: distance on the plane z = 1 up to which they agree. Fewer than `least` that agree tell nothing: three fit
    always, a fourth often. Points behind others need not be seen, and points may be seen that are none of the body's; a
    pair that all others contradict is left out.
    ValueError for fewer than 4 or more than 24 points of the body.
    """
    points_m, seen = np.asarray(points_m, float), np.asarray(seen, float).reshape(-1, 2)
    if not 4 <= len(points_m) <= _MOST_POINTS:
        raise ValueError(f"search: got {len(points_m)} points of the body, allowed: 4 to {_MOST_POINTS}")
    if len(seen) < max(least, 4):
        return None
    same = symmetries(points_m)
    rotation, translation_m = _hypotheses(points_m, seen, same)
    if not len(rotation):
        return None
    count, cost = _support(rotation, translation_m, points_m, seen, within)
    order = np.lexsort((cost, -count))
    if count[order[0]] < least:
        return None
    found = [_pairs(rotation[at], translation_m[at], points_m, seen, within) for at in order[:200]]
    most = max(len(one.body) for one in found)
    fullest = sorted((one for one in found if len(one.body) == most), key=lambda one: one.cost)
    if most < least:
        return None
    best = fullest[0]
    rivals = {_name(one, same) for one in fullest if one.cost <= 16 * best.cost} - {_name(best, same)}
    return _without_strangers(best, points_m, seen, within)._replace(rivals=len(rivals))


def symmetries(points_m: np.ndarray) -> np.ndarray:
    """Return the turns of a body into itself as permutations (k, n) of its points (n, 3) [m], the identity first.

    Turned, point `i` is where point `permutation[i]` was. Turns of solid bodies, no mirror images; a flat body's turns
    to its other side count. By trying all images of three points: few points.
    """
    points_m = np.asarray(points_m, float)
    size = np.linalg.norm(points_m - points_m.mean(axis=0), axis=1).max()
    gaps = np.linalg.norm(points_m[:, None] - points_m[None], axis=-1)
    first = _wide_triple(points_m)
    found = [np.arange(len(points_m))]
    for image in permutations(range(len(points_m)), 3):
        if np.abs(gaps[np.ix_(image, image)] - gaps[np.ix_(first, first)]).max() > _SAME_SHARE * size:
            continue
        turn, shift = _rigid(points_m[list(first)], points_m[list(image)])
        moved = np.linalg.norm((points_m @ turn.T + shift)[:, None] - points_m[None], axis=-1)
        where = moved.argmin(axis=1)
        if np.all(moved.min(axis=1) <= _SAME_SHARE * size) and not np.array_equal(where, found[0]):
            found.append(where)
    return np.unique(np.stack(found), axis=0)


def _wide_triple(points: np.ndarray) -> tuple[int, ...]:
    """Return three points that span the largest triangle."""
    triples = np.array(list(combinations(range(len(points)), 3)))
    return tuple(int(at) for at in triples[_areas(points[triples]).argmax()])


def _areas(corners: np.ndarray) -> np.ndarray:
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    squares = (first**2).sum(-1) * (second**2).sum(-1) - (first * second).sum(-1) ** 2
    return np.sqrt(np.clip(squares, 0, None)) / 2


def _rigid(first: np.ndarray, second: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the proper rotation and the shift that take points (3, 3) to others best. Source: Kabsch 1976."""
    middles = first.mean(axis=0), second.mean(axis=0)
    u, _, vt = np.linalg.svd((second - middles[1]).T @ (first - middles[0]))
    turn = u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt
    return turn, middles[1] - turn @ middles[0]


def _hypotheses(points_m: np.ndarray, seen: np.ndarray, same: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return poses (k, 3, 3), (k, 3) [m] that take three points of the body to three seen."""
    import cv2
    from scipy.spatial.transform import Rotation

    triples = np.array(list(combinations(range(len(seen)), 3)))
    areas = _areas(seen[triples])
    wide = triples[np.argsort(-areas)]
    wide = wide[: max(1, np.count_nonzero(areas > _FLATTEST * areas.max()))]
    # spread over the wide ones: the widest all share a point, that may be none of the body's
    chosen = wide[np.linspace(0, len(wide) - 1, min(_TRIPLES, len(wide))).round().astype(int)]
    # one of the images that turns of the body make of each other
    bodies = [image for image in permutations(range(len(points_m)), 3)
              if image == min(tuple(turn[list(image)].tolist()) for turn in same)]  # fmt: skip
    vectors, shifts = [], []
    for triple in chosen:
        image = np.ascontiguousarray(seen[triple])
        for body in bodies:
            target = np.ascontiguousarray(points_m[list(body)])
            number, turn, shift = cv2.solveP3P(target, image, np.eye(3), None, flags=cv2.SOLVEPNP_AP3P)
            vectors += turn[:number] if number else ()
            shifts += shift[:number] if number else ()
    if not vectors:
        return np.empty((0, 3, 3)), np.empty((0, 3))
    rotation = Rotation.from_rotvec(np.reshape(vectors, (-1, 3))).as_matrix()
    translation_m = np.reshape(shifts, (-1, 3))
    fine = np.all(np.isfinite(translation_m), axis=1) & np.all(np.isfinite(rotation), axis=(1, 2))
    return rotation[fine], translation_m[fine]


def _support(rotation, translation_m, points_m, seen, within: float) -> tuple[np.ndarray, np.ndarray]:
    """Return how many of the body's points fall on points seen (k,) and the squared error, with `within` for others."""
    count, cost = np.empty(len(rotation), int), np.empty(len(rotation))
    for first in range(0, len(rotation), 4096):
        part = slice(first, first + 4096)
        camera = points_m @ np.swapaxes(rotation[part], 1, 2) + translation_m[part, None]
        before = np.all(camera[..., 2] > 0, axis=1)
        image = camera[..., :2] / np.where(camera[..., 2:] > 0, camera[..., 2:], np.nan)
        gaps = np.linalg.norm(image[:, :, None] - seen, axis=-1).min(axis=2)
        inside = gaps <= within
        count[part] = np.where(before, inside.sum(axis=1), 0)
        cost[part] = np.where(before, np.where(inside, gaps**2, within**2).sum(axis=1), np.inf)
    return count, cost


def _pairs(rotation, translation_m, points_m, seen, within: float) -> Match:
    """Return the pairs of a pose, made again from the pose of least error of these."""
    from uwsim.pose.solvers import best

    camera = points_m @ rotation.T + translation_m
    match = nearest(camera[:, :2] / camera[:, 2:], seen, within=within)
    if len(match.body) < best.MINIMUM_POINTS:
        return match
    solution = best.solve(points_m[None, match.body], seen[None, match.seen])
    if not solution.ok[0]:
        return match
    camera = points_m @ solution.rotation[0].T + solution.translation_m[0]
    if not np.all(camera[:, 2] > 0):
        return match
    return nearest(camera[:, :2] / camera[:, 2:], seen, within=within)


def _without_strangers(match: Match, points_m: np.ndarray, seen: np.ndarray, within: float) -> Match:
    """Return the match less pairs that all others together contradict: a point half hidden, or two seen as one.

    The pair without which the rest agrees best goes if noise alone would show that once in a thousand bodies.
    Source: the F test of two coordinates left out, times the number of pairs.
    """
    from scipy.stats import f

    from uwsim.pose.solvers import best

    while len(match.body) > _LEAST_AGREEING:
        count = len(match.body)
        others = np.array([np.delete(np.arange(count), at) for at in range(count)])
        whole = best.solve(points_m[None, match.body], seen[None, match.seen]).cost[0]
        without = best.solve(points_m[match.body[others]], seen[match.seen[others]]).cost
        stranger = int(np.nanargmin(without)) if np.any(np.isfinite(without)) else 0
        left, freedom = without[stranger], 2 * count - 8
        if not (whole > count * (_EXACT_SHARE * within) ** 2 and left < whole):
            break
        if count * f.sf((whole - left) / 2 / (left / freedom), 2, freedom) > _BY_CHANCE:
            break
        kept = others[stranger]
        match = match._replace(body=match.body[kept], seen=match.seen[kept], cost=float(left / len(kept)))
    return match


def _name(match: Match, same: np.ndarray) -> tuple:
    """Return the same for all matches that turns of the body make of each other."""
    return min(tuple(sorted(zip(match.seen.tolist(), turn[match.body].tolist(), strict=True))) for turn in same)
