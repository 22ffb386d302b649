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
                        {"electrons": photo-electrons that make 1 (3,), "dark_variance_e2"}}; not in frames without a
                        lamp: methods that ask for it have no scores there
  backscatter           (H, W, 3) in the linear units of the image, without noise
  transmission          (H, W, 3), 0 where no body is seen
  forward_scatter       (H, W, 3) as backscatter
  direct_gain           (H, W, 3), what the water leaves of the light straight from a body: direct / water_free, both
                        averaged over 15 px; unlike transmission it counts scattered illumination
  noise_std             (H, W, 3), standard deviation of the image in its linear units: sensor, 8 bits, and
                        Monte Carlo unless the frame was denoised

Scores: see `scores`. On charts and markers they are NaN in frames that show none. The summaries are "all" and, where
the cases are of several waters, one for each water of at least two cases. `relations` makes `oracle_share`, and beside
the table the rank correlations of the scores without a reference (UIQM, UCIQE) with those against the truth, and what
white noise scores: no goals, but to be seen.
"""

import math
from dataclasses import dataclass
from types import ModuleType

import numpy as np

from uwsim.bench import runner
from uwsim.bench.markers import whole_markers
from uwsim.bench.restoration.inputs import makers
from uwsim.bench.restoration.relations import SHARES, findings, relate
from uwsim.bench.restoration.scores import all_scores, picture_scores
from uwsim.bench.restoration.targets import Targets
from uwsim.bench.task import Case, Task, camera_notes, lens_of, sensor_keywords
from uwsim.camera.sensor import expose_without_noise
from uwsim.dataset.frame import Frame
from uwsim.dataset.store import Dataset
from uwsim.restoration import algorithms

__all__ = ["TASK", "case", "case_names", "makers", "picture_scores", "reference", "restored", "score"]

STATISTICS = {
    "psnr": "median", "ssim": "median", "psnr_gain": "median", "ssim_gain": "median", "colour_difference": "median",
    "mtf50_ratio": "median", "usaf_transfer": "median", "tags_found": "mean", "corner_error_px": "median",
    "sift_matches": "mean", "oracle_share": "mean", "milliseconds": "median", "mse": "median",
    "colour_difference_gain": "median", "tag_pose_error_percent": "median", "orb_matches": "mean",
    "oracle_share_gain": "mean", "uciqe_o": "median", "uiqm_f": "median", "uiqm_m": "median",
}  # fmt: skip
FURTHER = (
    "mse", "colour_difference_gain", "tag_pose_error_percent", "orb_matches", "oracle_share_gain", "uciqe_o", "uiqm_f",
    "uiqm_m",
)  # fmt: skip


@dataclass(frozen=True)
class Still(Case):
    """A still frame: `truth` is the reference, `targets` what of it is measured, looked for once for all methods."""

    targets: Targets


def case_names(dataset: Dataset) -> list[str]:
    """Return the frames without motion blur; ValueError if there are none."""
    names = [frame.name for frame in dataset.frames if frame.info.blur is None]
    if not names:
        raise ValueError(f"{dataset.folder}: restoration needs a frame without motion blur, the dataset has none")
    return names


def case(dataset: Dataset, name: str) -> Still:
    frame = dataset.frame(name)
    twin = reference(frame)
    return Still(name=name, image=frame.image, makers=makers(frame), truth=twin, targets=Targets(frame, twin))


def reference(frame: Frame) -> np.ndarray:
    """Return the water-free twin through the same camera without noise, (H, W, 3) uint8 sRGB."""
    return expose_without_noise(frame.buffer("water_free"), **sensor_keywords(frame))


def restored(module: ModuleType, name: str, given: tuple[str, ...], case: Case) -> tuple[np.ndarray, float]:
    """Return (what the method makes of the picture, 8-bit sRGB; milliseconds of the call).

    Raises NotInFrame where the case does not have an input that the method asks for.
    """
    where = f"restoration: {name}: case {case.name}"
    output, elapsed_ms = runner.image_call(
        module, name, "restore", image=case.image, wanted=given, makers=case.makers, where=where
    )
    kind = runner.input_kind(module, name)
    return runner.checked_picture(output, kind=kind, shape=case.image.shape, where=where), elapsed_ms


def score(module: ModuleType, name: str, given: tuple[str, ...], case: Still) -> dict[str, float | str]:
    try:
        picture, elapsed_ms = restored(module, name, given, case)
    except runner.NotInFrame as reason:
        return {metric: math.nan for metric in STATISTICS if metric not in SHARES} | {"note": str(reason)}
    return {**all_scores(case.targets, picture), "milliseconds": elapsed_ms}


def summaries(dataset: Dataset, cases: list[str]) -> dict[str, list[str]]:
    """Return the cases of "all", and of each water that has at least two, where there are several waters."""
    waters: dict[str, list[str]] = {}
    for name in cases:
        waters.setdefault(dataset.frame(name).info.water.name, []).append(name)
    shown = {water: members for water, members in waters.items() if 1 < len(members) < len(cases)}
    return {"all": cases} | shown


def notes(dataset: Dataset, cases: list[str]) -> list[str]:
    """Return what methods were given instead of the cameras, and what tag poses are solved with."""
    frames = [dataset.frame(name) for name in cases]
    behind_port = [frame.name for frame in frames if lens_of(frame).port is not None and whole_markers(frame.info)]
    text = f"tag pose errors are those of SQPnP with the same pinhole (frames {', '.join(behind_port)})"
    return camera_notes(dataset, cases) + ([text] if behind_port else [])


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
    notes=notes,
    summaries=summaries,
    further=FURTHER,
    relate=relate,
    relative=tuple(SHARES),
    findings=findings,
)
