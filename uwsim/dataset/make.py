"""Make one frame of a scene: render it, expose the sensor, describe it."""

from collections.abc import Callable

import numpy as np

from uwsim import seeds
from uwsim.camera import sensor
from uwsim.dataset.frame import FORMAT_VERSION, FrameInfo
from uwsim.optics.spectrum import WAVELENGTHS_NM
from uwsim.render.frame import Rendered, render_frame
from uwsim.scene import truth
from uwsim.scene.models import Scene

_POSES = 17  # poses stored per frame in motion, both ends and the middle included


def make_frame(
    scene: Scene, *, name: str, group: str, seed: int, frame: int, samples_per_pixel: int, batches: int,
    progress: Callable[[str, int, int], None] | None = None,
) -> tuple[np.ndarray, dict[str, np.ndarray], FrameInfo]:  # fmt: skip
    """Return image (H, W, 3) uint8, truth images by name, and the description of one frame.

    (seed, frame) name the random streams, so that a frame can be made again alone.
    """
    constants = truth.sensor_constants(scene)  # first: it may refuse the scene
    rendered = render_frame(
        scene, samples_per_pixel=samples_per_pixel, batches=batches, seed=seed, frame=frame, progress=progress
    )
    noise_seed = seeds.integer(seed, frame, "sensor")
    # Monte-Carlo radiance is >= 0 by construction: every estimate is a sum of non-negative terms
    image = sensor.expose(rendered.buffers["radiance"], rng=np.random.default_rng(noise_seed), **constants)
    info = _describe(
        scene, rendered, constants, noise_seed,
        name=name, group=group, seed=seed, frame=frame, samples_per_pixel=samples_per_pixel, batches=batches,
    )  # fmt: skip
    return image, rendered.buffers, info


def _describe(scene: Scene, rendered: Rendered, constants: dict, noise_seed: int, **identity) -> FrameInfo:
    world_from_camera = scene.rig.world_from_rig
    exposure = {"exposure_time_s": scene.exposure.time_s, "f_number": scene.exposure.f_number, "seed": noise_seed}
    return FrameInfo.model_validate(
        {
            "format": FORMAT_VERSION,
            "scene": scene.name,
            **identity,
            "camera": _camera(scene, rendered),
            "sensor": exposure | {key: np.asarray(value).tolist() for key, value in constants.items()},
            "lamps": [_lamp(lamp, world_from_camera) for lamp in scene.rig.lamps],
            "water": _water(scene),
            "bodies": [
                {"name": b.name, "kind": b.kind, "instance": i, "world_from_body": b.world_from_body.tolist()}
                for i, b in enumerate(scene.bodies, start=1)
            ],
            "markers": truth.marker_corners(
                scene, world_from_camera=world_from_camera, range_m=rendered.buffers["range"]
            ),
            "blur": rendered.blur,
        }
    )


def _camera(scene: Scene, rendered: Rendered) -> dict:
    from uwsim.render.build import rig_poses

    half = scene.exposure.time_s / 2
    moving = len(rendered.world_from_camera) > 1 or rendered.blur is not None
    times_s = np.linspace(-half, half, _POSES) if moving else np.zeros(1)
    camera = scene.rig.camera
    return {
        "width_px": camera.width_px,
        "height_px": camera.height_px,
        "K": camera.K.tolist(),
        "response": camera.response,
        "world_from_camera": scene.rig.world_from_rig.tolist(),
        "times_s": times_s.tolist(),
        "world_from_camera_through_exposure": rig_poses(scene, times_s).tolist(),
    }


def _lamp(lamp, world_from_rig: np.ndarray) -> dict:
    pose = world_from_rig @ lamp.rig_from_lamp
    return {
        "name": lamp.name,
        "position_m": pose[:3, 3].tolist(),
        "direction": pose[:3, 2].tolist(),
        "radiant_intensity_w_per_sr": lamp.intensity_w_per_sr,
        "spectrum": lamp.spectrum if isinstance(lamp.spectrum, str) else "table",
        "relative_spectrum_per_nm": lamp.relative_spectrum.tolist(),
        "half_angle_deg": lamp.half_angle_deg,
        "beam_angles_deg": lamp.beam and lamp.beam.angles_deg,
        "beam_values": lamp.beam and lamp.beam.values,
    }


def _water(scene: Scene) -> dict:
    water = scene.water.optical()
    return {
        "name": water.name,
        "wavelengths_nm": WAVELENGTHS_NM.tolist(),
        "absorption_per_m": water.absorption.tolist(),
        "scattering_per_m": water.scattering.tolist(),
        "phase_function": {
            "type": "hg_mixture",
            "g": water.phase.g.tolist(),
            "weights": np.round(water.phase.weights, 9).tolist(),
        },
        "bands": truth.water_bands(scene),
    }
