"""Light of lamps that the bodies of a view reflect, scattered nowhere on its way; and the picture without water."""

from typing import NamedTuple

import numpy as np

from uwsim.formation.bands import PathTable
from uwsim.formation.view import View


class SurfaceLight(NamedTuple):
    """Light of a lamp on the bodies seen (H, W): irradiance of the surface per intensity on the lamp's axis, without
    attenuation [1/m^2], and the path in the water from lamp to body [m]; 0 where no body is seen."""

    irradiance_per_intensity: np.ndarray
    path_m: np.ndarray


def on_surface(view: View, index: int, *, cosine: bool = True) -> SurfaceLight:
    """Return the light of the view's lamp `index` on what each pixel sees.

    `cosine` False: on a surface normal to the ray (dissertation eqs. 2.41, 2.49 as printed).
    Source: dissertation eq. 2.31, I cos(gamma) / R_s^2. Errata: its B is an intensity, not an irradiance.
    """
    came = view.lamps[index].arriving(view.points_m)
    received = came.irradiance_per_intensity
    if cosine:
        received = received * np.maximum(np.einsum("hwk,hwk->hw", view.normals, came.towards), 0)
    if view.visibility is not None:
        received = received * view.visibility[..., index]
    seen = view.has_body
    return SurfaceLight(
        np.where(seen, received, 0).astype(np.float32), np.where(seen, came.path_m, 0).astype(np.float32)
    )


def seen_range_m(view: View) -> np.ndarray:
    """Return the range of what is seen, (H, W) float32; 0 where no body is."""
    return np.where(view.has_body, view.range_m, 0).astype(np.float32)


def direct(view: View, *, spectral: bool = True, cosine: bool = True) -> np.ndarray:
    """Return the lamps' light by way of the bodies seen, unscattered, (H, W, 3) float32: radiance in the water.

    L = albedo / pi I cos(gamma) / r^2 exp(-c (path + range)), summed over lamps; not yet times `view.factor`. What the
    renderer calls `direct_unscattered`, for lamps. `cosine` as in `on_surface`.
    Source: dissertation eqs. 2.30, 2.31, 2.52 as radiance. Valid: Lambertian bodies, each lit by the lamps alone.
    """
    range_m = seen_range_m(view)
    lights = [on_surface(view, index, cosine=cosine) for index in range(len(view.lamps))]
    ways = [(light.irradiance_per_intensity, light.path_m + range_m) for light in lights]
    return _reflected(view, ways, spectral=spectral)


def water_free(view: View) -> np.ndarray:
    """Return `direct` as it would be in water that neither absorbs nor scatters, (H, W, 3) float32."""
    return reflected(view, np.zeros(view.shape, np.float32))


def reflected(view: View, path_m: np.ndarray, *, spectral: bool = True) -> np.ndarray:
    """Return the lamps' light by way of the bodies seen after a path (H, W) in the water in place of its own."""
    path = path_m.astype(np.float32)
    ways = [(on_surface(view, index).irradiance_per_intensity, path) for index in range(len(view.lamps))]
    return _reflected(view, ways, spectral=spectral)


def _reflected(view: View, ways: list[tuple[np.ndarray, np.ndarray]], *, spectral: bool) -> np.ndarray:
    """Return what bodies send back of each lamp's (irradiance per intensity, path in the water), (H, W, 3) float32."""
    total = np.zeros((*view.shape, 3), np.float32)
    for (received, path), lamp in zip(ways, view.lamps, strict=True):
        for albedo, spectrum in zip(np.moveaxis(view.albedo, -1, 0), view.albedo_spectra, strict=True):
            found = PathTable(view, np.stack([lamp.spectrum, spectrum]), spectral=spectral)(path)
            found *= (received * albedo.astype(np.float32) * np.float32(1 / np.pi))[..., None]
            total += found
    return total


def in_camera(view: View, **layers: np.ndarray) -> dict[str, np.ndarray]:
    """Return layers of radiance in the water as those in the camera, and `radiance`, their sum; (H, W, 3) float32."""
    factor = view.factor.astype(np.float32)[..., None]
    found = {name: layer * factor for name, layer in layers.items()}
    return found | {"radiance": sum(found.values())}


def require_no_daylight(view: View, model: str) -> None:
    """Raise ValueError for a view with daylight, which the model does not know."""
    if view.daylight is not None:
        raise ValueError(f"{model}: the view has daylight, allowed: none (use simplified or multistage)")
