"""Water: absorption, scattering and phase function over wavelength, by name or from constituents."""

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

from uwsim.files import read_toml
from uwsim.optics import jerlov, phase, pure_water, tables
from uwsim.optics.checks import require
from uwsim.optics.phase import PhaseMixture
from uwsim.optics.spectrum import WAVELENGTHS_NM
from uwsim.validation import validated

_TYPES = Path(__file__).parent / "water_types"
_MOST_PARTICLES = 1e6


@dataclass(frozen=True)
class Water:
    """Inherent optical properties on the wavelength grid: `absorption`, `scattering` (61,) [1/m], `phase`."""

    name: str
    absorption: np.ndarray
    scattering: np.ndarray
    phase: PhaseMixture

    def __post_init__(self):
        for quantity in ("absorption", "scattering"):
            values = np.asarray(getattr(self, quantity))
            if values.shape != WAVELENGTHS_NM.shape:
                raise ValueError(f"water {self.name}: {quantity} has shape {values.shape}, allowed: (61,)")
            if not np.all(np.isfinite(values) & (values >= 0)):
                raise ValueError(f"water {self.name}: {quantity} has a minimum of {values.min():g}, allowed: >= 0")

    @property
    def attenuation(self) -> np.ndarray:
        """Beam attenuation c = a + b, (61,). [1/m]"""
        return self.absorption + self.scattering

    @property
    def single_scattering_albedo(self) -> np.ndarray:
        """b / c, (61,); 0 where there is no attenuation."""
        c = self.attenuation
        return self.scattering / np.where(c > 0, c, 1)

    @property
    def backscattering(self) -> np.ndarray:
        """b_b = 2 pi b int over 90-180 deg of p sin, (61,). [1/m]

        Source: dissertation eq. 2.7. Errata: none; the printed form is right.
        """
        return self.scattering * self.phase.backscatter_fraction

    @property
    def forward_scattering(self) -> np.ndarray:
        """b_f = b - b_b, (61,). [1/m]

        Source: dissertation eq. 2.6. Errata: none; the printed form is right.
        """
        return self.scattering - self.backscattering

    def volume_scattering(self, cos_angle: np.ndarray) -> np.ndarray:
        """Return beta = b p at cosines of the scattering angle, (n,) -> (n, 61). [1/(m sr)]

        Source: dissertation eq. 2.5. Errata: beta = d2(Phi) / (E dOmega dV), where E is the irradiance on the volume.
        """
        # cosines of unit vectors may round beyond 1
        cosine = require(f"water {self.name}: cos_angle", cos_angle, least=-1 - 1e-6, most=1 + 1e-6)
        return self.scattering * self.phase.density(np.clip(cosine, -1, 1))

    def transmittance(self, *, path_m: float) -> np.ndarray:
        """Return the share of radiance that a path leaves unscattered and unabsorbed, exp(-c path), (61,).

        Source: dissertation eq. 2.8. Errata: holds for unscattered radiance only, neither for irradiance (K_d, with
        a < K_d < c) nor for a point source (1 / distance^2 besides); scattered light comes on top.
        """
        if not (np.isfinite(path_m) and path_m >= 0):
            raise ValueError(f"water {self.name}: path_m is {path_m}, allowed: >= 0")
        return np.exp(-self.attenuation * path_m)


def from_constituents(
    *, name: str, particle_attenuation_550_per_m: float, particle_albedo_550: float, scattering_exponent: float,
    absorption_slope_per_nm: float, particle_phase: PhaseMixture,
) -> Water:  # fmt: skip
    """Return pure fresh water with particles.

    b_p = b_p(550) (550 / l)^m, a_p = a_p(550) exp(-S (l - 550)), with b_p(550) = albedo x attenuation.

    Source: pure water as stated in uwsim/optics/data; shape of the particle terms as in Babin et al. 2003,
    J. Geophys. Res. 108:3211 (S about 0.011 /nm) and dissertation eq. 2.4.
    """
    require(f"water {name}: particle_attenuation_550_per_m", particle_attenuation_550_per_m, least=0)
    require(f"water {name}: particle_albedo_550", particle_albedo_550, least=0, most=1)
    require(f"water {name}: absorption_slope_per_nm", absorption_slope_per_nm, least=0, most=0.05)
    wavelength = WAVELENGTHS_NM
    b_550 = particle_attenuation_550_per_m * particle_albedo_550
    a_550 = particle_attenuation_550_per_m - b_550
    b_particles = b_550 * (550.0 / wavelength) ** scattering_exponent
    a_particles = a_550 * np.exp(-absorption_slope_per_nm * (wavelength - 550.0))
    b_water = tables.spectrum("water_scattering", "scattering_per_m", wavelength)
    return Water(
        name=name,
        absorption=pure_water.absorption_merged(wavelength) + a_particles,
        scattering=b_water + b_particles,
        phase=phase.mix([(b_water, phase.molecular()), (b_particles, particle_phase)]),
    )


