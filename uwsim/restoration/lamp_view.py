"""What the lamps do to a white surface and to the water before it, from what a robot knows of itself and its water."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from uwsim.camera.lens import pixel_centres
from uwsim.formation import records
from uwsim.formation.bands import fine
from uwsim.formation.direct import direct, water_free
from uwsim.formation.models import jaffe_mcglamery
from uwsim.formation.spread import Spread, spread
from uwsim.formation.surface import Surface
from uwsim.formation.view import View, pixel_angle_rad
from uwsim.optics.sources import camera_response
from uwsim.optics.spectrum import WAVELENGTHS_NM
from uwsim.restoration import relief

EXCESS = 0.141
"""Of `excess`, dimensionless."""
# of what a surface that faces the camera, without shadows, would get: scattered light comes from all around
_LEAST_SCATTERED = 0.3
# what bodies lend each other, of the mean light on those about them
_BETWEEN_BODIES = 0.04
_ABOUT = 0.5  # of the picture's width


class LampLight(NamedTuple):
    """Light of a white surface at every pixel, (H, W, 3) float32 in the units of the image; 0 where no body is seen.

    `direct`: unscattered on its way to the camera, of it `unscattered` nowhere scattered. `scattered`: what arrives
    scattered forwards, not yet spread by `spread.blur`. `white`: both together, spread. `water_free`: the surface under
    the same lamps without water.
    """

    unscattered: np.ndarray
    direct: np.ndarray
    scattered: np.ndarray
    white: np.ndarray
    water_free: np.ndarray
    spread: Spread


def lamp_light(view: View, rig: dict, *, shaped: bool = False) -> LampLight:
    """Return the light of a robot's lamps in its `white_view`.

    `shaped`: surfaces face where the range map says and lie in each other's shadow (`relief`); else each faces the
    camera.
    Source: `formation.models.jaffe_mcglamery` (dissertation eqs. 2.29-2.36, corrected).
    Valid: light of these lamps alone. Two numbers are guesses that frames of tank_small bear out: light scattered on
    its way from the lamp is at least 0.3 of that on a surface which faces the camera, also in a shadow; bodies lend
    each other 4 % of the mean light about them.
    """
    plain = Surface(spread(view, spectral=True), scattered=True) if shaped else None
    view = _shaped(view, rig) if shaped else view
    rule = spread(view, spectral=True)
    surface, free = Surface(rule, scattered=True), water_free(view)
    scale = np.asarray(rig["linear_per_radiance"], np.float32)

    def lit(camera: str) -> np.ndarray:
        widened = surface.reflected("scattered", camera)
        if plain is not None:
            widened = np.maximum(widened, np.float32(_LEAST_SCATTERED) * plain.reflected("scattered", camera))
        return scale * (surface.reflected("unscattered", camera) + widened)

    straight, scattered = lit("unscattered"), lit("scattered")
    return LampLight(
        unscattered=scale * direct(view),
        direct=straight,
        scattered=scattered,
        white=straight + rule.blur(scattered),
        water_free=scale * (free + _lent(free, view.has_body) if shaped else free),
        spread=rule,
    )


def _shaped(view: View, rig: dict) -> View:
    leds = [len(records.leds(lamp)) for lamp in rig["lamps"]]
    places = np.array([lamp["position_m"] for lamp in rig["lamps"]], float)
    share = relief.visibility(view.points_m, view.has_body, lens=rig["lens"], lamps_m=places)
    return replace(
        view,
        normals=relief.normals(view.points_m, view.directions, view.has_body),
        visibility=np.repeat(share, leds, axis=-1),
    )


def _lent(free: np.ndarray, seen: np.ndarray) -> np.ndarray:
    """Return the light that bodies lend to a white one, (H, W, 3): of the lamps' own light on them without water."""
    import cv2

    side = (round(_ABOUT * seen.shape[1]), round(_ABOUT * seen.shape[1]))
    around = cv2.blur(free, side, borderType=cv2.BORDER_REFLECT)
    return np.where(seen[..., None], np.float32(_BETWEEN_BODIES) * around, 0)


def backscatter(view: View, rig: dict) -> np.ndarray:
    """Return the water's own light (H, W, 3) float32 in the units of the image, of a `white_view`.

    The model's, with the `excess` of light that is scattered by large angles more than once.
    """
    back = modelled_backscatter(view) * (1 + excess(view, rig))
    return (rig["linear_per_radiance"] * back).astype(np.float32)


def modelled_backscatter(view: View) -> np.ndarray:
    """Return the backscatter (H, W, 3) of the Jaffe-McGlamery model. [W m^-2 sr^-1 nm^-1]"""
    return jaffe_mcglamery.backscatter(view, spread(view, spectral=True))


def excess(view: View, rig: dict) -> np.ndarray:
    """Return how much more the water sends back than the model's light of one large angle says, (3,), as a share of it.

    0.141 b d^(3/4) R^(1/4), with the scattering b of the bands, the lamps' mean distance d from the camera and the
    median range R: within a picture it hardly varies. 0 where no body is seen.
    Source: our own fit to rendered frames, `benchmarks/fits/backscatter_excess.py` on the dataset `validity`.
    Valid: b 0.05-5.5 /m, d 0.1-0.6 m, R 0.3-3 m, Petzold's phase function; there within 0.021 rms, 0.095 at most.
    """
    seen = view.range_m[view.has_body]
    if not seen.size:
        return np.zeros(3)
    scattering = fine(view.water.scattering) @ view.band_light
    distance = np.mean([np.linalg.norm(lamp["position_m"]) for lamp in rig["lamps"]])
    return EXCESS * scattering * distance**0.75 * float(np.median(seen)) ** 0.25


def white_view(range_m: np.ndarray, rig: dict) -> View:
    """Return the view of a white surface that faces the camera for a range map (H, W) [m], +inf where no body is seen.

    In the camera's frame; `rig` as `uwsim.bench.restoration` describes it. Raises ValueError for a map of another size
    than the camera's, one with NaN or values not above 0, and for a rig without lamps.
    """
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
