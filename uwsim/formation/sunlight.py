"""Light of the sun in a view: what bodies reflect of it and what the water scatters once into the camera."""

import numpy as np

from uwsim.formation.bands import PathTable
from uwsim.formation.direct import seen_range_m
from uwsim.formation.scattering import density_of, groups
from uwsim.formation.view import View


def sun_direct(view: View, *, spectral: bool = True, cosine: bool = True) -> np.ndarray:
    """Return the sun's light by way of the bodies seen, unscattered, (H, W, 3) float32: radiance in the water.

    L = albedo / pi E cos(gamma) exp(-c (d_s + range)), d_s the way of the sun's rays in the water; zeros without sun.
    `cosine` False: a surface normal to the sun's rays. Bodies cast no shadow but by their normal.
    Source: dissertation eqs. 2.47, 2.52 for J_s. Errata: they attenuate irradiance with c; that is right for the
    unscattered sun alone, along its refracted rays.
    """
    total = np.zeros((*view.shape, 3), np.float32)
    if view.daylight is None:
        return total
    path = (view.daylight.sun_path_m(view.points_m) + seen_range_m(view)).astype(np.float32)
    received = view.has_body.astype(np.float32)
    if cosine:
        received *= np.maximum(view.normals @ view.daylight.towards_sun, 0).astype(np.float32)
    for albedo, spectrum in zip(np.moveaxis(view.albedo, -1, 0), view.albedo_spectra, strict=True):
        found = PathTable(view, np.stack([view.daylight.sun_irradiance, spectrum]), spectral=spectral)(path)
        found *= (received * albedo.astype(np.float32) * np.float32(1 / np.pi))[..., None]
        total += found
    return total


def sun_backscatter(view: View, *, spectral: bool = True) -> np.ndarray:
    """Return the sun's light scattered once along every ray, (H, W, 3) float32: radiance in the water.

    L = b p(angle) E e^(-c z/mu) [1 - e^(-c k R)] / (c k), z the depth of the camera, mu the cosine of the sun's rays,
    k = 1 - (up component of the ray) / mu; a ray without a body ends where it meets the surface, or never.
    Source: dissertation eqs. 2.55-2.60, closed for the unscattered sun (K_d = c / mu along the vertical).
    Errata: 2.59 lacks the direction of sun and view, 2.60 the change of the light along rays that are not horizontal.
    Valid: single scattering, flat surface; not for water without attenuation.
    """
    total = np.zeros((*view.shape, 3), np.float32)
    if view.daylight is None or not view.water.scattering.any():
        return total
    sun, rays = view.daylight.towards_sun, view.has_ray
    origins = np.where(rays[..., None], view.origins_m, 0.0)
    directions = np.where(rays[..., None], view.directions, [1.0, 0.0, 0.0])
    with np.errstate(divide="ignore"):
        to_surface = np.where(directions[..., 2] > 0, -origins[..., 2] / directions[..., 2], np.inf)
    length = np.maximum(np.minimum(view.range_m, to_surface), 0)
    before = view.daylight.sun_path_m(origins)
    growth = 1 - directions[..., 2] / sun[2]
    # the path of light grows by `growth` per length; where it hardly does, the integral is the length itself
    flat = np.abs(growth) * np.minimum(length, view.decay.reach_m) < 1e-4
    slope = np.where(flat, 1.0, growth)
    after = before + np.where(flat, 0.0, slope * length)
    half = np.clip((1 - directions @ sun) / 2, 1e-12, 1)
    attenuation = np.maximum(view.water.attenuation, 1e-12)
    for share, parts in groups(view.water.phase):
        spectrum = view.daylight.sun_irradiance * view.water.scattering * share
        inner, through = (
            PathTable(view, values, spectral=spectral) for values in (spectrum, spectrum / attenuation)
        )  # fmt: skip
        found = (through(before) - through(np.maximum(after, 0))) / slope[..., None]
        near = inner(before) * np.where(np.isfinite(length), length, 0)[..., None]
        density = sum(weight * density_of(term, half) for weight, term in parts)
        total += (np.where(flat[..., None], near, found) * (density * rays)[..., None]).astype(np.float32)
    return total
