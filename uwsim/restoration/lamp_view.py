"""What the lamps do to a white surface where the bodies are, from what a robot knows of itself and of its water."""

from typing import NamedTuple

import numpy as np

from uwsim.camera.lens import pixel_centres
from uwsim.formation import records
from uwsim.formation.direct import water_free
from uwsim.formation.models import jaffe_mcglamery
from uwsim.formation.spread import Spread, spread
from uwsim.formation.surface import Surface
from uwsim.formation.view import View, pixel_angle_rad
from uwsim.optics.sources import camera_response
from uwsim.optics.spectrum import WAVELENGTHS_NM


class LampLight(NamedTuple):
    """Layers of a white surface that faces the camera at every pixel, (H, W, 3) float32 in the units of the image.

    `direct`: unscattered on its way to the camera. `scattered`: what arrives scattered forwards, not yet spread by
    `spread.blur`. `backscatter`: of the water. `water_free`: the surface under the same lamps without water.
    `direct`, `scattered` and `water_free` are 0 where no body is seen.
    """

    direct: np.ndarray
    scattered: np.ndarray
    backscatter: np.ndarray
    water_free: np.ndarray
    spread: Spread


def lamp_light(range_m: np.ndarray, rig: dict) -> LampLight:
    """Return the light of a robot's lamps for a range map (H, W) [m], +inf where no body is seen.

    `rig` as `uwsim.bench.restoration` describes it. Raises ValueError for a map of another size than the camera's, one
    with NaN or values not above 0, and for a rig without lamps.
    Source: `formation.models.jaffe_mcglamery` (dissertation eqs. 2.29-2.36, corrected).
    Valid: light of these lamps alone. A white surface that faces the camera stands for the body: its cosine of
    incidence is part of what is restored; with several lamps their shares on a slanted body are then a little off.
    """
    view = white_view(range_m, rig)
    rule = spread(view, spectral=True)
    surface = Surface(rule, scattered=True)
    scale = np.asarray(rig["linear_per_radiance"], np.float32)

    def lit(camera: str) -> np.ndarray:
        return scale * (surface.reflected("unscattered", camera) + surface.reflected("scattered", camera))

    return LampLight(
        direct=lit("unscattered"),
        scattered=lit("scattered"),
        backscatter=scale * jaffe_mcglamery.backscatter(view, rule),
        water_free=scale * water_free(view),
        spread=rule,
    )


def white_view(range_m: np.ndarray, rig: dict) -> View:
    """Return the view of a white surface that faces the camera, in the camera's frame; errors as `lamp_light`."""
    size = (rig["height_px"], rig["width_px"])
    path = np.asarray(range_m, np.float32)
    if path.shape != size or not np.all(path > 0):
        raise ValueError(f"lamp light: range_m {path.shape}, least {np.min(path):g}, allowed: {size}, > 0 or +inf")
    if not rig["lamps"]:
        raise ValueError("lamp light: the rig has no lamp, allowed: at least one")
    lens, pixels = rig["lens"], pixel_centres(width_px=size[1], height_px=size[0])
    origins, directions = lens.rays(pixels)
    seen = np.isfinite(path) & np.all(np.isfinite(directions), axis=-1)
    return View(
        origins_m=origins,
        directions=directions,
        range_m=path,
        normals=np.where(seen[..., None], -directions, 0).astype(np.float32),
        albedo=np.ones((*size, 1), np.float32),
        albedo_spectra=np.ones((1, len(WAVELENGTHS_NM))),
        water=records.water(rig["water"]),
        lamps=tuple(led for lamp in rig["lamps"] for led in records.leds(lamp)),
        response=camera_response(rig["response"]),
        factor=np.ones(size),
        pixel_angle_rad=pixel_angle_rad(lens, width_px=size[1], height_px=size[0]),
    )
