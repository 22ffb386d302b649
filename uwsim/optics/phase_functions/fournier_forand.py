"""Fournier-Forand phase function: particles with a power law of sizes and one refractive index."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import integrate

from uwsim.optics import tables
from uwsim.optics.phase_functions.half_angle import angle_of, half_angle_square, invert

_SERIES = 0.3  # |ln delta| below which the quotients are summed as series


@dataclass(frozen=True)
class FournierForand:
    """Phase function of particles of relative refractive index n, number of sizes ~ radius^-mu.

    With s = sin^2(angle/2), delta = 4 s / (3 (n - 1)^2), a = (mu - 3) / 2, R(delta) = (1 - delta^a) / (1 - delta) and
    R_180 = R at s = 1, the printed forms are

        CDF = 1 - (1 - s) [R(delta) - R_180 s (1 - 2 s) / 2],        p = dCDF/ds / (4 pi).

    Source: Fournier & Forand 1994, Proc. SPIE 2258:194; Fournier & Jonasz 1999, Proc. SPIE 3761:62 (the form with
    the term of R_180, nu = -a).
    Errata: it is normalised exactly; a "renormalisation by 1 %" met in other programs is an error of quadrature. Much
    light lies at angles that float32 cosines cannot tell from 0 (n 1.021, mu 3.0742: 27 % within 1e-9 rad).
    Valid: n above 1 (1.01-1.3 in the sea), mu between 3 and 5; the density diverges at angle 0 (inf), integrably.
    """

    n: float
    mu: float

    def __post_init__(self):
        if not 1 < self.n <= 2:
            raise ValueError(f"Fournier-Forand: n is {self.n}, allowed: above 1 to 2")
        if not 3 < self.mu < 5:
            raise ValueError(f"Fournier-Forand: mu is {self.mu}, allowed: between 3 and 5, exclusive")

    @property
    def _a(self) -> float:
        return (self.mu - 3) / 2

    @property
    def _scale(self) -> float:
        """delta / s."""
        return 4 / (3 * (self.n - 1) ** 2)

    @cached_property
    def _r180(self) -> float:
        return float(_quotient(np.asarray(self._scale), self._a))

    def density(self, angle_rad: np.ndarray) -> np.ndarray:
        """Return the phase function; inf at angle 0. [1/sr]"""
        return self._density(half_angle_square(angle_rad))

    def _density(self, s: np.ndarray) -> np.ndarray:
        delta = self._scale * s
        tail = self._r180 * (1 - 6 * s + 6 * s * s) / 2
        with np.errstate(divide="ignore", invalid="ignore"):
            # d/ds of -(1 - s) R: R - (1 - s) R'(delta) delta / s
            rise = -(1 - s) * _log_slope(delta, self._a) / s
            value = (_quotient(delta, self._a) * (1 + rise) + tail) / (4 * np.pi)
        return np.where(s > 0, value, np.asarray(np.inf, value.dtype))

    def cdf(self, angle_rad: np.ndarray) -> np.ndarray:
        """Return the share scattered to smaller angles, in closed form."""
        return self._cdf(half_angle_square(angle_rad))

    def _cdf(self, s: np.ndarray) -> np.ndarray:
        delta, a = self._scale * s, self._a
        tail = self._r180 * s * (1 - 2 * s) / 2
        small = np.minimum(delta, 0.5)
        # the sum of small terms where the share is small: 1 - (1 - s) R would lose its digits
        near = ((1 - s) * small**a + s - small) / (1 - small) + (1 - s) * tail
        return np.where(delta < 0.5, near, 1 - (1 - s) * (_quotient(delta, a) - tail))

    def sample(self, uniform: np.ndarray) -> np.ndarray:
        """Return scattering angles, the CDF inverted to round-off in s. [rad]"""
        return angle_of(invert(self._cdf, self._density, uniform))

    @cached_property
    def mean_cosine(self) -> float:
        """1 - 2 <s>, <s> = int (1 - s) R ds (the term of R_180 contributes nothing)."""
        turn = min(1 / self._scale, 0.5)
        parts = [(0.0, turn / 100), (turn / 100, turn), (turn, min(5 * turn, 1.0)), (min(5 * turn, 1.0), 1.0)]
        mean = sum(
            integrate.quad(lambda s: (1 - s) * _quotient(np.asarray(self._scale * s), self._a), *part, epsabs=1e-12)[0]
            for part in parts
        )
        return float(1 - 2 * mean)

    @property
    def backscatter_fraction(self) -> float:
        """1 - CDF(90 deg) = R(delta_90) / 2."""
        return float(1 - self._cdf(np.asarray(0.5)))


def _quotient(delta: np.ndarray, a: float) -> np.ndarray:
    """Return (1 - delta^a) / (1 - delta); a at delta = 1."""
    with np.errstate(divide="ignore", invalid="ignore"):
        log = np.log(delta)
        value = np.expm1(a * log) / np.expm1(log)
    return np.where(log == 0, np.asarray(a, value.dtype), value)


def _log_slope(delta: np.ndarray, a: float) -> np.ndarray:
    """Return d ln R / d ln delta = a h(a L) - h(L), L = ln delta, h(x) = 1 / (1 - e^-x) - 1/x (the 1/x cancel).

    Around delta = 1 by the series h(x) = 1/2 + x/12 - x^3/720 + x^5/30240 - x^7/1209600.
    """
    log = np.log(delta)
    series = (a - 1) / 2 + log * (
        (a**2 - 1) / 12 - log**2 * ((a**4 - 1) / 720 - log**2 * ((a**6 - 1) / 30240 - log**2 * (a**8 - 1) / 1209600))
    )
    with np.errstate(over="ignore"):
        direct = 1 / np.expm1(-log) - a / np.expm1(-a * log)
    return np.where(np.abs(log) < _SERIES, series, direct)


def petzold_fournier_forand(water: str) -> FournierForand:
    """Return the function fitted to Petzold's `clear`, `coastal`, `harbor` or `average` particle.

    Valid: rms 8-9 % over 0.1-180 deg for harbor and average, 24-28 % for coastal and clear.
    """
    fit = tables.row("petzold_fits", "water", water)
    return FournierForand(n=float(fit["ff_n"]), mu=float(fit["ff_mu"]))
