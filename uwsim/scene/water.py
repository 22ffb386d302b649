"""Water in a scene: by name, by its minerals, or by its coefficients."""

from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from uwsim.optics import phase as phases
from uwsim.optics.refractive_index import water_quan1995
from uwsim.optics.spectrum import on_grid
from uwsim.optics.turbidity import turbid_water
from uwsim.optics.water import Water, named_water
from uwsim.scene.base import NonNegative, Strict

FRESH_WATER_INDEX = round(float(water_quan1995(550.0, temperature_c=20.0, salinity_psu=0.0)), 4)
"""Refractive index of fresh water at 550 nm and 20 C, relative to air."""


class _Refracting(Strict):
    """Water with one refractive index, relative to air, at all wavelengths."""

    refractive_index: Annotated[float, Field(ge=1, le=1.6)] = FRESH_WATER_INDEX


class Phase(Strict):
    """Phase function: `hg` with mean cosine g, one number or one per wavelength; or `hg_mixture`."""

    type: Literal["hg", "hg_mixture"] = "hg"
    g: float | tuple[float, ...]
    weights: tuple[NonNegative, ...] | None = None

    @model_validator(mode="after")
    def _usable(self):
        terms = self.g if isinstance(self.g, tuple) else (self.g,)
        if any(abs(g) >= 1 for g in terms):
            raise ValueError(f"g is {self.g}, allowed: between -1 and 1, exclusive")
        if self.type == "hg_mixture" and not isinstance(self.g, tuple):
            raise ValueError(f"g is {self.g}, allowed for hg_mixture: a list, one per weight")
        if (self.type == "hg_mixture") != (self.weights is not None):
            raise ValueError("weights belong to type hg_mixture, and only to it")
        if self.weights is not None and (len(self.weights) != len(terms) or abs(sum(self.weights) - 1) > 1e-6):
            raise ValueError(f"weights are {self.weights}, allowed: one per g, with sum 1")
        return self

    def mixture(self, wavelengths_nm: tuple[float, ...]) -> phases.PhaseMixture:
        if self.type == "hg_mixture":
            return phases.constant(list(self.g), list(self.weights))
        if not isinstance(self.g, tuple):
            return phases.constant([self.g], [1.0])
        return _spectral_hg(on_grid(wavelengths_nm, self.g, where="phase.g"))


def _spectral_hg(g: np.ndarray) -> phases.PhaseMixture:
    """Henyey-Greenstein with g over wavelength (61,): one term per distinct g, switched on where it applies."""
    terms, index = np.unique(np.round(g, 6), return_inverse=True)
    return phases.PhaseMixture(g=terms, weights=np.eye(len(terms))[:, index])


class NamedWater(_Refracting):
    """A water type by name; `particle_factor` multiplies its particles, `source` chooses among rival Jerlov tables."""

    name: str
    particle_factor: NonNegative = 1.0
    source: str | None = None

    @model_validator(mode="after")
    def _known(self):
        self.optical()
        return self

    def optical(self) -> Water:
        return named_water(self.name, particle_factor=self.particle_factor, source=self.source)


class TurbidWater(_Refracting):
    """Fresh water with suspended minerals by mass."""

    minerals_g_per_m3: NonNegative

    def optical(self) -> Water:
        return turbid_water(minerals_g_per_m3=self.minerals_g_per_m3)


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
