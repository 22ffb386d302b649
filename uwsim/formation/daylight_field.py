"""Daylight in formation models: sun and sky as beams below the surface, on bodies and along rays of view."""

from typing import NamedTuple

import numpy as np
from scipy import ndimage

from uwsim.formation.bands import fine
from uwsim.formation.scattering import density_of, groups
from uwsim.formation.spread import Spread
from uwsim.formation.surface import Surface
from uwsim.formation.two_paths import Law
from uwsim.optics.fresnel import critical_angle_rad, snell
from uwsim.optics.natural_light import surface_transmittance

N_WATER = 1.34
"""Refractive index of the water that bends the sky's light."""

_RINGS = 6
_SECTORS = 12
_SLOPES = 65
_RANGES = 192
_LEAST = 1e-12
_FAR = 40.0  # optical depth at which nothing is left of a ray


class Ring(NamedTuple):
    """Light that comes down at one angle: from the sun (`towards` (3,)) or from all azimuths (None).

    `cosine` with the vertical; `irradiance` (61,) normal to the rays just below the surface [W m^-2 nm^-1].
    """

    cosine: float
    irradiance: np.ndarray
    towards: np.ndarray | None


def rings(daylight) -> list[Ring]:
    """Return the light just below the surface as the sun's beam and six cones of the sky's.

    The sky is uniform above a flat surface (Fresnel), Gauss's rule over the cosine in Snell's window.
    """
    found = []
    if np.any(daylight.sun_irradiance > 0):
        towards = np.asarray(daylight.towards_sun, float)
        found.append(Ring(float(towards[2]), np.asarray(daylight.sun_irradiance), towards))
    if np.any(daylight.sky_irradiance > 0):
        nodes, weights = np.polynomial.legendre.leggauss(_RINGS)
        least = np.cos(critical_angle_rad(n_from=N_WATER, n_to=1.0))
        cosine = least + (1 - least) * 0.5 * (nodes + 1)
        zenith = snell(np.arccos(cosine), n_from=N_WATER, n_to=1.0)
        # plane irradiance of each cone: radiance in the water goes with the transmittance
        plane = weights * cosine * surface_transmittance(zenith, n_water=N_WATER)
        shares = plane / plane.sum() / cosine
        for mu, share in zip(cosine, shares, strict=True):
            found.append(Ring(float(mu), share * daylight.sky_irradiance, None))
    return found


def received(ring: Ring, normals: np.ndarray) -> np.ndarray:
    """Return the mean cosine of incidence of a ring's light on surfaces (n, 3), none from behind, (n,)."""
    if ring.towards is not None:
        return np.maximum(normals @ ring.towards, 0)
    along = normals[:, 2] * ring.cosine
    across = np.hypot(normals[:, 0], normals[:, 1]) * np.sqrt(1 - ring.cosine**2)
    # mean over the azimuth of max(along + across cos, 0)
    ratio = np.clip(-along / np.maximum(across, 1e-12), -1, 1)
    half = np.arccos(ratio)
    return (along * half + across * np.sin(half)) / np.pi


def reflected(surface: Surface, daylight, *, source: Law, camera: Law) -> np.ndarray:
    """Return the band radiance in the water of the daylight that bodies reflect, (H, W, 3) float32.

    The field below a flat surface is the same everywhere at a depth, so that light scattered forwards comes back as it
    goes: with the law "both", e^(-G d) on the slant path d. No body shades another.
    """
    view, total = surface.view, np.zeros((len(surface.range_m), 3), np.float32)
    depth = np.maximum(-view.points_m[surface.seen][:, 2], 0)
    normals = np.asarray(view.normals, float)[surface.seen]
    for ring in rings(daylight):
        geometry = received(ring, normals).astype(np.float32)
        total += surface.through(ring.irradiance, geometry, (depth / ring.cosine).astype(np.float32), source, camera)
    return surface.picture(total)


