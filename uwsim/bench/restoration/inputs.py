"""What methods that restore pictures may ask for in NEEDS; `uwsim.bench.restoration` says what each input is."""

from functools import partial

import numpy as np

from uwsim.bench import runner
from uwsim.bench.task import lens_of, linear_buffer, pinhole_K, sensor_keywords
from uwsim.camera.lens import pixel_centres
from uwsim.camera.sensor import Constants, linear_from_radiance, noise_std_radiance
from uwsim.dataset.frame import Frame
from uwsim.images import linear_from_srgb_uint8

SMOOTH_PX = 15  # against the noise of the truth's own rendering
_WATER_KNOWN = ("name", "wavelengths_nm", "absorption_per_m", "scattering_per_m", "phase_function")
_LAMP_POSES = ("world_from_lamp", "world_from_leds")


def makers(frame: Frame) -> runner.Makers:
    """Return what makes each input, called when a method asks for it; NotInFrame for a rig without a lamp."""
    return {
        "range_m": partial(frame.buffer, "range"),
        "z_depth_m": partial(frame.buffer, "z_depth"),
        "water": partial(_water, frame),
        "lamps": partial(_lamps, frame),
        "camera": partial(_camera, frame),
        "rig": partial(_rig, frame),
        "backscatter": partial(linear_buffer, frame, "backscatter"),
        "transmission": partial(frame.buffer, "transmission"),
        "forward_scatter": partial(linear_buffer, frame, "forward_scatter"),
        "direct_gain": partial(_direct_gain, frame),
        "noise_std": partial(_noise_std, frame),
    }


def _water(frame: Frame) -> dict[str, np.ndarray]:
    bands = frame.info.water.bands
    return {
        "absorption_per_m": np.array(bands.absorption_per_m),
        "scattering_per_m": np.array(bands.scattering_per_m),
        "attenuation_per_m": np.array(bands.attenuation_per_m),
    }


def _lamps(frame: Frame) -> list[dict]:
    camera_from_world = np.linalg.inv(frame.world_from_camera)
    turn, shift = camera_from_world[:3, :3], camera_from_world[:3, 3]
    return [
        {
            **lamp.model_dump(),
            "position_m": turn @ np.array(lamp.position_m) + shift,
            "direction": turn @ np.array(lamp.direction),
        }
        for lamp in frame.info.lamps
    ]


def _camera(frame: Frame) -> dict:
    camera = frame.info.camera
    return {
        "K": pinhole_K(lens_of(frame)), "width_px": camera.width_px, "height_px": camera.height_px,
        "linear_per_radiance": _linear_per_radiance(frame),
    }  # fmt: skip


def _linear_per_radiance(frame: Frame) -> np.ndarray:
    camera, lens = frame.info.camera, lens_of(frame)
    linear = Constants(**sensor_keywords(frame)).linear_per_radiance
    if lens.port is None:
        return linear
    centres = pixel_centres(width_px=camera.width_px, height_px=camera.height_px)
    # pixels that no ray through the port reaches are black
    return linear * np.nan_to_num(lens.radiance_factor(centres))[..., None]


def _rig(frame: Frame) -> dict:
    info, sensor = frame.info, Constants(**sensor_keywords(frame))
    if not info.lamps:
        raise runner.NotInFrame("no lamp in the frame, so no rig")
    return {
        "lens": lens_of(frame), "width_px": info.camera.width_px, "height_px": info.camera.height_px,
        "response": info.camera.response, "linear_per_radiance": _linear_per_radiance(frame),
        "lamps": [_in_camera_frame(lamp.model_dump(), np.linalg.inv(frame.world_from_camera)) for lamp in info.lamps],
        "water": info.water.model_dump(include=set(_WATER_KNOWN)),
        "noise": {
            "electrons": sensor.white_e / np.asarray(sensor.white_balance),
            "dark_variance_e2": sensor.dark_variance_e2,
        },
    }  # fmt: skip


def _in_camera_frame(lamp: dict, camera_from_world: np.ndarray) -> dict:
    """Return a lamp of frame.json with the camera's frame as its world: a method is not told where the camera is."""
    turn, shift = camera_from_world[:3, :3], camera_from_world[:3, 3]
    moved = {key: camera_from_world @ np.array(lamp[key]) for key in _LAMP_POSES if lamp.get(key) is not None}
    place = {"position_m": turn @ np.array(lamp["position_m"]) + shift, "direction": turn @ np.array(lamp["direction"])}
    return {**lamp, **moved, **place}


def _direct_gain(frame: Frame) -> np.ndarray:
    direct, water_free = (_smooth(frame.buffer(name)) for name in ("direct", "water_free"))
    return np.divide(direct, water_free, out=np.zeros_like(direct), where=water_free > 0)


def _noise_std(frame: Frame) -> np.ndarray:
    sensor = sensor_keywords(frame)
    by_sensor = linear_from_radiance(noise_std_radiance(frame.buffer("radiance"), **sensor), **sensor)
    # estimated from a few batches, and larger where a pixel happens to be bright; denoised layers are what they are
    noisy = not frame.info.options.denoised_layers
    by_rendering = _smooth(np.square(linear_buffer(frame, "standard_error"))) if noisy else 0.0
    level = np.gradient(linear_from_srgb_uint8(np.arange(256, dtype=np.uint8)))
    return np.sqrt(np.square(by_sensor) + by_rendering + np.square(level[frame.image]) / 12)


def _smooth(image: np.ndarray) -> np.ndarray:
    import cv2

    return cv2.blur(image, (SMOOTH_PX, SMOOTH_PX), borderType=cv2.BORDER_REFLECT)
