"""Snell's law with vectors: rays that cross a plane or leave a sphere. Lengths [m]; NaN where a ray does not pass."""

import numpy as np

Rays = tuple[np.ndarray, np.ndarray]
"""Origins (..., 3) [m] and unit directions (..., 3)."""


def dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the scalar product over the last axis, kept as (..., 1)."""
    return np.sum(a * b, axis=-1, keepdims=True)


def _root(squared: np.ndarray) -> np.ndarray:
    """Return the square root, NaN below 0."""
    return np.sqrt(np.where(squared >= 0, squared, np.nan))


def refract(directions: np.ndarray, normals: np.ndarray, *, n_from: float, n_to: float) -> np.ndarray:
    """Return unit directions (..., 3) behind a surface; NaN under total reflection.

    `directions`, `normals` (..., 3): unit vectors that broadcast; a normal may point to either side.
    Indices `n_from`, `n_to` of the two media [1].
    Source: n_from (d - (d.N) N) = n_to (t - (t.N) N), the tangential part of the phase gradient is continuous.
    Valid: isotropic media without absorption over one wavelength.
    """
    directions, normals = np.asarray(directions, float), np.asarray(normals, float)
    cosine = dot(directions, normals)
    # from the tangential part, not from 1 - cos^2, which loses half the digits near the normal
    tangential = (n_from / n_to) * (directions - cosine * normals)
    return tangential + np.where(cosine < 0, -1.0, 1.0) * _root(1 - dot(tangential, tangential)) * normals


def is_totally_reflected(directions: np.ndarray, normals: np.ndarray, *, n_from: float, n_to: float) -> np.ndarray:
    """Return True (...) where nothing is refracted; same arguments as `refract`. False for NaN directions."""
    directions, normals = np.asarray(directions, float), np.asarray(normals, float)
    tangential = (n_from / n_to) * (directions - dot(directions, normals) * normals)
    return dot(tangential, tangential)[..., 0] > 1


def _ahead(distance_m: np.ndarray, *, size_m: float) -> np.ndarray:
    """Return distances, NaN behind the origin; an origin on the surface may be beyond it by rounding."""
    distance = np.where(np.abs(distance_m) <= 1e-12 * size_m, 0.0, distance_m)
    return np.where(distance >= 0, distance, np.nan)


def cross_plane(rays: Rays, *, normal: np.ndarray, offset_m: float, n_from: float, n_to: float) -> Rays:
    """Return where rays meet the plane normal . x = offset_m, and their directions behind it.

    `normal` (3,): unit vector. NaN for rays that run away from the plane or along it, or are totally reflected.
    """
    origins, directions = rays
    slope = dot(directions, normal)
    ahead = (offset_m - dot(origins, normal)) / np.where(slope == 0, np.nan, slope)
    met = origins + _ahead(ahead, size_m=abs(offset_m)) * directions
    behind = refract(directions, normal, n_from=n_from, n_to=n_to)
    return _both_or_neither(met, behind)


def leave_sphere(rays: Rays, *, centre_m: np.ndarray, radius_m: float, n_from: float, n_to: float) -> Rays:
    """Return where rays that start inside or on a sphere leave it, and their directions outside.

    `centre_m` (3,) [m]. NaN for rays that start ahead of the sphere's far side or miss it, or are totally reflected.
    """
    origins, directions = rays
    from_centre = origins - centre_m
    along = dot(from_centre, directions)
    nearest = from_centre - along * directions
    ahead = _root(radius_m**2 - dot(nearest, nearest)) - along
    met = origins + _ahead(ahead, size_m=radius_m) * directions
    outside = refract(directions, (met - centre_m) / radius_m, n_from=n_from, n_to=n_to)
    return _both_or_neither(met, outside)


def _both_or_neither(origins: np.ndarray, directions: np.ndarray) -> Rays:
    passes = np.all(np.isfinite(origins) & np.isfinite(directions), axis=-1, keepdims=True)
    return np.where(passes, origins, np.nan), np.where(passes, directions, np.nan)
