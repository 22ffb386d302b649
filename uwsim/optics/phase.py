"""Phase functions [1/sr]: Henyey-Greenstein and mixtures of it. Integral over the sphere = 1."""

from dataclasses import dataclass

import numpy as np

from uwsim.optics.spectrum import WAVELENGTHS_NM


def henyey_greenstein(cos_angle: np.ndarray, *, g: float) -> np.ndarray:
    """Return the Henyey-Greenstein phase function at the cosine of the scattering angle. [1/sr]

    Source: Henyey & Greenstein 1941, Astrophys. J. 93:70.
    """
    return (1 - g * g) / (4 * np.pi * (1 + g * g - 2 * g * np.asarray(cos_angle)) ** 1.5)


@dataclass(frozen=True)
class PhaseMixture:
    """Mixture of Henyey-Greenstein terms whose shares may depend on wavelength.

    `g` (k,) mean cosines in (-1, 1); `weights` (k, 61) shares on the wavelength grid, columns sum to 1.
    """

    g: np.ndarray
    weights: np.ndarray

    def __post_init__(self):
        if not np.all(np.abs(self.g) < 1):
            raise ValueError(f"phase function: g is {list(self.g)}, allowed: between -1 and 1, exclusive")
        if not np.all(self.weights >= 0) or not np.allclose(self.weights.sum(axis=0), 1, atol=1e-6):
            raise ValueError("phase function: weights must be >= 0 and sum to 1 at every wavelength")

    def density(self, cos_angle: np.ndarray) -> np.ndarray:
        """Return the phase function, cosines (n,) -> (n, 61). [1/sr]"""
        terms = np.stack([henyey_greenstein(cos_angle, g=g) for g in self.g], axis=-1)
        return terms @ self.weights

    @property
    def mean_cosine(self) -> np.ndarray:
        """Mean cosine of the scattering angle at every wavelength, (61,)."""
        return self.g @ self.weights

    @property
    def backscatter_fraction(self) -> np.ndarray:
        """Share scattered beyond 90 deg at every wavelength, (61,), closed form of each term."""
        root = np.sqrt(1 + self.g**2)
        return (1 - (1 + self.g) / (root * (root + 1 - self.g))) @ self.weights


def mix(parts: list[tuple[np.ndarray, PhaseMixture]]) -> PhaseMixture:
    """Return the phase function of several scatterers, [(scattering (61,) [1/m], phase function), ...].

    Phase functions mix in proportion to scattering coefficients; without any scattering, in equal shares.
    """
    total = sum(scattering for scattering, _ in parts)
    shares = [np.where(total > 0, b / np.where(total > 0, total, 1), 1 / len(parts)) for b, _ in parts]
    weights = np.concatenate([share * phase.weights for share, (_, phase) in zip(shares, parts, strict=True)])
    return PhaseMixture(g=np.concatenate([phase.g for _, phase in parts]), weights=weights)


def constant(g: list[float], weights: list[float]) -> PhaseMixture:
    """Return a mixture that is the same at every wavelength."""
    columns = np.repeat(np.asarray(weights, float)[:, None], len(WAVELENGTHS_NM), axis=1)
    return PhaseMixture(g=np.asarray(g, float), weights=columns)


def molecular() -> PhaseMixture:
    """Return the phase function of water molecules as two terms, g = +0.30 and g = -0.30 in equal shares.

    Within 4.7 % of 1 + 0.925 cos^2 at every angle (the best of two symmetric terms is g = 0.301: 4.6 %), mean cosine 0.
    Valid: where molecules are a small share of the scattering (under 3 % in every tank water); in jerlov_I they are
    nearly all of it (91-100 %), so that its own phase function is within 4.7 % only.
    Source: shape of Zhang, Hu & He 2009, Opt. Express 17:5698 (depolarisation ratio 0.039).
    """
    return constant([0.30, -0.30], [0.5, 0.5])
