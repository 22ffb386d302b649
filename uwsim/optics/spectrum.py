"""The wavelength grid of the project and spectra on it."""

import numpy as np

WAVELENGTHS_NM = np.arange(400.0, 701.0, 5.0)
"""Working range, 400-700 nm on 5 nm. [nm]"""


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


def band_mean(spectrum: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Return the mean of a spectrum (61,) under each band's weights (61, bands): (bands,), trapezoidal."""
    weighted = np.trapezoid(spectrum[:, None] * weights, WAVELENGTHS_NM, axis=0)
    return weighted / np.trapezoid(weights, WAVELENGTHS_NM, axis=0)
