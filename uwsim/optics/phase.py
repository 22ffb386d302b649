"""Phase functions [1/sr] of water: mixtures with shares over wavelength. Integral over the sphere = 1."""

from dataclasses import dataclass

import numpy as np

from uwsim.optics.phase_functions.fournier_forand import FournierForand
from uwsim.optics.phase_functions.half_angle import angle_of
from uwsim.optics.phase_functions.henyey_greenstein import HenyeyGreenstein
from uwsim.optics.phase_functions.mixture import Mixture, PhaseFunction
from uwsim.optics.phase_functions.petzold import Tabulated
from uwsim.optics.phase_functions.rayleigh import Rayleigh
from uwsim.optics.spectrum import WAVELENGTHS_NM


def henyey_greenstein(cos_angle: np.ndarray, *, g: float) -> np.ndarray:
    """Return the Henyey-Greenstein phase function at the cosine of the scattering angle. [1/sr]

    Source: Henyey & Greenstein 1941, Astrophys. J. 93:70.
    """
    return (1 - g * g) / (4 * np.pi * (1 + g * g - 2 * g * np.asarray(cos_angle)) ** 1.5)


@dataclass(frozen=True)
class PhaseMixture:
    """Mixture of phase functions whose shares may depend on wavelength.

    `terms` (k) phase functions, any object with what `phase_functions` asks of one; `weights` (k, 61) shares on the
    wavelength grid, columns sum to 1.
    """

    terms: tuple[PhaseFunction, ...]
    weights: np.ndarray

    def __post_init__(self):
        shape, allowed = np.shape(self.weights), (len(self.terms), len(WAVELENGTHS_NM))
        if not self.terms or shape != allowed:
            raise ValueError(f"phase function: weights have shape {shape}, allowed: {allowed}, one row per term")
        if not np.all(self.weights >= 0) or not np.allclose(self.weights.sum(axis=0), 1, atol=1e-6):
            raise ValueError("phase function: weights must be >= 0 and sum to 1 at every wavelength")

    def density(self, cos_angle: np.ndarray) -> np.ndarray:
        """Return the phase function, cosines (n,) -> (n, 61). [1/sr]

        Cosines know angles below 1e-7 rad only roughly; `density_at` takes angles.
        """
        return self.density_at(angle_of((1 - np.asarray(cos_angle, float)) / 2))

    def density_at(self, angle_rad: np.ndarray) -> np.ndarray:
        """Return the phase function, scattering angles (n,) -> (n, 61); inf at 0 where a term is. [1/sr]"""
        return np.stack([term.density(angle_rad) for term in self.terms], axis=-1) @ self.weights

    @property
    def mean_cosine(self) -> np.ndarray:
        """Mean cosine of the scattering angle at every wavelength, (61,)."""
        return np.array([term.mean_cosine for term in self.terms]) @ self.weights

    @property
    def backscatter_fraction(self) -> np.ndarray:
        """Share scattered beyond 90 deg at every wavelength, (61,)."""
        return np.array([term.backscatter_fraction for term in self.terms]) @ self.weights

    @property
    def henyey_greenstein_g(self) -> np.ndarray | None:
        """Mean cosine of each term (k,) where all terms are Henyey-Greenstein's; else None."""
        if not all(isinstance(term, HenyeyGreenstein) for term in self.terms):
            return None
        return np.array([term.g for term in self.terms])


def mix(parts: list[tuple[np.ndarray, PhaseMixture]]) -> PhaseMixture:
    """Return the phase function of several scatterers, [(scattering (61,) [1/m], phase function), ...].

    Phase functions mix in proportion to scattering coefficients; without any scattering, in equal shares.
    """
    total = sum(scattering for scattering, _ in parts)
    shares = [np.where(total > 0, b / np.where(total > 0, total, 1), 1 / len(parts)) for b, _ in parts]
    weights = np.concatenate([share * phase.weights for share, (_, phase) in zip(shares, parts, strict=True)])
    return PhaseMixture(tuple(term for _, phase in parts for term in phase.terms), weights)


def grey(function: PhaseFunction) -> PhaseMixture:
    """Return a phase function that is the same at every wavelength; a `Mixture` by its terms."""
    parts = _parts(function, 1.0)
    weights = np.repeat(np.array([share for _, share in parts])[:, None], len(WAVELENGTHS_NM), axis=1)
    return PhaseMixture(tuple(term for term, _ in parts), weights)


def _parts(function: PhaseFunction, share: float) -> list[tuple[PhaseFunction, float]]:
    """Return the terms of a mixture of mixtures, each with its share of the whole."""
    if not isinstance(function, Mixture):
        return [(function, share)]
    pairs = zip(function.terms, function.weights, strict=True)
    return [part for term, weight in pairs for part in _parts(term, share * weight)]


def constant(g: list[float], weights: list[float]) -> PhaseMixture:
    """Return a mixture of Henyey-Greenstein terms that is the same at every wavelength."""
    columns = np.repeat(np.asarray(weights, float)[:, None], len(WAVELENGTHS_NM), axis=1)
    return PhaseMixture(tuple(HenyeyGreenstein(float(value)) for value in g), columns)


def molecular() -> PhaseMixture:
    """Return the phase function of water molecules as two terms, g = +0.30 and g = -0.30 in equal shares.

    Within 4.7 % of 1 + 0.925 cos^2 at every angle (the best of two symmetric terms is g = 0.301: 4.6 %), mean cosine 0;
    `grey(Rayleigh())` is that shape itself.
    Valid: where molecules are a small share of the scattering (under 3 % in every tank water); in jerlov_I they are
    nearly all of it (91-100 %), so that its own phase function is within 4.7 % only.
    Source: shape of Zhang, Hu & He 2009, Opt. Express 17:5698 (depolarisation ratio 0.039).
    """
    return constant([0.30, -0.30], [0.5, 0.5])


def describe(phase: PhaseMixture) -> dict:
    """Return a phase function in plain numbers ready for JSON: `type`, terms, and their weights (k, 61).

    `hg_mixture` with `g` (k) where all terms are Henyey-Greenstein's; else `mixture` with `terms` (k), each a table
    with its `type`: hg, rayleigh, fournier_forand with their parameters, `table` with `angles_deg` and `values` (any
    scale), a power law between them and below the first.
    Raises ValueError for a term of another kind.
    """
    weights, g = np.round(phase.weights, 9).tolist(), phase.henyey_greenstein_g
    if g is not None:
        return {"type": "hg_mixture", "g": g.tolist(), "weights": weights}
    return {"type": "mixture", "terms": [_describe(term) for term in phase.terms], "weights": weights}


def _describe(term: PhaseFunction) -> dict:
    match term:
        case HenyeyGreenstein():
            return {"type": "hg", "g": term.g}
        case Rayleigh():
            return {"type": "rayleigh", "depolarisation": term.depolarisation}
        case FournierForand():
            return {"type": "fournier_forand", "n": term.n, "mu": term.mu}
        case Tabulated():
            angles_deg = np.degrees(term.angles_rad).tolist()
            return {"type": "table", "angles_deg": angles_deg, "values": np.asarray(term.vsf).tolist()}
        case Mixture():
            terms = [_describe(part) for part in term.terms]
            return {"type": "mixture", "terms": terms, "weights": list(term.weights)}
    raise ValueError(f"phase function: no description of a {type(term).__name__}")
