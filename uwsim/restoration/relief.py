"""Shape from a range map: which way surfaces face, and which of them bodies in the picture keep a lamp's light from."""

import numpy as np

from uwsim.camera.lens import Lens

# a side more than this many times as long as the other leads to another body
_JUMP = 2.0
_STEPS = 64
_END = 0.95  # of the way to the lamp: bodies do not touch it
# samples lie closer where the way begins, where contact shadows are
_POWER = 1.5
_BEHIND_M = (0.004, 0.03)
_WORKING_WIDTH_PX = 320


def normals(points_m: np.ndarray, directions: np.ndarray, seen: np.ndarray) -> np.ndarray:
    """Return unit normals (H, W, 3) float32 towards the camera of the surface seen; 0 where none is seen.

    `points_m` (H, W, 3): where each pixel's ray, of `directions`, ends; `seen` (H, W) bool. From the sides of a pixel
    to its neighbours; beside an edge of a body from the shorter one alone.
    """
    points = np.where(seen[..., None], points_m, np.nan)
    across, down = _side(points, 1), _side(points, 0)
    found = np.cross(across, down)
    length = np.linalg.norm(found, axis=-1, keepdims=True)
    known = seen[..., None] & (length > 0)
    towards = np.where(np.sum(found * directions, axis=-1, keepdims=True) > 0, -found, found)
    found = np.where(known, towards / np.where(known, length, 1), -directions)
    return np.where(seen[..., None], found, 0).astype(np.float32)


def _side(points: np.ndarray, axis: int) -> np.ndarray:
    """Return the way (H, W, 3) from one pixel to the next along an axis, averaged over both sides where they agree."""
    steps = np.diff(points, axis=axis)
    first, last = np.full_like(points, np.nan), np.full_like(points, np.nan)
    ahead, behind = ([slice(None)] * 3 for _ in range(2))
    ahead[axis], behind[axis] = slice(0, -1), slice(1, None)
    first[tuple(ahead)], last[tuple(behind)] = steps, steps
    lengths = [np.nan_to_num(np.linalg.norm(side, axis=-1, keepdims=True), nan=np.inf) for side in (first, last)]
    shorter = np.where(lengths[0] <= lengths[1], first, last)
    agree = np.maximum(*lengths) < _JUMP * np.minimum(*lengths)
    return np.nan_to_num(np.where(agree, (first + last) / 2, shorter))


def visibility(points_m: np.ndarray, seen: np.ndarray, *, lens: Lens, lamps_m: np.ndarray) -> np.ndarray:
    """Return the share (H, W, N) float32 of each lamp's light that the bodies of the picture let pass to what is seen.

    `points_m` (H, W, 3) [m] in the camera's frame; `lamps_m` (N, 3). On the way from a point to a lamp, what lies up to
    3 cm behind the surface that the camera sees there is taken to be inside a body.
    Valid: for what the picture shows; a body outside it, or hidden by another, casts no shadow, and bodies are taken to
    be 3 cm thick. Found on a copy of at most 320 pixels across.
    """
    import cv2

    height, width = seen.shape
    stride = max(1, -(-width // _WORKING_WIDTH_PX))
    start, begun = points_m[::stride, ::stride], seen[::stride, ::stride]
    nearest = np.where(seen, np.linalg.norm(points_m, axis=-1), np.inf).astype(np.float32)
    found = []
    for lamp in np.asarray(lamps_m, float):
        hidden = np.zeros(begun.shape, bool)
        for share in _END * (np.arange(1, _STEPS + 1) / _STEPS) ** _POWER:
            hidden |= _inside(start + share * (lamp - start), nearest, lens)
        passed = np.where(begun & hidden, 0, 1).astype(np.float32)
        found.append(cv2.resize(passed, (width, height), interpolation=cv2.INTER_LINEAR))
    return np.stack(found, axis=-1)


def _inside(points_m: np.ndarray, nearest_m: np.ndarray, lens: Lens) -> np.ndarray:
    """Return which points (h, w, 3) lie just behind a surface at distances `nearest_m` (H, W) from the camera."""
    height, width = nearest_m.shape
    pixels = lens.project(points_m.reshape(-1, 3))[0].reshape(*points_m.shape[:2], 2)
    column, row = np.moveaxis(np.floor(np.nan_to_num(pixels, nan=-1)), -1, 0)
    inside = (column >= 0) & (column < width) & (row >= 0) & (row < height) & (points_m[..., 2] > 0)
    surface = nearest_m[np.where(inside, row, 0).astype(int), np.where(inside, column, 0).astype(int)]
    # without a body there the surface is at infinity
    behind = np.linalg.norm(points_m, axis=-1) - surface
    return inside & (behind > _BEHIND_M[0]) & (behind < _BEHIND_M[1])
