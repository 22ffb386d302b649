"""Poses from the placing of one edge, the method of `solvers.rpnp`, where it is derived."""

import numpy as np

from uwsim.pose.batches import Centred, Poses, least
from uwsim.pose.control_points import absolute_orientation
from uwsim.pose.polynomials import derivative, multiplied, roots, value

_MINIMA = 4
# a root of a double minimum leaves the real axis by the root of the round-off
_REAL = 1e-5


def by_placed_edges(centred: Centred) -> Poses:
    """Return of the poses at the minima the one of least reprojection error."""
    sight = np.concatenate([centred.image, np.ones((*centred.image.shape[:2], 1))], axis=2)
    sight = sight / np.linalg.norm(sight, axis=2, keepdims=True)
    first, second = _farthest_apart(sight)
    everyone = np.arange(len(sight))
    ends = centred.target[everyone, first], centred.target[everyone, second]
    lines = sight[everyone, first], sight[everyone, second]
    with np.errstate(divide="ignore", invalid="ignore"):
        quartics = _quartics(centred.target, sight, ends, lines, (first, second))
    tilts = _tilts(quartics)
    found = [_placed(centred, sight, ends, lines, tilts[:, place]) for place in range(_MINIMA)]
    return least(
        Poses(np.stack([one.rotation for one in found]), np.stack([one.translation for one in found])), centred
    )


