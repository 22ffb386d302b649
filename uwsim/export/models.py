"""Box and diameter of what is seen of a body, over many frames, without keeping its points."""

import numpy as np

_DIRECTIONS = 300
_PIECE = 400


def _sphere(number: int) -> np.ndarray:
    """Return unit vectors (number, 3) spread evenly over half a sphere: a golden spiral."""
    index = np.arange(number) + 0.5
    z, angle = 1 - index / number, np.pi * (1 + np.sqrt(5)) * index
    across = np.sqrt(1 - z**2)
    return np.column_stack([across * np.cos(angle), across * np.sin(angle), z])


class Extents:
    """The outermost of points (n, 3) [m] added piece by piece, along the axes and 300 directions between them.

    The diameter is the distance of the farthest two of the outermost points: that of all points where these are
    corners, else short of it by up to 0.5 %, 1 - cos of the angle to the nearest of the directions.
    """

    def __init__(self):
        self._directions = np.vstack([np.eye(3), _sphere(_DIRECTIONS)])
        self._most = np.full((2, len(self._directions)), -np.inf)
        self._outermost = np.full((2, len(self._directions), 3), np.nan)

    @property
    def is_empty(self) -> bool:
        return not np.isfinite(self._most[0, 0])

    def add(self, points_m: np.ndarray) -> None:
        # small pieces stay in the cache, and are below what BLAS starts threads for
        for start in range(0, len(points_m), _PIECE):
            piece = points_m[start : start + _PIECE]
            along = self._directions @ piece.T
            for side, (sign, farthest) in enumerate([(1, along.argmax(axis=1)), (-1, along.argmin(axis=1))]):
                found = sign * along[np.arange(len(along)), farthest]
                better = found > self._most[side]
                self._most[side, better] = found[better]
                self._outermost[side, better] = piece[farthest[better]]

    def entry_mm(self) -> dict:
        """Return the entry of models_info.json. [mm]"""
        points = 1e3 * np.unique(self._outermost.reshape(-1, 3), axis=0)
        low, size = points.min(axis=0), np.ptp(points, axis=0)
        apart = np.linalg.norm(points[:, None] - points[None], axis=-1)
        return (
            {"diameter": float(apart.max())}
            | {f"min_{axis}": float(value) for axis, value in zip("xyz", low, strict=True)}
            | {f"size_{axis}": float(value) for axis, value in zip("xyz", size, strict=True)}
        )
