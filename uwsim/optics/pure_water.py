"""Absorption and scattering of water itself, by rival authors. Wavelengths (...,) [nm] -> (...,) [1/m]."""

import numpy as np

from uwsim.optics import tables
from uwsim.optics.checks import require
from uwsim.optics.phase_functions.rayleigh import WATER_DEPOLARISATION
from uwsim.optics.refractive_index import water_quan1995


def absorption_pope1997(wavelengths_nm: np.ndarray) -> np.ndarray:
    """Return the absorption of pure water at 22 C. [1/m]

    Source: Pope & Fry 1997, Appl. Opt. 36:8710.
    Errata: the dissertation (at eq. 2.2) gives about 0.04 /m at 462-475 nm for pure water; measured are 0.0098-0.0114.
    Valid: 380-727.5 nm; below 500 nm Mason et al. 2016 find less (a third of it at 400 nm).
    """
    return tables.spectrum("water_absorption_pope1997", "absorption_per_m", wavelengths_nm)


def absorption_mason2016(wavelengths_nm: np.ndarray) -> np.ndarray:
    """Return the absorption of pure water at 23 C. [1/m]

    Source: Mason, Cone & Fry 2016, Appl. Opt. 55:7163, Table 2. Valid: 250-550 nm.
    """
    return tables.spectrum("water_absorption_mason2016", "absorption_per_m", wavelengths_nm)


def absorption_smith1981(wavelengths_nm: np.ndarray) -> np.ndarray:
    """Return the absorption of the clearest natural waters, an upper bound for pure water. [1/m]

    Source: Smith & Baker 1981, Appl. Opt. 20:177, Table 1. Valid: 200-800 nm.
    """
    return tables.spectrum("water_smith1981", "absorption_per_m", wavelengths_nm)


def absorption_roettgers2016(
    wavelengths_nm: np.ndarray, *, temperature_c: float, salinity_psu: float
) -> np.ndarray:  # fmt: skip
    """Return the absorption of water, a(20 C, 0) + (T - 20) da/dT + S da/dS. [1/m]

    Source: Roettgers 2016, WOPP version 3 (300-510 nm: Mason et al. 2016).
    Valid: 300-900 nm, 0-30 C, salinity 0-40; the corrections matter above 580 nm (1 % at 700 nm for S = 35).
    """
    temperature = require("water absorption: temperature_c", temperature_c, least=0, most=30)
    salinity = require("water absorption: salinity_psu", salinity_psu, least=0, most=40)
    name = "water_absorption_roettgers2016"
    a, by_salinity, by_temperature = (
        tables.spectrum(name, key, wavelengths_nm)
        for key in ("absorption_per_m", "per_salinity_per_m_psu", "per_temperature_per_m_k")
    )
    return a + (temperature - 20) * by_temperature + salinity * by_salinity


def absorption_merged(wavelengths_nm: np.ndarray) -> np.ndarray:
    """Return the absorption of pure water: Mason 2016 up to 500 nm, Pope & Fry 1997 to 725 nm, then WOPP. [1/m]

    Valid: 350-800 nm, 20-23 C, linear on 5 nm. What the named waters use.
    """
    return tables.spectrum("water_absorption", "absorption_per_m", wavelengths_nm)


def scattering_smith1981(wavelengths_nm: np.ndarray) -> np.ndarray:
    """Return the scattering of sea water after Morel's measurements. [1/m]

    Source: Smith & Baker 1981, Appl. Opt. 20:177, Table 1. Valid: 200-800 nm; 14 % above Zhang et al. at 500 nm.
    """
    return tables.spectrum("water_smith1981", "scattering_per_m", wavelengths_nm)


def scattering_morel1974(wavelengths_nm: np.ndarray) -> np.ndarray:
    """Return the scattering of sea water, 0.00288 (500 / l)^4.32. [1/m]

    Source: fit to Morel 1974 (Optical Aspects of Oceanography). Valid: 350-800 nm, salinity 35-39.
    """
    wave = require("sea water scattering (Morel 1974): wavelength_nm", wavelengths_nm, least=350, most=800)
    return 0.00288 * (500 / wave) ** 4.32


