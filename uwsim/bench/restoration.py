"""Restoration: how near a method comes to the water-free twin of each still frame.

What NEEDS may list:
  range_m, z_depth_m    (H, W) [m], +inf where no body is seen
  water                 {"absorption_per_m", "scattering_per_m", "attenuation_per_m"}: (3,) per camera band
  lamps                 list of the `lamps` of frame.json, {"name", "position_m", "direction" (both in the camera's
                        frame), "radiant_intensity_w_per_sr", "spectrum", "half_angle_deg", "window", ...}
  camera                {"K", "width_px", "height_px", "linear_per_radiance": image units per radiance in the water,
                        (3,), or (H, W, 3) behind a port or where the lens vignettes}; K is that of a pinhole in the
                        water, behind a port that of the effective focal length (see `bench.task`)
  backscatter           (H, W, 3) in the linear units of the image, without noise
  transmission          (H, W, 3), 0 where no body is seen
"""

from functools import partial
from types import ModuleType

import numpy as np

from uwsim.bench import runner
from uwsim.bench.task import Case, Task, camera_notes, lens_of, linear_buffer, pinhole_K, sensor_keywords
from uwsim.camera.lens import pixel_centres
from uwsim.camera.sensor import Constants, expose_without_noise
from uwsim.dataset.frame import Frame
from uwsim.dataset.store import Dataset
from uwsim.metrics import image as image_metrics
from uwsim.metrics import uciqe, uiqm
from uwsim.restoration import algorithms

STATISTICS = {
    "psnr": "median", "mse": "median", "ssim": "median", "uciqe_o": "median", "uiqm_f": "median",
    "uiqm_m": "median", "milliseconds": "median",
}  # fmt: skip


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
        "backscatter": partial(linear_buffer, frame, "backscatter"),
        "transmission": partial(frame.buffer, "transmission"),
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
    camera, lens = frame.info.camera, lens_of(frame)
    linear = Constants(**sensor_keywords(frame)).linear_per_radiance
    if lens.port is not None:
        centres = pixel_centres(width_px=camera.width_px, height_px=camera.height_px)
        # pixels that no ray through the port reaches are black
        linear = linear * np.nan_to_num(lens.radiance_factor(centres))[..., None]
    return {
        "K": pinhole_K(lens), "width_px": camera.width_px, "height_px": camera.height_px, "linear_per_radiance": linear
    }  # fmt: skip


TASK = Task(
    name="restoration",
    package=algorithms,
    function="restore",
    inputs=("range_m", "z_depth_m", "water", "lamps", "camera", "backscatter", "transmission"),
    statistics=STATISTICS,
    case_names=case_names,
    case=case,
    score=score,
    notes=camera_notes,
)