def petzold_mixture(water: str) -> PhaseMixture:
    """Return four Henyey-Greenstein terms for Petzold's `clear`, `coastal`, `harbor` or `average` particle.

    rms 5.6, 10.2, 5.2, 5.4 % of the measured table over 0.1-180 deg, at every wavelength the same.
    """
    fit = tables.row("petzold_fits", "water", water)
    weights = np.array([float(fit[f"w{k}"]) for k in (1, 2, 3, 4)])
    return phase.constant([float(fit[f"g{k}"]) for k in (1, 2, 3, 4)], list(weights / weights.sum()))


def jerlov_water(water_type: str, *, source: str | None = None, particle_phase: PhaseMixture | None = None) -> Water:
    """Return a Jerlov type with the coefficients of `jerlov.coefficients`.

    The types say nothing of the phase function: as much of b as sea water has (Zhang et al. 2009, 20 C, salinity 35)
    scatters like molecules, the rest like `particle_phase`, by default Petzold's average particle.
    """
    source = jerlov.default_source(water_type) if source is None else source
    a, b = jerlov.coefficients(water_type, WAVELENGTHS_NM, source=source)
    b_water = np.minimum(b, pure_water.scattering_zhang2009(WAVELENGTHS_NM, temperature_c=20, salinity_psu=35))
    particles = petzold_mixture("average") if particle_phase is None else particle_phase
    mixed = phase.mix([(b_water, phase.molecular()), (b - b_water, particles)])
    return Water(name=f"jerlov_{water_type} ({source})", absorption=a, scattering=b, phase=mixed)


def petzold_water(
    water: str, *, scattering_exponent: float = 1.0, absorption_slope_per_nm: float = 0.011
) -> Water:  # fmt: skip
    """Return Petzold's `clear`, `coastal` or `harbor` water: measured at 530 nm, carried over 400-700 nm by laws.

    b = b_w + b_p(530) (530 / l)^m and a = a_w + a_p(530) exp(-S (l - 530)), with b_w of sea water, b(530) and c(530) as
    published; m and S are choices. The phase function is that of the whole water at 530 nm, kept at all wavelengths.
    Source: Petzold 1972, report SIO 72-78 (which gives 530 nm; Mobley 1994 says 514 nm).
    """
    published = tables.row("petzold_waters", "water", water)
    b_530 = float(published["scattering_per_m"])
    a_530 = float(published["attenuation_per_m"]) - b_530
    at = np.append(WAVELENGTHS_NM, 530.0)
    a_water, b_water = (
        pure_water.absorption_merged(at),
        pure_water.scattering_zhang2009(at, temperature_c=20, salinity_psu=35),
    )
    a = a_water + (a_530 - a_water[-1]) * np.exp(-absorption_slope_per_nm * (at - 530))
    b = b_water + (b_530 - b_water[-1]) * (530 / at) ** scattering_exponent
    return Water(name=f"petzold_{water}", absorption=a[:-1], scattering=b[:-1], phase=petzold_mixture(water))


