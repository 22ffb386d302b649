"""What is in the water beside water: absorption and scattering of each constituent, and their sum (eqs 2.1-2.4).

Wavelengths (...,) [nm] -> (...,) [1/m]. Rival models carry author and year.
"""

from typing import Literal

import numpy as np

from uwsim.optics import phase, pure_water, tables
from uwsim.optics.checks import require
from uwsim.optics.phase import PhaseMixture
from uwsim.optics.spectrum import WAVELENGTHS_NM
from uwsim.optics.water import Water, petzold_mixture


def coefficient_from_loss(*, flux_in: float, flux_out: float, path_m: float) -> float:
    """Return a (or b, or c) [1/m] from the flux lost on a path: -ln(out / in) / path.

    Source: dissertation eqs 2.1, 2.3.
    Errata: the printed quotient (in - out) / (in path) is the limit of short paths only; its error is a path / 2.
    Eq. 2.1 holds without scattering, eq. 2.3 without absorption; with both, this is c = a + b.
    """
    require("flux_in", flux_in, above=0)
    require("flux_out", flux_out, above=0, most=flux_in)
    require("path_m", path_m, above=0)
    return float(np.log(flux_in / flux_out) / path_m)


def absorption_from_absorbance(absorbance: np.ndarray, *, path_m: float) -> np.ndarray:
    """Return the absorption [1/m] of a sample with decadic absorbance A = lg(I_0 / I) on a path: A ln 10 / path.

    Source: dissertation eqs 2.37, 2.38 (A = tau eta L for mass-specific tau and concentration eta).
    Errata: 2.37 prints lg(I / I_0), which is -A; 2.38 puts the decadic tau into e^(-tau eta L), so that the sample
    absorbs 2.303 times too little: I = I_0 10^(-tau eta L).
    """
    require("path_m", path_m, above=0)
    return require("absorbance", absorbance, least=0) * np.log(10) / path_m


def _chlorophyll(value: float) -> float:
    """Refuse what the statistics of Bricaud et al. do not cover."""
    if value == 0:
        return 0.0
    return float(require("chlorophyll_mg_per_m3 (0, or within the data)", value, least=0.02, most=25))


def phytoplankton_absorption_bricaud1995(wavelengths_nm: np.ndarray, *, chlorophyll_mg_per_m3: float) -> np.ndarray:
    """Return the absorption of phytoplankton, A Chl^(1 - B). [1/m]

    Source: Bricaud et al. 1995, J. Geophys. Res. 100:13321, Table 2.
    Valid: 400-700 nm, chlorophyll 0.02-25 mg/m3, case 1 waters; single spectra scatter by a factor of 2.
    """
    chlorophyll = _chlorophyll(chlorophyll_mg_per_m3)
    scale = tables.spectrum("phytoplankton_bricaud1995", "A_m2_per_mg", wavelengths_nm)
    exponent = 1 - tables.spectrum("phytoplankton_bricaud1995", "B", wavelengths_nm)
    return scale * chlorophyll**exponent


def particle_absorption_bricaud1998(wavelengths_nm: np.ndarray, *, chlorophyll_mg_per_m3: float) -> np.ndarray:
    """Return the absorption of phytoplankton and detritus together, A Chl^E. [1/m]

    Do not add non-algal particles to it: they are in it (25-30 %).
    Source: Bricaud et al. 1998, J. Geophys. Res. 103:31033, as the Ocean Optics Web Book tabulates it.
    Errata: E is the exponent itself; a library in use applies it as Chl^(1 - E).
    Valid: 300-1000 nm (measured 400-700), chlorophyll 0.02-25 mg/m3, case 1; scatter a factor of 3 at 440 nm.
    """
    chlorophyll = _chlorophyll(chlorophyll_mg_per_m3)
    scale = tables.spectrum("particles_bricaud1998", "A_m2_per_mg", wavelengths_nm)
    return scale * chlorophyll ** tables.spectrum("particles_bricaud1998", "E", wavelengths_nm)


