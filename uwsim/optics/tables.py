"""Reading and interpolating the tables in `uwsim/optics/data`; nothing is extrapolated."""

import csv
import functools
from pathlib import Path

import numpy as np

_DATA = Path(__file__).parent / "data"


@functools.cache
def rows(name: str) -> tuple[dict[str, str], ...]:
    """Return the lines of a table as dictionaries; lines that start with # are comments."""
    lines = [line for line in (_DATA / f"{name}.csv").read_text(encoding="utf-8").splitlines() if line[0] != "#"]
    return tuple(csv.DictReader(lines))


def row(name: str, key: str, value: str) -> dict[str, str]:
    """Return the line whose `key` is `value`; ValueError names what there is."""
    for line in rows(name):
        if line[key] == value:
            return line
    raise ValueError(f"{key}: got {value!r}, allowed: {', '.join(line[key] for line in rows(name))}")


def column(name: str, key: str) -> np.ndarray:
    """Return one column as numbers, (N,); empty cells are NaN."""
    return np.array([float(line[key] or "nan") for line in rows(name)])


def interpolate(
    wavelengths_nm: np.ndarray, table_nm: np.ndarray, values: np.ndarray, *, where: str
) -> np.ndarray:  # fmt: skip
    """Return table values at wavelengths (...,), linear between those printed.

    Raises ValueError for a wavelength outside the table (there is no extrapolation) or beside a missing value.
    """
    wavelengths = np.asarray(wavelengths_nm, float)
    known = np.isfinite(values)
    outside = ~((wavelengths >= table_nm[0]) & (wavelengths <= table_nm[-1]))
    if np.any(outside):
        raise ValueError(
            f"{where}: got {wavelengths[outside].flat[0]:g} nm, allowed: {table_nm[0]:g}-{table_nm[-1]:g} nm "
            "(there is no extrapolation)"
        )
    result = np.interp(wavelengths, table_nm[known], values[known])
    if not np.all(known):
        # a gap counts up to the printed values on both sides
        gap = np.isnan(np.interp(wavelengths, table_nm, values))
        if np.any(gap):
            missing = ", ".join(f"{w:g}" for w in table_nm[~known])
            raise ValueError(f"{where}: got {wavelengths[gap].flat[0]:g} nm, but no value is printed at {missing} nm")
    return result


def spectrum(name: str, key: str, wavelengths_nm: np.ndarray) -> np.ndarray:
    """Return one column of a table over wavelength at the given wavelengths."""
    where = f"{name}.csv, {key}"
    return interpolate(wavelengths_nm, column(name, "wavelength_nm"), column(name, key), where=where)
