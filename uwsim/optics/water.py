"""Water: absorption, scattering and phase function over wavelength, by name or from constituents."""

import tomllib
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

from uwsim.optics import phase
from uwsim.optics.phase import PhaseMixture
from uwsim.optics.spectrum import WAVELENGTHS_NM, table
from uwsim.validation import validated

_TYPES = Path(__file__).parent / "water_types"


@dataclass(frozen=True)
class Water:
    """Inherent optical properties on the wavelength grid: `absorption`, `scattering` (61,) [1/m], `phase`."""

    name: str
    absorption: np.ndarray
    scattering: np.ndarray
    phase: PhaseMixture

    def __post_init__(self):
        for quantity in ("absorption", "scattering"):
            values = getattr(self, quantity)
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


def from_constituents(
    *, name: str, particle_attenuation_550_per_m: float, particle_albedo_550: float, scattering_exponent: float,
    absorption_slope_per_nm: float, particle_phase: PhaseMixture,
) -> Water:  # fmt: skip
    """Return pure fresh water with particles.

    b_p = b_p(550) (550 / l)^m, a_p = a_p(550) exp(-S (l - 550)), with b_p(550) = albedo x attenuation.

    Source: pure water as stated in uwsim/optics/data; shape of the particle terms as in Babin et al. 2003,
    J. Geophys. Res. 108:3211 (S about 0.011 /nm) and dissertation eq. 2.4.
    """
    wavelength = WAVELENGTHS_NM
    b_550 = particle_attenuation_550_per_m * particle_albedo_550
    a_550 = particle_attenuation_550_per_m - b_550
    b_particles = b_550 * (550.0 / wavelength) ** scattering_exponent
    a_particles = a_550 * np.exp(-absorption_slope_per_nm * (wavelength - 550.0))
    b_water = table("water_scattering", "scattering_per_m")
    return Water(
        name=name,
        absorption=table("water_absorption", "absorption_per_m") + a_particles,
        scattering=b_water + b_particles,
        phase=phase.mix([(b_water, phase.molecular()), (b_particles, particle_phase)]),
    )


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


class WaterType(BaseModel):
    """A file of `uwsim/optics/water_types`."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    description: str
    source: str
    particles: _Particles
    phase: _Phase


def water_type_names() -> list[str]:
    """Return the names of the water types, sorted."""
    return sorted(path.stem for path in _TYPES.glob("*.toml"))


@cache
def _water_type(name: str) -> WaterType:
    if name not in water_type_names():
        raise ValueError(f"name: got {name!r}, allowed: {', '.join(water_type_names())}")
    path = _TYPES / f"{name}.toml"
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8"))
    except tomllib.TOMLDecodeError as error:
        raise ValueError(f"{path.name}: not readable as TOML: {error}") from None
    return validated(WaterType, content, where=path.name)


def named_water(name: str, *, particle_factor: float = 1.0) -> Water:
    """Return a water type by name, with its particles (not the water itself) `particle_factor` times as many.

    Raises ValueError for an unknown name or a negative factor.
    """
    if not (np.isfinite(particle_factor) and particle_factor >= 0):
        raise ValueError(f"water {name}: particle_factor is {particle_factor}, allowed: >= 0")
    kind = _water_type(name)
    particles = kind.particles
    return from_constituents(
        name=name if particle_factor == 1 else f"{name} x {particle_factor:.4g}",
        particle_attenuation_550_per_m=particles.attenuation_550_per_m * particle_factor,
        particle_albedo_550=particles.albedo_550,
        scattering_exponent=particles.scattering_exponent,
        absorption_slope_per_nm=particles.absorption_slope_per_nm,
        particle_phase=phase.constant(list(kind.phase.g), list(kind.phase.weights)),
    )
