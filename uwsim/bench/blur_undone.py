"""Rendered frames undone: how near a stored picture in motion is brought to its sharp twin, as `uwsim deblur` does it.

What NEEDS may list:
  blur    the Estimate of the frame's blur: the label, one straight motion for all of the frame; in a variant with
          `blur_from` what that estimator says of the picture: left alone where it sees no blur, and by tiles where
          `whittle` calls the motion not uniform

Scores are of 8-bit sRGB against the twin, a momentary exposure in the middle of the real one, without noise: PSNR,
SSIM, how much of the first is gained over the picture as it is, the share of frames that are made worse, and UIQM and
UCIQE, which see no truth.
"""

import math
from functools import partial
from types import ModuleType

import numpy as np

from uwsim.bench import runner
from uwsim.bench.blur import case_names, strata
from uwsim.bench.blur.estimates import Told
from uwsim.bench.kept import Scores
from uwsim.bench.restoration.scores import no_reference_scores
from uwsim.bench.task import Task, linear_buffer, through_camera
from uwsim.bench.undone import undone, way_of
from uwsim.dataset.store import Dataset
from uwsim.metrics import image as image_metrics
from uwsim.motion_blur import deconvolvers
from uwsim.motion_blur.estimate import Estimate

STATISTICS = {
    "psnr": "median", "ssim": "median", "psnr_above_blurred": "median", "made_worse_percent": "mean",
    "left_alone_percent": "mean", "uiqm_f": "median", "uciqe_o": "median", "milliseconds": "median",
}  # fmt: skip
_SHOWN = {
    "psnr_above_blurred": "PSNR above the picture as it is [dB], median", "made_worse_percent": "made worse [%]",
    "left_alone_percent": "left alone [%]",
}  # fmt: skip


def case(dataset: Dataset, name: str) -> Told:
    """Return a frame in motion; `truth` is its sharp twin, (H, W, 3) uint8 sRGB."""
    frame = dataset.frame(name)
    sharp = through_camera(frame, "sharp")
    label = Estimate(frame.info.blur.length_px, frame.info.blur.angle_deg)
    return Told(name=name, image=frame.image, makers={"sharp": partial(linear_buffer, frame, "sharp")}, truth=sharp,
                label=label)  # fmt: skip


def score(module: ModuleType, name: str, given: tuple[str, ...], case: Told) -> dict[str, float | str]:
    where, source = f"deblurring: {name}: case {case.name}", getattr(module, "BLUR_FROM", None)
    try:
        blur = case.blur(source)
    except runner.NotInFrame as reason:
        return dict.fromkeys(STATISTICS, math.nan) | {"note": str(reason)}
    way = way_of(module, name, image=case.image, blur=blur, blur_from=source or "label")
    picture, elapsed_ms = undone(module, name, given, image=case.image, way=way, where=where)
    psnr, as_it_is = (image_metrics.psnr(case.truth, one) for one in (picture, case.image))
    seen = no_reference_scores(picture)
    return {
        "psnr": psnr, "ssim": image_metrics.ssim(case.truth, picture), "psnr_above_blurred": psnr - as_it_is,
        "made_worse_percent": 100.0 * (psnr < as_it_is),
        "left_alone_percent": 100.0 * np.array_equal(picture, case.image),
        "uiqm_f": seen["uiqm_f"], "uciqe_o": seen["uciqe_o"], "milliseconds": elapsed_ms,
    }  # fmt: skip


def findings(dataset: Dataset, scores: dict[str, Scores]) -> dict[str, dict]:
    """Return the median gain, and the shares made worse and left alone, by what the frames were like."""
    groups = strata.strata(strata.conditions(dataset, list(scores)))
    return {f"{metric}_by_stratum": strata.by_group(groups, scores, metric, words) for metric, words in _SHOWN.items()}


TASK = Task(
    name="deblurring",
    package=deconvolvers,
    function="deblur",
    inputs=("blur",),
    statistics=STATISTICS,
    case_names=case_names,
    case=case,
    score=score,
    conditions=strata.conditions,
    findings=findings,
)
