"""Make one frame of a scene: render it, expose the sensor, describe it."""

from collections.abc import Callable
from dataclasses import asdict

import numpy as np

from uwsim import seeds
from uwsim.camera import sensor, sensor_record
from uwsim.camera.lens import port_record
from uwsim.dataset.frame import FORMAT_VERSION
from uwsim.dataset.info import FrameInfo
from uwsim.optics import phase
from uwsim.optics.spectrum import WAVELENGTHS_NM
from uwsim.render import smooth, stopping
from uwsim.render.checkpoint import Checkpoint
from uwsim.render.frame import Rendered, render_frame
from uwsim.scene import truth
from uwsim.scene.bodies import MarineSnow, numbered
from uwsim.scene.models import Scene
from uwsim.scene.sensor import AutoTime

_NOTHING_MORE = smooth.Options()
_POSES = 17  # poses stored per frame in motion, both ends and the middle included


def make_frame(
    scene: Scene, *, name: str, group: str, seed: int, frame: int, samples_per_pixel: int | None = None,
    batches: int | None = None, until: stopping.Until | None = None, checkpoint: Checkpoint | None = None,
    progress: Callable[[str, int, int], None] | None = None, options: smooth.Options = _NOTHING_MORE,
    moment: dict | None = None,
) -> dict:  # fmt: skip
    """Return one frame as the keywords of `write_frame`.

    `image` (H, W, 3) uint8, `raw` (uint16 or None), `buffers` (truth images by name), `info` (the description).
    (seed, frame) name the random streams, so that a frame can be made again alone.
    Given are `samples_per_pixel` in equal `batches`, or `until`; see `render.rounds` for `checkpoint`, `render.smooth`
    for `options`. `moment`: the keys of frame.json on sequence and rig (`recipe.Drawn`).
    """
    if options.denoise:
        smooth.require_denoiser()
    until = stopping.until(samples_per_pixel, batches, until)
    truth.sensor_constants(scene)  # first: it may refuse the scene
    rendered = render_frame(
        scene, until=until, seed=seed, frame=frame, checkpoint=checkpoint, progress=progress, options=options
    )
    noise_seed = seeds.integer(seed, frame, "sensor")
    exposed, reached = _exposed(scene, rendered)
    constants = truth.sensor_constants(exposed)
    # Monte-Carlo radiance is >= 0 by construction: every estimate is a sum of non-negative terms
    image, raw = _pictures(rendered.buffers["radiance"], constants, noise_seed=noise_seed, raw=scene.sensor.raw)
    info = _describe(
        exposed, rendered, _sensor(exposed, constants, noise_seed=noise_seed, reached=reached),
        name=name, group=group, seed=seed, frame=frame, **_noise(rendered, until), options=_options(rendered, options),
        **(moment or {}),
    )  # fmt: skip
    return {"image": image, "raw": raw, "buffers": rendered.buffers, "info": info}


def _noise(rendered: Rendered, until: stopping.Until) -> dict:
    """Return the entries of frame.json on samples and Monte-Carlo noise."""
    pictures = {
        name: {
            "batches": ended.noise.batches,
            "samples_per_pixel": ended.samples_per_pixel,
            "ended_by": ended.by,
            "region_error_p95": ended.noise.region_error_p95,
            "region_rule_met": None if until.region is None else ended.noise.region_rule_met(until.region),
            "pixel_ratio_p95": ended.noise.pixel_ratio_p95,
            "pixel_share_within": ended.noise.pixel_share_within,
            "pixel_rule_met": ended.noise.pixel_rule_met if until.pixels else None,
        }
        for name, ended in rendered.ended.items()
    }
    met = not any(False in (entry["pixel_rule_met"], entry["region_rule_met"]) for entry in pictures.values())
    radiance = pictures["radiance"]
    return {
        "samples_per_pixel": radiance["samples_per_pixel"],
        "batches": radiance["batches"],
        "noise": {"region_rule": until.region, "met": met, "pictures": pictures},
    }


def _options(rendered: Rendered, options: smooth.Options) -> dict:
    """Return the entry of frame.json on what the frame has on request."""
    if not options.denoise:
        return {"orders": options.orders}
    biases = {name: ended.bias for name, ended in rendered.ended.items() if ended.bias}
    return {
        "orders": options.orders,
        "denoiser": smooth.denoiser_name(),
        "denoised_layers": tuple(biases["radiance"]),
        "bias": {name: {layer: asdict(bias) for layer, bias in layers.items()} for name, layers in biases.items()},
    }


def _exposed(scene: Scene, rendered: Rendered) -> tuple[Scene, float | None]:
    """Return the scene with the exposure found, and the brightness that auto-exposure reaches (None without)."""
    if rendered.blur is not None and isinstance(scene.exposure.auto, AutoTime):
        raise ValueError("exposure.auto.adjust = 'time' with something in motion, allowed: 'gain'")
    return truth.auto_exposed(scene, rendered.buffers["radiance"])


def _pictures(radiance: np.ndarray, constants: dict, *, noise_seed: int, raw: bool) -> tuple:
    """Return the picture (H, W, 3) uint8, and the raw picture if asked for, else None."""
    rng = np.random.default_rng(noise_seed)
    if not raw:
        return sensor.expose(radiance, rng=rng, **constants), None
    dn = sensor.raw_dn(radiance, rng=rng, **constants)
    return sensor.picture_from_dn(dn, **constants), dn


