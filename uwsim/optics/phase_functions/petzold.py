"""Petzold's measured phase functions: clear ocean, coastal water, harbour, and the average particle."""

from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np

from uwsim.optics import tables
from uwsim.optics.phase_functions.half_angle import angle_of, half_angle_square, invert

WATERS = ("clear", "coastal", "harbor", "average")
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(8)


@dataclass(frozen=True, eq=False)
class Tabulated:
    """Phase function from a table that is a power law between its angles, and below the first one.

    `angles_rad` (N,) increasing, from above 0 to pi; `vsf` (N,) > 0, of any scale: the density is normalised.
    `scattering` is 2 pi int vsf sin d(angle), in the unit of the table times sr (b [1/m] for a VSF [1/(m sr)]).
    """

    angles_rad: np.ndarray
    vsf: np.ndarray

    def __post_init__(self):
        angles, values = self.angles_rad, self.vsf
        if angles.shape != values.shape or angles.ndim != 1 or len(angles) < 2:
            raise ValueError(
                f"phase table: got {angles.size} angles, {values.size} values, allowed: equally many, >= 2"
            )
        if not (np.all(np.diff(angles) > 0) and angles[0] > 0 and abs(angles[-1] - np.pi) < 1e-9):
            raise ValueError("phase table: allowed: angles that increase from above 0 to 180 deg")
        if not np.all(np.isfinite(values) & (values > 0)):
            raise ValueError(f"phase table: smallest value is {values.min():g}, allowed: finite and above 0")
        if self._slopes[0] <= -2:
            raise ValueError(f"phase table: slope below the first angle is {self._slopes[0]:g}, allowed: above -2")

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Tabulated) and self._content == other._content

    def __hash__(self) -> int:
        return hash(self._content)

    @property
    def _content(self) -> tuple[bytes, bytes]:
        """What makes two tables the same one: arrays neither compare nor hash by themselves."""
        return self.angles_rad.tobytes(), self.vsf.tobytes()

    @cached_property
    def _slopes(self) -> np.ndarray:
        return np.diff(np.log(self.vsf)) / np.diff(np.log(self.angles_rad))

    def _vsf_at(self, angle: np.ndarray) -> np.ndarray:
        segment = np.clip(np.searchsorted(self.angles_rad, angle, side="right") - 1, 0, len(self._slopes) - 1)
        with np.errstate(divide="ignore"):
            return self.vsf[segment] * (angle / self.angles_rad[segment]) ** self._slopes[segment]

    def _below(self, angle: np.ndarray) -> np.ndarray:
        """2 pi int_0^angle vsf sin: closed below the first angle (sin x = x), Gauss-Legendre from the knot before."""
        first, slope = self.angles_rad[0], self._slopes[0]
        scale = 2 * np.pi * self.vsf[0] * first**2 / (2 + slope)
        segment = np.clip(np.searchsorted(self.angles_rad, angle, side="right") - 1, 0, len(self._slopes) - 1)
        start = self.angles_rad[segment]
        tail = scale * (np.minimum(angle, first) / first) ** (2 + slope)
        return np.where(angle < first, tail, self._at_knots[segment] + self._piece(start, np.maximum(angle, start)))

    @cached_property
    def _at_knots(self) -> np.ndarray:
        angles = self.angles_rad
        first = 2 * np.pi * self.vsf[0] * angles[0] ** 2 / (2 + self._slopes[0])
        return first + np.concatenate([[0.0], np.cumsum(self._piece(angles[:-1], angles[1:]))])

    def _piece(self, start: np.ndarray, end: np.ndarray) -> np.ndarray:
        """2 pi int vsf sin over intervals that hold no knot, in the logarithm of the angle."""
        segment = np.clip(np.searchsorted(self.angles_rad, start, side="right") - 1, 0, len(self._slopes) - 1)
        middle, half = (np.log(end) + np.log(start)) / 2, (np.log(end) - np.log(start)) / 2
        angle = np.exp(middle[..., None] + half[..., None] * _NODES)
        power = (angle / self.angles_rad[segment][..., None]) ** self._slopes[segment][..., None]
        return 2 * np.pi * self.vsf[segment] * half * np.sum(_WEIGHTS * power * np.sin(angle) * angle, axis=-1)

    @property
    def scattering(self) -> float:
        return float(self._at_knots[-1])

    def density(self, angle_rad: np.ndarray) -> np.ndarray:
        """Return the phase function; inf at angle 0, where the power law diverges. [1/sr]"""
        return self._vsf_at(angle_of(half_angle_square(angle_rad))) / self.scattering

    def cdf(self, angle_rad: np.ndarray) -> np.ndarray:
        """Return the share scattered to smaller angles."""
        return self._below(angle_of(half_angle_square(angle_rad))) / self.scattering

    def sample(self, uniform: np.ndarray) -> np.ndarray:
        """Return scattering angles, the CDF inverted. [rad]"""
        return angle_of(invert(lambda s: self.cdf(angle_of(s)), lambda s: self.density(angle_of(s)), uniform))

    @cached_property
    def mean_cosine(self) -> float:
        edges = np.concatenate([np.geomspace(1e-8, self.angles_rad[0], 60)[:-1], self.angles_rad])
        middle, half = np.log(edges[1:] * edges[:-1])[:, None] / 2, np.log(edges[1:] / edges[:-1])[:, None] / 2
        angle = np.exp(middle + half * _NODES)
        # 1 - cos keeps the unbounded share at tiny angles out of the quadrature
        versine = 2 * np.sin(angle / 2) ** 2 * self._vsf_at(angle) * np.sin(angle) * angle
        return float(1 - 2 * np.pi * np.sum(_WEIGHTS * versine * half) / self.scattering)

    @property
    def backscatter_fraction(self) -> float:
        return float(1 - self.cdf(np.asarray(np.pi / 2)))


@cache
def petzold(water: str) -> Tabulated:
    """Return the measured phase function of `clear`, `coastal`, `harbor` (all water) or `average` (particles).

    Source: Petzold 1972, report SIO 72-78; average after Mobley et al. 1993, Appl. Opt. 32:7484.
    Errata: Mobley et al. 1993 and Light and Water print 218.8 at 0.501 deg for the average; it is 201.8.
    Valid: measured 0.1-170 deg at 514-530 nm. Below 0.1 deg the power law of the first two angles goes on; it holds
    3, 12, 5 and 5 % of the light.
    """
    if water not in WATERS:
        raise ValueError(f"Petzold water: got {water!r}, allowed: {', '.join(WATERS)}")
    name = "petzold_average" if water == "average" else "petzold_vsf"
    angles = np.radians(tables.column(name, "angle_deg"))
    angles[-1] = np.pi
    return Tabulated(angles, tables.column(name, water))