class _Particles(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    attenuation_550_per_m: Annotated[float, Field(ge=0)]
    albedo_550: Annotated[float, Field(ge=0, le=1)]
    scattering_exponent: Annotated[float, Field(ge=0, le=4)]
    absorption_slope_per_nm: Annotated[float, Field(ge=0, le=0.05)]


class _Phase(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    type: Literal["hg_mixture"]
    g: tuple[float, ...]
    weights: tuple[float, ...]

    @model_validator(mode="after")
    def _same_length(self):
        if len(self.g) != len(self.weights):
            raise ValueError(f"g has {len(self.g)} terms, weights {len(self.weights)}; allowed: equally many")
        return self


class _Jerlov(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    type: Literal[jerlov.TYPES]


class _Petzold(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    water: Literal["clear", "coastal", "harbor"]
    scattering_exponent: Annotated[float, Field(ge=0, le=4)]
    absorption_slope_per_nm: Annotated[float, Field(ge=0, le=0.05)]


class WaterType(BaseModel):
    """A file of `uwsim/optics/water_types`: `particles` in fresh water with a `phase`, or a measured water."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    description: str
    source: str
    particles: _Particles | None = None
    phase: _Phase | None = None
    jerlov: _Jerlov | None = None
    petzold: _Petzold | None = None

    @model_validator(mode="after")
    def _one_kind(self):
        if sum(kind is not None for kind in (self.particles, self.jerlov, self.petzold)) != 1:
            raise ValueError("allowed: one of the tables particles, jerlov, petzold")
        if (self.particles is None) != (self.phase is None):
            raise ValueError("phase: belongs to particles, and to them only; measured waters bring their own")
        return self


def water_type_names() -> list[str]:
    """Return the names of the water types, sorted."""
    return sorted(path.stem for path in _TYPES.glob("*.toml"))


@cache
def water_type(name: str) -> WaterType:
    """Return the content of a water type's file; ValueError for an unknown name."""
    if name not in water_type_names():
        raise ValueError(f"name: got {name!r}, allowed: {', '.join(water_type_names())}")
    path = _TYPES / f"{name}.toml"
    return validated(WaterType, read_toml(path), where=path.name)


def named_water(
    name: str, *, particle_factor: float = 1.0, source: str | None = None, particle_phase: PhaseMixture | None = None
) -> Water:
    """Return a water type by name, with its particles (not the water itself) `particle_factor` times as many.

    `source` chooses between rival tables of a Jerlov type (`jerlov.SOURCES`). Measured waters (Jerlov, Petzold) have
    no particles of their own to multiply. `particle_phase` replaces the phase function of the particles; Petzold's
    waters have one for the whole water.
    Raises ValueError for an unknown name, a factor below 0 or above 1e6, or a factor, source or phase function of
    particles that the water does not have.
    """
    if not 0 <= particle_factor <= _MOST_PARTICLES:
        raise ValueError(
            f"water {name}: particle_factor is {particle_factor}, allowed: >= 0 and <= {_MOST_PARTICLES:g}"
        )
    kind = water_type(name)
    if source is not None and kind.jerlov is None:
        raise ValueError(f"water {name}: source is {source!r}, allowed: none (Jerlov types have rival sources)")
    if kind.particles is None and particle_factor != 1:
        raise ValueError(f"water {name}: particle_factor is {particle_factor}, allowed: 1 (it is a measured water)")
    if kind.jerlov is not None:
        return jerlov_water(kind.jerlov.type, source=source, particle_phase=particle_phase)
    if kind.petzold is not None:
        if particle_phase is not None:
            raise ValueError(f"water {name}: particle_phase, allowed: none (it was measured for the whole water)")
        petzold = kind.petzold
        return petzold_water(
            petzold.water, scattering_exponent=petzold.scattering_exponent,
            absorption_slope_per_nm=petzold.absorption_slope_per_nm,
        )  # fmt: skip
    particles = kind.particles
    own_phase = phase.constant(list(kind.phase.g), list(kind.phase.weights))
    return from_constituents(
        name=name if particle_factor == 1 else f"{name} x {particle_factor:.4g}",
        particle_attenuation_550_per_m=particles.attenuation_550_per_m * particle_factor,
        particle_albedo_550=particles.albedo_550,
        scattering_exponent=particles.scattering_exponent,
        absorption_slope_per_nm=particles.absorption_slope_per_nm,
        particle_phase=own_phase if particle_phase is None else particle_phase,
    )
