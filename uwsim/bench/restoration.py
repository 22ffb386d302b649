"""Restoration: how near a method comes to the water-free twin of each still frame.

What NEEDS may list:
  range_m, z_depth_m    (H, W) [m], +inf where no body is seen
  water                 {"absorption_per_m", "scattering_per_m", "attenuation_per_m"}: (3,) per camera band
  lamps                 list of the `lamps` of frame.json, {"name", "position_m", "direction" (both in the camera's
                        frame), "radiant_intensity_w_per_sr", "spectrum", "half_angle_deg", "window", ...}
  camera                {"K", "width_px", "height_px", "linear_per_radiance": image units per radiance in the water,
                        (3,), or (H, W, 3) behind a port or where the lens vignettes}; K is that of a pinhole in the
                        water, behind a port that of the effective focal length (see `bench.task`)
  rig                   what a robot knows of itself and of its water, for the formation models, in the camera's frame:
                        {"lens": Lens, "width_px", "height_px", "response": name, "linear_per_radiance" as above,
                        "lamps": list as in frame.json, "water": as in frame.json (spectra, phase function), "noise":
                        {"electrons": photo-electrons that make 1 (3,), "dark_variance_e2"}}
  backscatter           (H, W, 3) in the linear units of the image, without noise
  transmission          (H, W, 3), 0 where no body is seen
  forward_scatter       (H, W, 3) as backscatter
  direct_gain           (H, W, 3), what the water leaves of the light straight from a body: direct / water_free, both
                        averaged over 15 px; unlike transmission it counts scattered illumination
  noise_std             (H, W, 3), standard deviation of the image in its linear units: sensor, 8 bits, and
                        Monte Carlo unless the frame was denoised
"""

from functools import partial
from types import ModuleType

import numpy as np

from uwsim.bench import runner
from uwsim.bench.task import Case, Task, camera_notes, lens_of, linear_buffer, pinhole_K, sensor_keywords
from uwsim.camera.lens import pixel_centres
from uwsim.camera.sensor import Constants, expose_without_noise, linear_from_radiance, noise_std_radiance
from uwsim.dataset.frame import Frame
from uwsim.dataset.store import Dataset
from uwsim.images import linear_from_srgb_uint8
from uwsim.metrics import image as image_metrics
from uwsim.metrics import uciqe, uiqm
from uwsim.restoration import algorithms

SMOOTH_PX = 15  # against the noise of the truth's own rendering

STATISTICS = {
    "psnr": "median", "mse": "median", "ssim": "median", "uciqe_o": "median", "uiqm_f": "median",
    "uiqm_m": "median", "milliseconds": "median",
}  # fmt: skip


_WATER_KNOWN = ("name", "wavelengths_nm", "absorption_per_m", "scattering_per_m", "phase_function")
_LAMP_POSES = ("world_from_lamp", "world_from_leds")


def case_names(dataset: Dataset) -> list[str]:
    """Return the frames without motion blur; ValueError if there are none."""
    names = [frame.name for frame in dataset.frames if frame.info.blur is None]
    if not names:
        raise ValueError(f"{dataset.folder}: restoration needs a frame without motion blur, the dataset has none")
    return names


def case(dataset: Dataset, name: str) -> Case:
    frame = dataset.frame(name)
    return Case(name=name, image=frame.image, makers=makers(frame), truth=reference(frame))


def reference(frame: Frame) -> np.ndarray:
    """Return the water-free twin through the same camera without noise, (H, W, 3) uint8 sRGB."""
    return expose_without_noise(frame.buffer("water_free"), **sensor_keywords(frame))


def makers(frame: Frame) -> runner.Makers:
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


def restored(module: ModuleType, name: str, given: tuple[str, ...], case: Case) -> tuple[np.ndarray, float]:
    """Return (what the method makes of the picture, 8-bit sRGB; milliseconds of the call)."""
    where = f"restoration: {name}: case {case.name}"
    output, elapsed_ms = runner.image_call(
        module, name, "restore", image=case.image, wanted=given, makers=case.makers, where=where
    )
    kind = runner.input_kind(module, name)
    return runner.checked_picture(output, kind=kind, shape=case.image.shape, where=where), elapsed_ms


def score(module: ModuleType, name: str, given: tuple[str, ...], case: Case) -> dict[str, float]:
    picture, elapsed_ms = restored(module, name, given, case)
    return {**picture_scores(case.truth, picture), "milliseconds": elapsed_ms}


def picture_scores(truth: np.ndarray, picture: np.ndarray) -> dict[str, float]:
    """Return the scores of an 8-bit picture against the reference; the last three see the picture alone."""
    return {
        "psnr": image_metrics.psnr(truth, picture),
        "mse": image_metrics.mse(truth, picture),
        "ssim": image_metrics.ssim(truth, picture),
        "uciqe_o": uciqe.uciqe_o(picture),
        "uiqm_f": uiqm.uiqm_f(picture),
        "uiqm_m": uiqm.uiqm_m(picture),
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


TASK = Task(
    name="restoration",
    package=algorithms,
    function="restore",
    inputs=(
        "range_m",
        "z_depth_m",
        "water",
        "lamps",
        "camera",
        "rig",
        "backscatter",
        "transmission",
        "forward_scatter",
        "direct_gain",
        "noise_std",
    ),  # fmt: skip
    statistics=STATISTICS,
    case_names=case_names,
    case=case,
    score=score,
    notes=camera_notes,
)