def _sensor(scene: Scene, constants: dict, *, noise_seed: int, reached: float | None) -> dict:
    chosen, auto = scene.sensor, scene.exposure.auto
    return sensor_record.record(constants) | {
        "exposure_time_s": scene.exposure.time_s,
        "f_number": scene.exposure.f_number,
        "seed": noise_seed,
        "vignetting": chosen.vignetting and chosen.vignetting.model_dump(),
        "raw": chosen.raw,
        "auto": auto and auto.model_dump(include={"adjust", "target", "percentile"}) | {"reached": reached},
    }


def _describe(scene: Scene, rendered: Rendered, sensor_entry: dict, **identity) -> FrameInfo:
    world_from_camera, camera = scene.rig.world_from_rig, _camera(scene, rendered)
    return FrameInfo.model_validate(
        {
            "format": FORMAT_VERSION,
            "scene": scene.name,
            **identity,
            "camera": camera,
            "sensor": sensor_entry,
            "lamps": [_lamp(lamp, world_from_camera, n_water=scene.water.refractive_index) for lamp in scene.rig.lamps],
            "water": _water(scene),
            "added_water": [added.model_dump(mode="json") for added in scene.added_water],
            "daylight": scene.daylight and _daylight(scene.daylight, n_water=scene.water.refractive_index),
            "bodies": [_body(body, instance, camera["times_s"]) for instance, body in numbered(scene.bodies)],
            "particles": [body.model_dump(mode="json") for body in scene.bodies if isinstance(body, MarineSnow)],
            "sub_frames": rendered.sub_frames,
            "markers": truth.marker_corners(scene, range_m=rendered.buffers["range"]),
            "points": truth.marker_points(scene, range_m=rendered.buffers["range"]),
            "blur": rendered.blur,
        }
    )


def _body(body, instance: int, times_s: list[float]) -> dict:
    path = body.poses_at(np.array(times_s)).tolist() if body.moves else None
    return {
        "name": body.name, "kind": body.kind, "instance": instance, "world_from_body": body.world_from_body.tolist(),
        "world_from_body_through_exposure": path,
    }  # fmt: skip


def _camera(scene: Scene, rendered: Rendered) -> dict:
    half = scene.shutter.span_s / 2
    moving = len(rendered.world_from_camera) > 1 or rendered.blur is not None
    times_s = np.linspace(-half, half, _POSES) if moving else np.zeros(1)
    if moving and scene.rig.trajectory is not None:
        times_s = np.union1d(times_s, [time for time in scene.rig.trajectory.times_s if abs(time) < half])
    camera = scene.rig.camera
    return {
        "width_px": camera.width_px,
        "height_px": camera.height_px,
        "K": camera.K.tolist(),
        "response": camera.response,
        "world_from_camera": scene.rig.world_from_rig.tolist(),
        "times_s": times_s.tolist(),
        "world_from_camera_through_exposure": scene.rig.poses_at(times_s).tolist(),
        "readout_s": scene.exposure.readout_s,
        "distortion": camera.distortion,
        "port": port_record(scene.lens.port),
        "housing": camera.housing and camera.housing.model_dump(),
    }


def _lamp(lamp, world_from_rig: np.ndarray, *, n_water: float) -> dict:
    pose = world_from_rig @ lamp.rig_from_lamp
    entry = {
        "name": lamp.name,
        "position_m": pose[:3, 3].tolist(),
        "direction": pose[:3, 2].tolist(),
        "radiant_intensity_w_per_sr": lamp.intensity_w_per_sr,
        "spectrum": lamp.spectrum if isinstance(lamp.spectrum, str) else "table",
        "relative_spectrum_per_nm": lamp.relative_spectrum.tolist(),
        "half_angle_deg": lamp.half_angle_deg,
        "beam_angles_deg": lamp.beam and lamp.beam.angles_deg,
        "beam_values": lamp.beam and lamp.beam.values,
        "world_from_lamp": pose.tolist(),
        "world_from_leds": lamp.array and (pose @ lamp.lamp_from_led).tolist(),
        "die_radius_m": lamp.die_radius_m,
        "window": lamp.window and lamp.window.model_dump() | {"n_water": n_water},
        "housing": lamp.housing and lamp.housing.model_dump(),
    }
    if lamp.ies is not None:
        keys = ("beam_azimuths_deg", "beam_angles_deg", "beam_table")
        entry |= {key: values.tolist() for key, values in zip(keys, lamp.ies_table, strict=True)}
    return entry


def _daylight(daylight, *, n_water: float) -> dict:
    return daylight.model_dump(exclude={"spectrum"}) | {
        "spectrum": daylight.spectrum if isinstance(daylight.spectrum, str) else "table",
        "relative_spectrum_per_nm": daylight.relative_spectrum.tolist(),
        "refractive_index": n_water,
    }


def _water(scene: Scene) -> dict:
    water = scene.water.optical()
    return {
        "name": water.name,
        "wavelengths_nm": WAVELENGTHS_NM.tolist(),
        "absorption_per_m": water.absorption.tolist(),
        "scattering_per_m": water.scattering.tolist(),
        "phase_function": phase.describe(water.phase),
        "bands": truth.water_bands(scene),
    }