def backscatter(spread: Spread, daylight) -> np.ndarray:
    """Return the band radiance in the water of daylight that the water scatters into the rays, (H, W, 3) float32.

    int_0^R e^(-c s) sum over sun and sky of beta(psi) E e^(-G d(s)) ds with the slant path d(s) = depth(s) / mu, in
    closed form: beta E e^(-G d(0)) [1 - e^(-k R)] / k, k = c - G u / mu with u the upward part of the ray's direction.
    A ray that goes up ends at the surface. The camera is taken at the mean depth of its rays' origins.
    Source: replaces eqs. 2.55-2.60. Valid: no body shades the water.
    """
    view = spread.view
    up = np.where(view.has_ray, view.directions[..., 2], 0.0)
    depth = max(float(-view.origins_m[..., 2][view.has_ray].mean()), 0.0) if view.has_ray.any() else 0.0
    clearest = max(float(spread.media[1].attenuation.min()), 1e-6)
    with np.errstate(divide="ignore"):
        to_surface = np.where(up > 1e-9, depth / np.maximum(up, 1e-9), np.inf)
    ranges = np.minimum(np.minimum(view.range_m, to_surface), min(_FAR / clearest, 1e3))
    slopes = np.linspace(min(float(up.min()), 0.0) - 1e-6, max(float(up.max()), 0.0) + 1e-6, _SLOPES)
    nodes = max(float(ranges.max()), 1e-3) * np.linspace(0, 1, _RANGES) ** 2
    place = [
        (up - slopes[0]) / (slopes[1] - slopes[0]),
        np.sqrt(ranges / nodes[-1]) * (_RANGES - 1),
    ]
    total = np.zeros((*view.shape, 3), np.float32)
    sky = np.zeros((_SLOPES, _RANGES, 3))
    for ring in rings(daylight):
        for share, terms in groups(view.water.phase):
            left = _along(spread, ring, share, slopes=slopes, nodes=nodes, depth_m=depth)
            if ring.towards is None:
                sky += _mean_phase(ring, terms, slopes)[:, None, None] * left
            else:
                # light moves along -towards, then to the camera against the ray
                cosine = np.where(view.has_ray[..., None], view.directions, 0.0) @ ring.towards
                total += _looked_up(left, place) * _phase(terms, cosine)[..., None].astype(np.float32)
    total += _looked_up(sky, place)
    return (total * (ranges * view.has_ray)[..., None]).astype(np.float32)


def _along(spread: Spread, ring: Ring, share: np.ndarray, *, slopes, nodes, depth_m) -> np.ndarray:
    """Return band values of b E e^(-G d(0)) [1 - e^(-k R)] / (k R), (slopes, ranges, 3)."""
    view, (source, camera) = spread.view, spread.media
    weighted = (fine(ring.irradiance) * fine(view.water.scattering) * fine(share))[:, None] * view.weights
    loss, attenuation = source.loss, camera.attenuation
    if len(loss) == 3:  # the three bands: each its own column
        weighted = np.diag(weighted.sum(axis=0))
    weighted = weighted * np.exp(-loss * depth_m / ring.cosine)[:, None]
    found = np.empty((len(slopes), len(nodes), 3))
    for index, up in enumerate(slopes):
        x = (attenuation - loss * up / ring.cosine) * nodes[:, None]
        small = np.abs(x) < 1e-6
        found[index] = np.where(small, 1 - x / 2, -np.expm1(-x) / np.where(small, 1.0, x)) @ weighted
    return found


def _phase(terms, cosine: np.ndarray) -> np.ndarray:
    """Return the sum of terms of a phase function at cosines of the scattering angle. [1/sr]"""
    half = np.clip((1 - cosine) / 2, _LEAST, 1.0)
    return sum(weight * density_of(term, half) for weight, term in terms)


def _mean_phase(ring: Ring, terms, slopes: np.ndarray) -> np.ndarray:
    """Return the phase function between a ring's light and rays of given upward part, mean over azimuth, (slopes,)."""
    azimuth = np.pi * (np.arange(_SECTORS) + 0.5) / _SECTORS
    up = np.clip(slopes, -1, 1)[:, None]
    cosine = up * ring.cosine + np.sqrt(1 - up**2) * np.sqrt(1 - ring.cosine**2) * np.cos(azimuth)
    return _phase(terms, cosine).mean(axis=1)


def _looked_up(table: np.ndarray, place: list[np.ndarray]) -> np.ndarray:
    bands = [ndimage.map_coordinates(band, place, order=1, mode="nearest") for band in np.moveaxis(table, -1, 0)]
    return np.stack(bands, axis=-1).astype(np.float32)