def scattering_zhang2009(
    wavelengths_nm: np.ndarray, *, temperature_c: float, salinity_psu: float
) -> np.ndarray:  # fmt: skip
    """Return the scattering of water or sea water from fluctuations of density and of salt concentration. [1/m]

    b = 8 pi / 3 (2 + delta) / (1 + delta) (beta_density + beta_salt at 90 deg), delta = 0.039.
    Source: Zhang, Hu & He 2009, Opt. Express 17:5698, eqs 1-19; density and compressibility of UNESCO 38 (1981).
    Valid: 400-700 nm, 0-30 C, salinity 0-35; within 2 % of Morel's measurements with this delta.
    """
    index, by_salinity = _absolute_index(wavelengths_nm, temperature_c, salinity_psu)
    temperature, salinity = float(temperature_c), float(salinity_psu)
    boltzmann_j_per_k, avogadro_per_mol, molar_mass_kg = 1.3806503e-23, 6.0221417930e23, 18e-3
    # (n^2 - 1)(1 + 2/3 (n^2 + 2)(n/3 - 1/(3 n))^2): rho d(n^2)/d(rho) after Proutiere, Megnassan & Hucteau 1992
    square = index**2
    by_density = (square - 1) * (1 + 2 / 3 * (square + 2) * (index / 3 - 1 / (3 * index)) ** 2)
    kelvin = temperature + 273.15
    density = np.pi**2 / 2 * by_density**2 * boltzmann_j_per_k * kelvin * _compressibility_per_pa(temperature, salinity)
    molecules = salinity * molar_mass_kg / (_density_kg_per_m3(temperature, salinity) * avogadro_per_mol)
    salt = 2 * np.pi**2 * square * by_salinity**2 * molecules / -_log_activity_slope(temperature, salinity)
    delta = WATER_DEPOLARISATION
    wave_m = np.asarray(wavelengths_nm, float) * 1e-9
    at_90 = (density + salt) / wave_m**4 * (6 + 6 * delta) / (6 - 7 * delta)
    return 8 * np.pi / 3 * at_90 * (2 + delta) / (1 + delta)


def _absolute_index(wavelengths_nm, temperature_c, salinity_psu):
    """Refractive index against vacuum, and its derivative by salinity [1/psu]."""
    wave = np.asarray(wavelengths_nm, float)
    relative = water_quan1995(wave, temperature_c=temperature_c, salinity_psu=salinity_psu)
    per_um2 = (1000 / wave) ** 2
    # Ciddor 1996, Appl. Opt. 35:1566, standard air
    air = 1 + (5792105 / (238.0185 - per_um2) + 167917 / (57.362 - per_um2)) * 1e-8
    slope = 1.779e-4 - 1.05e-6 * temperature_c + 1.6e-8 * temperature_c**2 + 0.01155 / wave
    return relative * air, slope * air


def _compressibility_per_pa(t: float, s: float) -> float:
    """Isothermal compressibility at 1 atm. Source: UNESCO 38, Millero et al. 1980."""
    pure_bar = 19652.21 + 148.4206 * t - 2.327105 * t**2 + 1.360477e-2 * t**3 - 5.155288e-5 * t**4
    linear = 54.6746 - 0.603459 * t + 1.09987e-2 * t**2 - 6.167e-5 * t**3
    root = 7.944e-2 + 1.6483e-2 * t - 5.3009e-4 * t**2
    return 1e-5 / (pure_bar + linear * s + root * s**1.5)


def _density_kg_per_m3(t: float, s: float) -> float:
    """Density at 1 atm. Source: UNESCO 38, eq. EOS-80."""
    pure = np.polyval([6.536332e-9, -1.120083e-6, 1.001685e-4, -9.09529e-3, 6.793952e-2, 999.842594], t)
    linear = np.polyval([5.3875e-9, -8.2467e-7, 7.6438e-5, -4.0899e-3, 8.24493e-1], t)
    return pure + linear * s + np.polyval([-1.6546e-6, 1.0227e-4, -5.72466e-3], t) * s**1.5 + 4.8314e-4 * s**2


def _log_activity_slope(t: float, s: float) -> float:
    """d ln(activity of water) / d(salinity) [1/psu]. Source: Millero & Leung 1976, as in Zhang et al. 2009."""
    constant = -5.58651e-4 + 2.40452e-7 * t - 3.12165e-9 * t**2 + 2.40808e-11 * t**3
    root = 1.5 * (1.79613e-5 - 9.9422e-8 * t + 2.08919e-9 * t**2 - 1.39872e-11 * t**3)
    return constant + root * s**0.5 + 2 * (-2.31065e-6 - 1.37674e-9 * t - 1.93316e-11 * t**2) * s
