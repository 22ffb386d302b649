"""Marker layouts by name or from a file of points."""

import csv
from pathlib import Path

import numpy as np

from uwsim.files import read_toml
from uwsim.pose import limits, problems

NAMES = {"octahedron": "bi6", "pyramid": "py5", "stereo": "st4", "square": "pl4"}
"""The dissertation's layouts: square bipyramid, pyramid on its square, two base corners and both apices, square."""
EDGE_M = 0.1
_LEAST, _MOST = 4, 200
_SAME_SHARE = 1e-6


def read_layout(name: str, *, edge_m: float | None = None) -> np.ndarray:
    """Return the points (n, 3) [m] of a layout of NAMES with edges of `edge_m` (0.1), or of a file.

    A TOML file holds `points_m = [[x, y, z], ...]`; a CSV file three numbers a line, a first line of names allowed.
    ValueError for what is none of these, points that no pose follows from, or `edge_m` beside a file.
    """
    if edge_m is not None:
        limits.SIZE_M.check(edge_m, name="edge_m")
    if name in NAMES:
        return problems.layout(NAMES[name], edge_m=EDGE_M if edge_m is None else edge_m)
    path = Path(name)
    if path.suffix.lower() not in (".toml", ".csv"):
        raise ValueError(f"layout: got {name!r}, allowed: {', '.join(NAMES)}, or a .toml or .csv file of points")
    if edge_m is not None:
        raise ValueError(f"edge_m: got {edge_m} m with the file {name}, allowed: with the layouts {', '.join(NAMES)}")
    return checked_layout(_from_toml(path) if path.suffix.lower() == ".toml" else _from_csv(path), where=name)


def checked_layout(points_m: object, *, where: str) -> np.ndarray:
    """Return points (n, 3) [m] as floats; ValueError unless 4 to 200 different ones, not on one line.

    Coordinates within 1000 m of the origin, and points at least a micrometre apart from each other somewhere.
    """
    try:
        points_m = np.array(points_m, dtype=float)
    except (TypeError, ValueError, OverflowError):
        raise ValueError(f"{where}: points_m holds no numbers, allowed: rows of three numbers [m]") from None
    if points_m.ndim != 2 or points_m.shape[1] != 3 or not _LEAST <= len(points_m) <= _MOST:
        raise ValueError(f"{where}: got points of shape {points_m.shape}, allowed: ({_LEAST} to {_MOST}, 3)")
    if not np.all(np.isfinite(points_m)):
        raise ValueError(f"{where}: got NaN or infinite coordinates, allowed: finite ones")
    most = limits.SIZE_M.most
    if np.abs(points_m).max() > most:
        raise ValueError(f"{where}: got a coordinate of {np.abs(points_m).max():g} m, allowed: -{most:g} to {most:g} m")
    between_m, least = np.linalg.norm(points_m[:, None] - points_m, axis=2), limits.SIZE_M.least
    if not between_m.max() >= least:
        raise ValueError(f"{where}: got points at most {between_m.max():g} m apart, allowed: {least:g} m and above")
    spread = np.linalg.svd(points_m - points_m.mean(axis=0), compute_uv=False)
    if not spread[1] > _SAME_SHARE * spread[0]:
        raise ValueError(f"{where}: all points lie on one line, allowed: points on a plane or in space")
    apart_m = between_m + np.diag(np.full(len(points_m), np.inf))
    if not apart_m.min() > _SAME_SHARE * spread[0]:
        raise ValueError(f"{where}: two points are the same, allowed: different points")
    return points_m


def _from_toml(path: Path) -> object:
    content = read_toml(path)
    if set(content) != {"points_m"}:
        raise ValueError(f"{path}: got keys {', '.join(content) or 'none'}, allowed: points_m = [[x, y, z], ...]")
    rows = content["points_m"]
    entries = [one for row in rows for one in row] if _is_table(rows) else []
    if any(isinstance(one, bool) or not isinstance(one, int | float) for one in entries):
        raise ValueError(f"{path}: points_m holds no numbers, allowed: rows of three numbers [m]")
    return rows


def _is_table(rows: object) -> bool:
    return isinstance(rows, list) and all(isinstance(row, list) for row in rows)


def _from_csv(path: Path) -> list[list[str]]:
    try:
        with path.open(newline="", encoding="utf-8") as file:
            rows = [row for row in csv.reader(file) if row]
    except FileNotFoundError:
        raise ValueError(f"{path}: no such file") from None
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise ValueError(f"{path}: not readable as CSV: {error}") from None
    if rows and [name.strip() for name in rows[0]] == ["x_m", "y_m", "z_m"]:
        rows = rows[1:]
    for number, row in enumerate(rows, start=1):
        if len(row) != 3:
            raise ValueError(f"{path}: point {number} has {len(row)} numbers, allowed: three, x_m, y_m, z_m")
    return rows
