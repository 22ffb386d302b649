"""Refuse to render when the water does not act: exp(-c r) on a white target must come out.

Three mistakes make clear water without a warning: a sensor without its medium, a medium on the wrong side of a port, an
integrator that ignores the medium around the sensor. This check goes through the same building of the scene, the
same medium, integrator and film as the image.
"""

import dataclasses

import numpy as np

from uwsim.camera import pose
from uwsim.optics.spectrum import WAVELENGTHS_NM, band_mean
from uwsim.optics.water import Water
from uwsim.render import film, transport
from uwsim.render.build import build
from uwsim.scene.bodies import Rectangle
from uwsim.scene.camera import Camera
from uwsim.scene.lamp import Lamp
from uwsim.scene.models import Scene

_SIZE_PX = 8
_SAMPLES = 512
_TOLERANCE = 0.01  # model tolerance: float32 transport, the narrow view


def check_medium(scene: Scene, *, seed: int) -> None:
    """Raise ValueError unless a white target lit by a lamp at the camera is dimmed by exp(-2 c r), in every band.

    All attenuation is made absorption for the check, so that the exponential is exact. The distance is where the
    average over the bands keeps about half of its light.
    """
    water = scene.water.optical()
    if not np.any(water.attenuation > 0):
        return
    view = film.view_of(scene)
    distance_m = 0.35 / max(float(np.mean(band_mean(water.attenuation, view.response))), 1e-3)
    target = _target_scene(scene, distance_m)
    measured, error = _measured(target, water, seed=seed)
    expected = _expected(view, water, target.rig.lamps[0].relative_spectrum, distance_m)
    allowed = _TOLERANCE * expected + 5 * error
    if not np.all(np.abs(measured - expected) <= allowed):
        raise ValueError(
            f"self-check: a white target at {distance_m:.3g} m in {water.name} sends back {_text(measured)} of the "
            f"light (R, G, B), allowed: exp(-2 c r), band means {_text(expected)} +- {_text(allowed)}; "
            "the image would be wrong and is refused"
        )


def _target_scene(scene: Scene, distance_m: float) -> Scene:
    """Return a white target and a lamp at the camera in place of all that was there; radiance 1 without water."""
    world_from_rig = scene.rig.world_from_rig
    # a narrow view, so that all rays have the same length to 1e-5
    camera = Camera(width_px=_SIZE_PX, height_px=_SIZE_PX, K_px=(1e3, 1e3, _SIZE_PX / 2, _SIZE_PX / 2),
                    response=scene.rig.camera.response)  # fmt: skip
    light = scene.rig.lamps[0] if scene.rig.lamps else scene.daylight
    lamp = Lamp(
        position_m=(0.0, 0.0, 0.0), look_at_m=(0.0, 0.0, 1.0), half_angle_deg=60.0,
        radiant_intensity_w_per_sr=np.pi * distance_m**2, spectrum=light.spectrum,
    )  # fmt: skip
    rectangle = Rectangle(
        name="target", kind="rectangle", width_m=distance_m, height_m=distance_m, reflectance=1.0,
        position_m=tuple(pose.apply(world_from_rig, np.array([0, 0, distance_m])).tolist()),
        towards_m=tuple(world_from_rig[:3, 3].tolist()),
    )  # fmt: skip
    rig = scene.rig.model_copy(update={"camera": camera, "lamps": (lamp,), "motion": None})
    nothing_more = {"daylight": None, "added_water": ()}
    return scene.model_copy(update={"rig": rig, "bodies": (rectangle,)} | nothing_more)


def _measured(target: Scene, water: Water, *, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the mean band radiance (3,) of the target in water that only absorbs, and its standard error."""
    absorbing = dataclasses.replace(
        water, name=f"{water.name} (check)", absorption=water.attenuation, scattering=np.zeros_like(water.scattering)
    )
    built = build(target, water=absorbing, rig_poses=target.rig.world_from_rig[None])
    found = transport.layers(built, film.view_of(target), samples_per_pixel=_SAMPLES, batches=2, seed=seed)
    pixels = found["radiance"].reshape(-1, film.BANDS).astype(float)
    return pixels.mean(axis=0), pixels.std(axis=0, ddof=1) / np.sqrt(len(pixels))


def _expected(view, water: Water, lamp_per_nm: np.ndarray, distance_m: float) -> np.ndarray:
    """Return band means (3,) of lamp x exp(-2 c r), all interpolated linearly in their tables."""
    fine = np.arange(WAVELENGTHS_NM[0], WAVELENGTHS_NM[-1] + 0.01, 0.25)

    def interpolated(values):
        return np.interp(fine, WAVELENGTHS_NM, values)

    light = interpolated(lamp_per_nm) * np.exp(-2 * distance_m * interpolated(water.attenuation))
    bands = [interpolated(band) for band in view.response.T]
    return np.array([np.trapezoid(light * band, fine) / np.trapezoid(band, fine) for band in bands])


def _text(values: np.ndarray) -> str:
    return "/".join(f"{value:.3g}" for value in values)
