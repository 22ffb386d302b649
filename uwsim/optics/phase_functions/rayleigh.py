"""Scattering by molecules: Rayleigh, and water with its depolarisation ratio."""

from dataclasses import dataclass

import numpy as np

from uwsim.optics.phase_functions.half_angle import angle_of, checked_uniform, half_angle_square

WATER_DEPOLARISATION = 0.039
"""Depolarisation ratio of pure water and sea water (Farinato & Rowell 1976). [-]"""


@dataclass(frozen=True)
class Rayleigh:
    """p = 3 / (4 pi (3 + q)) (1 + q cos^2), q = (1 - delta) / (1 + delta) for the depolarisation ratio delta.

    delta = 0 is Rayleigh's 3 / (16 pi) (1 + cos^2); water has 0.039, so 1 + 0.925 cos^2.
    Source: Morel 1974; Zhang, Hu & He 2009, Opt. Express 17:5698.
    Errata: the dissertation (eq. 2.4) calls the molecular share Rayleigh's, with lambda^-4; in water it falls with
    lambda^-4.2 (Zhang) to lambda^-4.32 (Morel), because the refractive index changes with wavelength.
    """

    depolarisation: float = WATER_DEPOLARISATION

    def __post_init__(self):
        if not 0 <= self.depolarisation < 1:
            raise ValueError(f"Rayleigh: depolarisation is {self.depolarisation}, allowed: 0 to below 1")

    @property
    def anisotropy(self) -> float:
        """q, the factor of cos^2."""
        return (1 - self.depolarisation) / (1 + self.depolarisation)

    def density(self, angle_rad: np.ndarray) -> np.ndarray:
        """Return the phase function. [1/sr]"""
        q, cosine = self.anisotropy, 1 - 2 * half_angle_square(angle_rad)
        return 3 / (4 * np.pi * (3 + q)) * (1 + q * cosine**2)

    def cdf(self, angle_rad: np.ndarray) -> np.ndarray:
        """Return the share scattered to smaller angles: a cubic in s, exact at small angles."""
        q, s = self.anisotropy, half_angle_square(angle_rad)
        return 3 / (3 + q) * s * (1 + q - 2 * q * s + 4 / 3 * q * s**2)

    def sample(self, uniform: np.ndarray) -> np.ndarray:
        """Return scattering angles: q x^3 + 3 x = (3 + q)(1 - 2 u) has one real root x = cos. [rad]"""
        q, u = self.anisotropy, checked_uniform(uniform)
        root = np.arcsinh((3 + q) * (1 - 2 * u) * np.sqrt(q) / 2)
        return angle_of((1 - 2 / np.sqrt(q) * np.sinh(root / 3)) / 2)

    @property
    def mean_cosine(self) -> float:
        return 0.0

    @property
    def backscatter_fraction(self) -> float:
        return 0.5
