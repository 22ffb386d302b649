"""Water in a scene: by name, by its minerals, or by its coefficients."""

from typing import Annotated

from pydantic import Field, model_validator

from uwsim.optics.phase import PhaseMixture
from uwsim.optics.refractive_index import water_quan1995
from uwsim.optics.spectrum import on_grid
from uwsim.optics.turbidity import turbid_water
from uwsim.optics.water import Water, named_water
from uwsim.scene.base import NonNegative, Strict
from uwsim.scene.phase import Phase

FRESH_WATER_INDEX = round(float(water_quan1995(550.0, temperature_c=20.0, salinity_psu=0.0)), 4)
"""Refractive index of fresh water at 550 nm and 20 C, relative to air."""


class _Refracting(Strict):
    """Water with one refractive index, relative to air, at all wavelengths."""

    refractive_index: Annotated[float, Field(ge=1, le=1.6)] = FRESH_WATER_INDEX


class NamedWater(_Refracting):
    """A water type by name; `particle_factor` multiplies its particles, `source` chooses among rival Jerlov tables.

    `particle_phase` replaces the phase function of the particles; Petzold's waters, measured as a whole, have none.
    """

    name: str
    particle_factor: NonNegative = 1.0
    source: str | None = None
    particle_phase: Phase | None = None

    @model_validator(mode="after")
    def _known(self):
        self.optical()
        return self

    def optical(self) -> Water:
        particle_phase = _particle_phase(self.particle_phase)
        return named_water(
            self.name, particle_factor=self.particle_factor, source=self.source, particle_phase=particle_phase
        )


class TurbidWater(_Refracting):
    """Fresh water with suspended minerals by mass; `particle_phase` replaces Petzold's average particle."""

    minerals_g_per_m3: NonNegative
    particle_phase: Phase | None = None

    @model_validator(mode="after")
    def _usable(self):
        self.optical()
        return self

    def optical(self) -> Water:
        particle_phase = _particle_phase(self.particle_phase)
        return turbid_water(minerals_g_per_m3=self.minerals_g_per_m3, particle_phase=particle_phase)


class TabulatedWater(_Refracting):
    """Water by its coefficients over wavelength."""

    wavelengths_nm: tuple[float, ...]
    absorption_per_m: tuple[NonNegative, ...]
    scattering_per_m: tuple[NonNegative, ...]
    phase: Phase

    @model_validator(mode="after")
    def _usable(self):
        self.optical()
        return self

    def optical(self) -> Water:
        a = on_grid(self.wavelengths_nm, self.absorption_per_m, where="absorption_per_m")
        b = on_grid(self.wavelengths_nm, self.scattering_per_m, where="scattering_per_m")
        return Water(name="tabulated", absorption=a, scattering=b, phase=self.phase.mixture(self.wavelengths_nm))


def _particle_phase(phase: Phase | None) -> PhaseMixture | None:
    return None if phase is None else phase.mixture()
