"""The wavelength grid of the project and tables on it."""

import csv
import functools
from pathlib import Path

import numpy as np

WAVELENGTHS_NM = np.arange(400.0, 701.0, 5.0)
"""Working range, 400-700 nm on 5 nm. [nm]"""

_DATA = Path(__file__).parent / "data"


def on_grid(wavelengths_nm: np.ndarray, values: np.ndarray, *, where: str) -> np.ndarray:
    """Interpolate a table linearly onto WAVELENGTHS_NM, (N,) -> (61,).

    Raises ValueError if the table is unsorted, not finite, or does not cover 400-700 nm (no extrapolation).
    """
    wavelengths_nm, values = np.asarray(wavelengths_nm, float), np.asarray(values, float)
    if wavelengths_nm.shape != values.shape or wavelengths_nm.ndim != 1 or len(values) < 2:
        raise ValueError(
            f"{where}: got {wavelengths_nm.size} wavelengths and {values.size} values, "
            "allowed: equally many, at least 2"
        )
    if not (np.all(np.isfinite(values)) and np.all(np.isfinite(wavelengths_nm))):
        raise ValueError(f"{where}: the spectrum is not finite everywhere")
    if not np.all(np.diff(wavelengths_nm) > 0):
        raise ValueError(f"{where}: wavelengths_nm must increase strictly")
    if wavelengths_nm[0] > WAVELENGTHS_NM[0] or wavelengths_nm[-1] < WAVELENGTHS_NM[-1]:
        raise ValueError(
            f"{where}: spectrum covers {wavelengths_nm[0]:g}-{wavelengths_nm[-1]:g} nm, needed: "
            f"{WAVELENGTHS_NM[0]:g}-{WAVELENGTHS_NM[-1]:g} nm (there is no extrapolation)"
        )
    return np.interp(WAVELENGTHS_NM, wavelengths_nm, values)


@functools.cache
def table(name: str, column: str) -> np.ndarray:
    """Return one column of a table in `uwsim/optics/data`, on the grid, (61,), read-only."""
    path = _DATA / f"{name}.csv"
    lines = [line for line in path.read_text(encoding="utf-8").splitlines() if not line.startswith("#")]
    rows = list(csv.DictReader(lines))
    values = on_grid([float(r["wavelength_nm"]) for r in rows], [float(r[column]) for r in rows], where=path.name)
    values.setflags(write=False)
    return values


def band_mean(spectrum: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Return the mean of a spectrum (61,) under each band's weights (61, bands): (bands,), trapezoidal."""
    weighted = np.trapezoid(spectrum[:, None] * weights, WAVELENGTHS_NM, axis=0)
    return weighted / np.trapezoid(weights, WAVELENGTHS_NM, axis=0)
