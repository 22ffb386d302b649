"""Refractive indices of water, glass and acrylic against wavelength; never extrapolated."""

import numpy as np

from uwsim.optics.checks import require


def water_quan1995(wavelength_nm: np.ndarray, *, temperature_c: float, salinity_psu: float) -> np.ndarray:
    """Return the refractive index of water relative to air, wavelengths (...) -> (...).

    Raises ValueError outside `Valid`.
    Source: Quan & Fry 1995, Appl. Opt. 34:3477, eq. 3.
    Valid: 400-700 nm, 0-30 deg C, salinity 0-35.
    """
    wave = require("refractive index of water: wavelength_nm", wavelength_nm, least=400, most=700)
    temp = float(require("refractive index of water: temperature_c", temperature_c, least=0, most=30))
    salt = float(require("refractive index of water: salinity_psu", salinity_psu, least=0, most=35))
    constant = 1.31405 + (1.779e-4 - 1.05e-6 * temp + 1.6e-8 * temp**2) * salt - 2.02e-6 * temp**2
    slope_nm = 15.868 + 0.01155 * salt - 0.00423 * temp
    return constant + slope_nm / wave - 4382 / wave**2 + 1.1455e6 / wave**3


def glass_nbk7(wavelength_nm: np.ndarray) -> np.ndarray:
    """Return the refractive index of N-BK7 relative to air, wavelengths (...) -> (...).

    Source: Schott data sheet N-BK7, Sellmeier dispersion formula.
    Valid: 310-2325 nm, 20 deg C.
    """
    square = (require("refractive index of N-BK7: wavelength_nm", wavelength_nm, least=310, most=2325) / 1000) ** 2
    strengths, poles = (1.03961212, 0.231792344, 1.01046945), (0.00600069867, 0.0200179144, 103.560653)
    return np.sqrt(1 + sum(b * square / (square - c) for b, c in zip(strengths, poles, strict=True)))


def acrylic_sultanova2009(wavelength_nm: np.ndarray) -> np.ndarray:
    """Return the refractive index of acrylic (PMMA), wavelengths (...) -> (...).

    Source: Sultanova, Kasarova & Nikolov 2009, Acta Phys. Pol. A 116:585, one-term Sellmeier fit.
    Valid: 437-1052 nm, 20 deg C; 0.002 below `acrylic_beadie2015` (different material batches).
    """
    where = "refractive index of acrylic (Sultanova 2009): wavelength_nm"
    square = (require(where, wavelength_nm, least=437, most=1052) / 1000) ** 2
    return np.sqrt(1 + 1.1819 * square / (square - 0.011313))


def acrylic_beadie2015(wavelength_nm: np.ndarray) -> np.ndarray:
    """Return the refractive index of acrylic (PMMA), wavelengths (...) -> (...).

    Source: Beadie et al. 2015, Appl. Opt. 54:F139, polynomial in the square of the wavelength.
    Valid: 420-1620 nm, 20 deg C.
    """
    where = "refractive index of acrylic (Beadie 2015): wavelength_nm"
    square = (require(where, wavelength_nm, least=420, most=1620) / 1000) ** 2
    positive = 2.1778 + 6.1209e-3 * square - 1.5004e-3 * square**2
    return np.sqrt(
        positive + 2.3678e-2 / square - 4.2137e-3 / square**2 + 7.3417e-4 / square**3 - 4.5042e-5 / square**4
    )