def _farthest_apart(sight: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the indices (B,), (B,) of two lines of sight far apart: each the farthest from the other, or nearly so."""
    everyone = np.arange(len(sight))

    def farthest_from(line: np.ndarray) -> np.ndarray:
        return (sight @ line[:, :, None])[..., 0].argmin(axis=1)

    first = farthest_from(sight.mean(axis=1))
    second = farthest_from(sight[everyone, first])
    return second, farthest_from(sight[everyone, second])


def _quartics(target, sight, ends, lines, chosen) -> np.ndarray:
    """Return the quartics (B, n, 5) of the third points, by the squares of their sides; 0 for the ends themselves."""
    edge2 = ((ends[1] - ends[0]) ** 2).sum(axis=1)[:, None]
    near2, far2 = (((target - end[:, None]) ** 2).sum(axis=2) / edge2 for end in ends)
    # differences of cosines, all small far away, as products of cross products
    across = np.cross(*lines)
    across1, across2 = (np.cross(line[:, None], sight) for line in lines)
    sine2 = (across**2).sum(axis=1)[:, None]
    sine = np.sqrt(sine2)
    cosine1, cosine2 = (np.einsum("bni,bi->bn", sight, line) for line in lines)
    offset = np.einsum("bi,bni->bn", across, across2)  # c c2 - c1
    twist = np.einsum("bni,bni->bn", across1, across2)  # c - c1 c2
    gap = far2 - near2
    upper = np.stack([1 + gap + 2 * cosine1 * offset / sine2, -2 * twist / sine, gap - 1], axis=2)
    lower = np.stack([-offset / sine, -cosine2], axis=2)
    rest = np.stack([near2 - (across1**2).sum(axis=2) / sine2, 0 * near2, near2], axis=2)
    quartic = multiplied(upper, upper) - 4 * multiplied(multiplied(lower, lower), rest)
    quartic /= (near2 + far2)[..., None]
    everyone = np.arange(len(target))
    for end in chosen:
        quartic[everyone, end] = 0.0
    return quartic


def _tilts(quartics: np.ndarray) -> np.ndarray:
    """Return the places (B, 4) of the least minima of the sum of squares; NaN where there are fewer."""
    total = np.zeros((len(quartics), 9))
    for power in range(5):
        total[:, power : power + 5] += np.einsum("bn,bnk->bk", quartics[..., power], quartics)
    slope = derivative(total)
    found = roots(slope)
    places = found.real
    real = np.abs(found.imag) <= _REAL * np.abs(found)
    with np.errstate(over="ignore", invalid="ignore"):
        minimum = real & (value(derivative(slope), places) > 0)
        height = np.where(minimum, value(total, places), np.inf)
    order = np.argsort(height, axis=1)[:, :_MINIMA]
    return np.where(np.isfinite(np.take_along_axis(height, order, 1)), np.take_along_axis(places, order, 1), np.nan)


def _placed(centred: Centred, sight: np.ndarray, ends, lines, tilt: np.ndarray) -> Poses:
    """Return poses with the edge at one tilt (B,); NaN where that is, or puts an end behind the camera."""
    across = np.cross(*lines)
    sine = np.linalg.norm(across, axis=1)
    cosine = np.einsum("bi,bi->b", *lines)
    missing = ~(cosine + sine * tilt > 0)
    tilt = np.where(missing, 0.0, tilt)
    edge = np.linalg.norm(ends[1] - ends[0], axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        nearer = edge / (sine * np.sqrt(1 + tilt**2))
    start = nearer[:, None] * lines[0]
    before = _frame((sine * tilt)[:, None] * lines[1] - np.cross(lines[1], across))
    behind = _frame(ends[1] - ends[0])
    arm = (centred.target - ends[0][:, None]) @ behind
    cosine_sine, shift = _turn(arm, before, start, centred.image)
    turn = np.zeros((len(tilt), 3, 3))
    turn[:, 0, 0] = turn[:, 1, 1] = cosine_sine[:, 0]
    turn[:, 1, 0], turn[:, 0, 1], turn[:, 2, 2] = cosine_sine[:, 1], -cosine_sine[:, 1], 1.0
    camera = arm @ np.swapaxes(before @ turn, 1, 2) + (start + shift)[:, None]
    # to the line of sight, at the same distance along it
    along = np.einsum("bni,bni->bn", camera, sight)
    pose = absolute_orientation(centred.target, along[..., None] * sight)
    return Poses(
        np.where(missing[:, None, None], np.nan, pose.rotation), np.where(missing[:, None], np.nan, pose.translation)
    )


def _frame(axis: np.ndarray) -> np.ndarray:
    """Return right-handed frames (B, 3, 3) whose third column is along `axis` (B, 3)."""
    third = axis / np.linalg.norm(axis, axis=1, keepdims=True)
    helper = np.eye(3)[np.abs(third).argmin(axis=1)]
    first = np.cross(helper, third)
    first = first / np.linalg.norm(first, axis=1, keepdims=True)
    return np.stack([first, np.cross(third, first), third], axis=2)


def _turn(arm: np.ndarray, frame: np.ndarray, start: np.ndarray, image: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return (cosine, sine) (B, 2) of the turn about the edge, of length 1, and the shift (B, 3), by least squares.

    A camera point is c g + s h + k + shift, with g, h the frame times (x, y, 0), (-y, x, 0), and k its edge part.
    """
    x, y, z = np.moveaxis(arm[..., None], 2, 0)
    first, second, third = np.moveaxis(frame[:, None], 3, 0)
    parts = [x * first + y * second, x * second - y * first, z * third + start[:, None]]
    rows = []
    for column in range(2):
        seen = image[..., column]
        row = np.empty((*seen.shape, 6))
        for place, part in zip((0, 1, 5), parts, strict=True):
            row[..., place] = part[..., column] - seen * part[..., 2]
        row[..., 2:5] = 0.0
        row[..., 2 + column], row[..., 4] = 1.0, -seen
        rows.append(row)
    rows = np.concatenate(rows, axis=1)
    normal = np.swapaxes(rows, 1, 2) @ rows
    solution = -_regular_solve(normal[:, :5, :5], normal[:, :5, 5])
    length = np.maximum(np.linalg.norm(solution[:, :2], axis=1), 1e-300)
    turn = solution[:, :2] / length[:, None]
    known = np.concatenate([turn, np.ones((len(turn), 1))], axis=1)
    return turn, -_regular_solve(normal[:, 2:5, 2:5], (normal[:, 2:5][..., [0, 1, 5]] @ known[..., None])[..., 0])


def _regular_solve(matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
    size = matrix.shape[1]
    floor = 1e-15 * np.trace(matrix, axis1=1, axis2=2) + 1e-300
    return np.linalg.solve(matrix + floor[:, None, None] * np.eye(size), right[..., None])[..., 0]
