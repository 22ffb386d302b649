"""Phase functions in a scene, by name and parameters."""

from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from uwsim.optics import phase as phases
from uwsim.optics.phase_functions.fournier_forand import FournierForand
from uwsim.optics.phase_functions.henyey_greenstein import HenyeyGreenstein
from uwsim.optics.phase_functions.mixture import Mixture, PhaseFunction
from uwsim.optics.phase_functions.petzold import petzold
from uwsim.optics.phase_functions.rayleigh import WATER_DEPOLARISATION, Rayleigh
from uwsim.optics.phase_functions.two_term import two_term
from uwsim.optics.spectrum import on_grid
from uwsim.scene.base import NonNegative, Strict


class _Named(Strict):
    """A phase function without wavelengths; made once on reading, so that the optics refuse bad parameters there."""

    @model_validator(mode="after")
    def _usable(self):
        self.mixture()
        return self

    def mixture(self, wavelengths_nm: tuple[float, ...] | None = None) -> phases.PhaseMixture:
        """Return it on the wavelength grid."""
        return phases.grey(self._function())

    def _function(self) -> PhaseFunction:
        raise NotImplementedError


class HenyeyGreensteinPhase(Strict):
    """Henyey-Greenstein with mean cosine g: one number, or one per wavelength of the water's table."""

    type: Literal["hg"]
    g: float | tuple[float, ...]

    @model_validator(mode="after")
    def _usable(self):
        _check_g(self.g)
        return self

    def mixture(self, wavelengths_nm: tuple[float, ...] | None = None) -> phases.PhaseMixture:
        """Return it on the wavelength grid; ValueError for a list of g without wavelengths to go with it."""
        if not isinstance(self.g, tuple):
            return phases.constant([self.g], [1.0])
        if wavelengths_nm is None:
            raise ValueError(f"g is {self.g}, allowed in water without a table of wavelengths: one number")
        return _spectral_hg(on_grid(wavelengths_nm, self.g, where="phase.g"))


class MixturePhase(_Named):
    """Henyey-Greenstein terms, `g` and `weights` of each."""

    type: Literal["hg_mixture"]
    g: tuple[float, ...]
    weights: tuple[NonNegative, ...]

    def _function(self) -> PhaseFunction:
        _check_g(self.g)
        return Mixture(tuple(map(HenyeyGreenstein, self.g)), self.weights)


class TwoTermPhase(_Named):
    """share x HG(g_forward) + (1 - share) x HG(g_backward)."""

    type: Literal["two_term"]
    share: Annotated[float, Field(ge=0, le=1)]
    g_forward: float
    g_backward: float

    def _function(self) -> PhaseFunction:
        return two_term(share=self.share, g_forward=self.g_forward, g_backward=self.g_backward)


class FournierForandPhase(_Named):
    """Particles of relative refractive index n, number of sizes ~ radius^-mu."""

    type: Literal["fournier_forand"]
    n: float
    mu: float

    def _function(self) -> PhaseFunction:
        return FournierForand(n=self.n, mu=self.mu)


class PetzoldPhase(_Named):
    """One of Petzold's measured phase functions, as tabulated."""

    type: Literal["petzold"]
    name: Literal["clear", "coastal", "harbor", "average"]

    def _function(self) -> PhaseFunction:
        return petzold(self.name)


class RayleighPhase(_Named):
    """Molecules; by default those of water."""

    type: Literal["rayleigh"]
    depolarisation: Annotated[float, Field(ge=0, lt=1)] = WATER_DEPOLARISATION

    def _function(self) -> PhaseFunction:
        return Rayleigh(depolarisation=self.depolarisation)


class IsotropicPhase(_Named):
    """The same in all directions."""

    type: Literal["isotropic"]

    def _function(self) -> PhaseFunction:
        return HenyeyGreenstein(0.0)


Phase = Annotated[
    HenyeyGreensteinPhase
    | MixturePhase
    | TwoTermPhase
    | FournierForandPhase
    | PetzoldPhase
    | RayleighPhase
    | IsotropicPhase,
    Field(discriminator="type"),
]


def _check_g(g: float | tuple[float, ...]) -> None:
    if any(abs(value) >= 1 for value in (g if isinstance(g, tuple) else (g,))):
        raise ValueError(f"g is {g}, allowed: between -1 and 1, exclusive")


def _spectral_hg(g: np.ndarray) -> phases.PhaseMixture:
    """Henyey-Greenstein with g over wavelength (61,): one term per distinct g, switched on where it applies."""
    terms, index = np.unique(np.round(g, 6), return_inverse=True)
    return phases.PhaseMixture(tuple(HenyeyGreenstein(float(g)) for g in terms), np.eye(len(terms))[:, index])
