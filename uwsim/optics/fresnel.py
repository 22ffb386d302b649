"""Refraction and reflection at plane interfaces and at a slab with inter-reflections, per polarisation."""

import math
from typing import NamedTuple

import numpy as np

from uwsim.optics.checks import require, require_index


class Polarised(NamedTuple):
    """Values of the s and the p polarisation."""

    s: np.ndarray
    p: np.ndarray


class SlabCoefficients(NamedTuple):
    """Shares of the incident flux that a slab passes and returns, per polarisation; the rest is absorbed."""

    transmittance_by_polarisation: Polarised
    reflectance_by_polarisation: Polarised

    @property
    def transmittance(self) -> np.ndarray:
        """Of unpolarised light: the mean after the slab sum, not the product of interface means."""
        return np.mean(self.transmittance_by_polarisation, axis=0)

    @property
    def reflectance(self) -> np.ndarray:
        """Of unpolarised light."""
        return np.mean(self.reflectance_by_polarisation, axis=0)


def _angle(angle_rad: np.ndarray) -> np.ndarray:
    return require("angle of incidence angle_rad", angle_rad, least=0, most=math.pi / 2)


def critical_angle_rad(*, n_from: float, n_to: float) -> float:
    """Return the angle of incidence beyond which everything is reflected. [rad]

    Raises ValueError if the second medium is not thinner than the first.
    Source: dissertation, eq. 2.24 at 90 degrees.
    """
    require_index("critical angle", n_from=n_from, n_to=n_to)
    if n_from <= n_to:
        raise ValueError(f"critical angle: got n_from {n_from:g} and n_to {n_to:g}, allowed: n_from above n_to")
    return math.asin(n_to / n_from)


def snell(angle_rad: np.ndarray, *, n_from: float, n_to: float) -> np.ndarray:
    """Return the angle of refraction, (...) -> (...). [rad]

    Raises ValueError beyond the critical angle (no refracted ray).
    Source: dissertation, eq. 2.24.
    Errata: none; the printed form is right.
    """
    require_index("refraction", n_from=n_from, n_to=n_to)
    angle = _angle(angle_rad)
    if n_from > n_to:
        critical = critical_angle_rad(n_from=n_from, n_to=n_to)
        if np.any(angle > critical):
            got, limit = math.degrees(angle.max()), math.degrees(critical)
            raise ValueError(f"refraction: got {got:.4g} deg, allowed: up to the critical angle {limit:.4g} deg")
    return np.arcsin(np.minimum(n_from / n_to * np.sin(angle), 1.0))


def _cosines(angle_rad: np.ndarray, *, n_from: float, n_to: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the cosines on both sides; 0 on the far side where everything is reflected."""
    sine = n_from / n_to * np.sin(angle_rad)
    return np.cos(angle_rad), np.sqrt(np.maximum(1 - sine * sine, 0.0))


def _reflectance(cos_from: np.ndarray, cos_to: np.ndarray, *, n_from: float, n_to: float) -> Polarised:
    """Return the reflectance from the cosines; a zero cosine on either side gives 1."""
    if n_from == n_to:
        return Polarised(np.zeros_like(cos_from), np.zeros_like(cos_from))
    total = np.minimum(cos_from, cos_to) <= 0
    near = np.where(total, 1.0, cos_from)
    s = ((n_from * near - n_to * cos_to) / (n_from * near + n_to * cos_to)) ** 2
    p = ((n_to * near - n_from * cos_to) / (n_to * near + n_from * cos_to)) ** 2
    return Polarised(np.where(total, 1.0, s), np.where(total, 1.0, p))


def interface_reflectance(angle_rad: np.ndarray, *, n_from: float, n_to: float) -> Polarised:
    """Return the share of flux reflected at one interface, (...) -> two of (...); 1 beyond the critical angle.

    Source: Fresnel equations (Born & Wolf, Principles of Optics, 1.5.2), squared amplitudes.
    """
    require_index("interface", n_from=n_from, n_to=n_to)
    near, far = _cosines(_angle(angle_rad), n_from=n_from, n_to=n_to)
    return _reflectance(near, far, n_from=n_from, n_to=n_to)


def normal_transmittance(*, n_from: float, n_to: float) -> float:
    """Return the share of flux that passes one interface at normal incidence.

    Source: dissertation, eqs. 2.16 (air to glass) and 2.17 (glass to water).
    Valid: normal incidence only; `interface_reflectance` at any angle.
    Errata: the text names r_w and r_g the wrong way round; the formulas are right.
    """
    require_index("interface", n_from=n_from, n_to=n_to)
    return 1 - ((n_from - n_to) / (n_from + n_to)) ** 2


def slab(
    angle_rad: np.ndarray,
    *,
    n_in: float,
    n_slab: float,
    n_out: float,
    absorption_per_m: float = 0.0,
    thickness_m: float = 0.0,
) -> SlabCoefficients:
    """Return transmittance and reflectance of a plane-parallel slab for light from the first medium, (...) -> (...).

    Nothing passes where the ray is totally reflected at either face.
    Source: incoherent sum over inter-reflections, per polarisation, with the inner transmission A along the
    refracted ray: T = (1-R1)(1-R2) A / (1 - R1 R2 A^2), R = R1 + (1-R1)^2 R2 A^2 / (1 - R1 R2 A^2).
    Valid: thickness far above the coherence length; faces wide against the offset of the inter-reflected rays.
    Errata: replaces dissertation eqs. 2.16-2.18, which hold at normal incidence and omit inter-reflections.
    """
    require_index("slab", n_in=n_in, n_slab=n_slab, n_out=n_out)
    require("slab absorption_per_m", absorption_per_m, least=0)
    require("slab thickness_m", thickness_m, least=0)
    angle = _angle(angle_rad)
    cos_in, cos_slab = _cosines(angle, n_from=n_in, n_to=n_slab)
    _, cos_out = _cosines(angle, n_from=n_in, n_to=n_out)
    inner = np.exp(-absorption_per_m * thickness_m / np.maximum(cos_slab, 1e-12))
    shares = []
    for first, second in zip(
        _reflectance(cos_in, cos_slab, n_from=n_in, n_to=n_slab),
        _reflectance(cos_slab, cos_out, n_from=n_slab, n_to=n_out),
        strict=True,
    ):
        closed = first >= 1.0
        rounds = np.where(closed, 1.0, 1 - first * second * inner**2)
        passed = (1 - first) * (1 - second) * inner / rounds
        returned = np.where(closed, 1.0, first + (1 - first) ** 2 * second * inner**2 / rounds)
        shares.append((passed, returned))
    (passed_s, returned_s), (passed_p, returned_p) = shares
    return SlabCoefficients(Polarised(passed_s, passed_p), Polarised(returned_s, returned_p))


def lambertian_transmittance(
    *, n_in: float, n_slab: float, n_out: float, absorption_per_m: float = 0.0, thickness_m: float = 0.0
) -> float:
    """Return the share of the flux of uniform radiance over the hemisphere that a slab passes.

    Source: integral of T(theta) sin(2 theta) over 0..90 degrees, Gauss-Legendre in the cosine (200 nodes).
    Valid: within 1e-6 where n_in is not above n_slab and n_out (no total reflection inside the range).
    """
    nodes, weights = np.polynomial.legendre.leggauss(200)
    cosine = 0.5 * (nodes + 1)
    passed = slab(
        np.arccos(cosine),
        n_in=n_in,
        n_slab=n_slab,
        n_out=n_out,
        absorption_per_m=absorption_per_m,
        thickness_m=thickness_m,
    ).transmittance
    return float(np.sum(weights * cosine * passed))