def cdom_absorption(
    wavelengths_nm: np.ndarray, *, absorption_440_per_m: float, slope_per_nm: float = 0.014
) -> np.ndarray:  # fmt: skip
    """Return the absorption of coloured dissolved organic matter, a(440) exp(-S (l - 440)). [1/m]

    Source: Bricaud, Morel & Prieur 1981, Limnol. Oceanogr. 26:43. Valid: S of 0.010-0.020 /nm.
    """
    return _exponential("CDOM", wavelengths_nm, absorption_440_per_m, slope_per_nm)


def non_algal_absorption(
    wavelengths_nm: np.ndarray, *, absorption_440_per_m: float, slope_per_nm: float = 0.011
) -> np.ndarray:  # fmt: skip
    """Return the absorption of detritus and minerals, a(440) exp(-S (l - 440)). [1/m]

    Source: Bricaud et al. 1998, J. Geophys. Res. 103:31033, S = 0.011 +- 0.0025 /nm.
    """
    return _exponential("non-algal particles", wavelengths_nm, absorption_440_per_m, slope_per_nm)


def _exponential(what: str, wavelengths_nm: np.ndarray, absorption_440_per_m: float, slope: float) -> np.ndarray:
    a_440 = require(f"{what}: absorption_440_per_m", absorption_440_per_m, least=0)
    slope = require(f"{what}: slope_per_nm", slope, least=0, most=0.05)
    return a_440 * np.exp(-slope * (_visible(what, wavelengths_nm) - 440))


def _visible(what: str, wavelengths_nm: np.ndarray) -> np.ndarray:
    """Refuse wavelengths for which nobody has measured the law."""
    return require(f"{what}: wavelength_nm", wavelengths_nm, least=300, most=900)


def particle_scattering(
    wavelengths_nm: np.ndarray, *, scattering_per_m: float, at_nm: float = 550.0, exponent: float = 1.0
) -> np.ndarray:  # fmt: skip
    """Return the power law b(l0) (l / l0)^-m. [1/m]

    Source: dissertation eq. 2.4. Errata: there it is the diameter that approaches lambda^-m; m is that of b.
    Valid: m of 0 (large particles) to 2 (small); molecules are not particles, see `pure_water`.
    """
    b = require("particle scattering: scattering_per_m", scattering_per_m, least=0)
    require("particle scattering: exponent", exponent, least=0, most=4)
    return b * (_visible("particle scattering", wavelengths_nm) / at_nm) ** -exponent


def particle_scattering_gordon1983(wavelengths_nm: np.ndarray, *, chlorophyll_mg_per_m3: float) -> np.ndarray:
    """Return 0.30 Chl^0.62 (550 / l). [1/m]

    Source: Gordon & Morel 1983, Remote Assessment of Ocean Color. Valid: case 1 waters, within a factor of 1.5.
    """
    b = 0.30 * _chlorophyll(chlorophyll_mg_per_m3) ** 0.62
    return particle_scattering(wavelengths_nm, scattering_per_m=b, exponent=1.0)


def particle_scattering_loisel1998(wavelengths_nm: np.ndarray, *, chlorophyll_mg_per_m3: float) -> np.ndarray:
    """Return 0.416 Chl^0.766 (l / 550)^v, v = (lg Chl - 0.3) / 2 below 2 mg/m3 and 0 above. [1/m]

    Source: Loisel & Morel 1998, Limnol. Oceanogr. 43:847. Valid: case 1 waters.
    """
    chlorophyll = _chlorophyll(chlorophyll_mg_per_m3)
    wavelengths = _visible("particle scattering (Loisel 1998)", wavelengths_nm)
    exponent = 0.5 * (np.log10(chlorophyll) - 0.3) if 0 < chlorophyll < 2 else 0.0
    return 0.416 * chlorophyll**0.766 * (wavelengths / 550) ** exponent


