"""Continuous turbidity of a tank: mass of suspended minerals -> coefficients, and roughly what a turbidimeter says."""

import numpy as np

from uwsim.optics import pure_water
from uwsim.optics.checks import require
from uwsim.optics.constituents import mineral_scattering_babin2003
from uwsim.optics.phase import PhaseMixture
from uwsim.optics.water import Water, from_constituents, petzold_mixture

SCATTERING_PER_NTU_PER_M = 1.0
"""Particle scattering at 550 nm of one nephelometric turbidity unit, see `approximate_ntu`. [1/m]"""


def turbid_water(
    *, minerals_g_per_m3: float, mass_specific_m2_per_g: float = 0.5, albedo_550: float = 0.95,
    scattering_exponent: float = 0.7, absorption_slope_per_nm: float = 0.011,
    particle_phase: PhaseMixture | None = None,
) -> Water:  # fmt: skip
    """Return fresh water with minerals by mass; the phase function of the particles is by default Petzold's average.

    b_p(555) = b* x concentration, a_p(550) from the particles' albedo b_p / (a_p + b_p), which defaults to that of the
    tank waters: `tank_clear`, `_low`, `_medium`, `_high` are 0.27, 1.8, 5.6 and 11.2 g/m3.
    Source: b* = 0.5 m2/g, Babin et al. 2003 (see `mineral_scattering_babin2003`: within a factor of 2).
    """
    require("turbid water: albedo_550", albedo_550, above=0, most=1)
    require("turbid water: absorption_slope_per_nm", absorption_slope_per_nm, least=0, most=0.05)
    b_550 = mineral_scattering_babin2003(
        np.asarray(550.0), concentration_g_per_m3=minerals_g_per_m3,
        mass_specific_m2_per_g=mass_specific_m2_per_g, exponent=scattering_exponent,
    )  # fmt: skip
    return from_constituents(
        name=f"minerals {minerals_g_per_m3:.4g} g/m3",
        particle_attenuation_550_per_m=float(b_550) / albedo_550,
        particle_albedo_550=albedo_550,
        scattering_exponent=scattering_exponent,
        absorption_slope_per_nm=absorption_slope_per_nm,
        particle_phase=petzold_mixture("average") if particle_phase is None else particle_phase,
    )


def approximate_ntu(scattering_550_per_m: float) -> float:
    """Return the turbidity that goes with a scattering coefficient at 550 nm (of everything but fresh water). [NTU]

    One NTU per 1/m of particle scattering, good to a factor of 2 either way. No turbidimeter was calibrated for this:
    an NTU is light scattered to 90 deg relative to formazin, so grain size and colour move it. The factor is the
    product of 1.5-2.2 mg/l of river sediment per unit (McKenzie River, US Geological Survey SIR 2007-5164, Table 3)
    and 0.5 m2/g (Babin et al. 2003), that is 0.7-1.1 /m per unit, rounded.
    """
    b = float(require("turbidity: scattering_550_per_m", scattering_550_per_m, least=0))
    water = float(pure_water.scattering_zhang2009(np.asarray(550.0), temperature_c=20, salinity_psu=0))
    return max(b - water, 0.0) / SCATTERING_PER_NTU_PER_M