def mineral_scattering_babin2003(
    wavelengths_nm: np.ndarray, *, concentration_g_per_m3: float, mass_specific_m2_per_g: float = 0.5,
    exponent: float = 0.7,
) -> np.ndarray:  # fmt: skip
    """Return the scattering of suspended particles from their dry mass, b* (555 nm) x concentration. [1/m]

    Source: Babin et al. 2003, Limnol. Oceanogr. 48:843: on average 0.5 m2/g in case 2 (mineral) and 1.0 m2/g in case 1
    (organic) waters, with little change over wavelength; the exponent 0.7 is a choice made here.
    Valid: within a factor of 2 either way: it goes with the grain size.
    """
    concentration = require("minerals: concentration_g_per_m3", concentration_g_per_m3, least=0)
    specific = require("minerals: mass_specific_m2_per_g", mass_specific_m2_per_g, above=0)
    return particle_scattering(
        wavelengths_nm, scattering_per_m=float(concentration * specific), at_nm=555.0, exponent=exponent
    )


def natural_water(
    *, name: str = "natural", temperature_c: float = 20.0, salinity_psu: float = 35.0,
    chlorophyll_mg_per_m3: float = 0.0, cdom_440_per_m: float = 0.0, non_algal_440_per_m: float = 0.0,
    minerals_g_per_m3: float = 0.0, particle_phase: PhaseMixture | None = None,
    particle_absorption: Literal["bricaud1995", "bricaud1998"] = "bricaud1995",
    particle_scattering: Literal["gordon1983", "loisel1998"] = "loisel1998",
) -> Water:  # fmt: skip
    """Return water with its constituents on WAVELENGTHS_NM: a = a_w + a_ph + a_NAP + a_CDOM, b = b_w + b_p.

    Minerals add scattering by mass; their absorption is `non_algal_440_per_m`. Without `particle_phase`, particles
    scatter like Petzold's average particle, water itself like `phase.molecular`.
    Source: dissertation eqs 2.2, 2.4. Errata: 2.2 names phytoplankton, CDOM and water, but prints a particle term.
    """
    absorption = {
        "bricaud1995": phytoplankton_absorption_bricaud1995, "bricaud1998": particle_absorption_bricaud1998
    }  # fmt: skip
    scattering = {"gordon1983": particle_scattering_gordon1983, "loisel1998": particle_scattering_loisel1998}
    for what, got, known in (
        ("particle_absorption", particle_absorption, absorption),
        ("particle_scattering", particle_scattering, scattering),
    ):
        if got not in known:
            raise ValueError(f"water {name}: {what} is {got!r}, allowed: {', '.join(known)}")
    if particle_absorption == "bricaud1998" and non_algal_440_per_m != 0:
        raise ValueError(f"water {name}: non_algal_440_per_m is {non_algal_440_per_m:g}, allowed with bricaud1998: 0")
    wave, state = WAVELENGTHS_NM, {"temperature_c": temperature_c, "salinity_psu": salinity_psu}
    b_water = pure_water.scattering_zhang2009(wave, **state)
    b_particles = scattering[particle_scattering](
        wave, chlorophyll_mg_per_m3=chlorophyll_mg_per_m3
    ) + mineral_scattering_babin2003(wave, concentration_g_per_m3=minerals_g_per_m3)
    a = pure_water.absorption_roettgers2016(wave, **state)
    a = a + absorption[particle_absorption](wave, chlorophyll_mg_per_m3=chlorophyll_mg_per_m3)
    a = a + cdom_absorption(wave, absorption_440_per_m=cdom_440_per_m)
    a = a + non_algal_absorption(wave, absorption_440_per_m=non_algal_440_per_m)
    particles = petzold_mixture("average") if particle_phase is None else particle_phase
    mixed = phase.mix([(b_water, phase.molecular()), (b_particles, particles)])
    return Water(name=name, absorption=a, scattering=b_water + b_particles, phase=mixed)
