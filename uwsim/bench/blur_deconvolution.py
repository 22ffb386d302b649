"""Deconvolution: how near a blurred frame is brought to the sharp one, given its true blur or an estimated one.

What NEEDS may list:
  blur    the Estimate of the frame's blur: the true length and angle; in a variant with `blur_from` what that estimator
          says of the same frame, with its covariance and spectrum where it has them

Frames are those of `uwsim.bench.blur_controlled`. Scores are in linear light, of the grey picture, 1 = white: PSNR and
SSIM of the whole frame, PSNR without a border as wide as the longest blur (`psnr_inner`), how much of the first is
gained over the frame as it is, and the share of frames that are made worse than that.
"""

import math
from types import ModuleType

import numpy as np

from uwsim.bench import runner
from uwsim.bench.blur.estimates import Told
from uwsim.bench.blur_controlled.frames import Frames
from uwsim.bench.blur_controlled.task import case_names, conditions
from uwsim.bench.kept import Scores
from uwsim.bench.task import Task
from uwsim.metrics import blur as blur_metrics
from uwsim.motion_blur import deconvolvers
from uwsim.motion_blur.estimate import Estimate

STATISTICS = {
    "psnr": "median", "ssim": "median", "psnr_inner": "median", "psnr_above_blurred": "median",
    "made_worse_percent": "mean", "milliseconds": "median",
}  # fmt: skip
INNER_PX = 20
"""Width of the border that `psnr_inner` leaves out."""


def case(frames: Frames, name: str) -> Told:
    """Return a frame made here; `truth` is its sharp picture (H, W)."""
    made = frames.frame(name)
    label = Estimate(made.shot.length_px, made.shot.angle_deg)
    return Told(name=name, image=made.image, makers={}, truth=made.sharp, label=label)


def score(module: ModuleType, name: str, given: tuple[str, ...], case: Told) -> dict[str, float | str]:
    where = f"deconvolution: {name}: case {case.name}"
    makers = {"blur": lambda: case.blur(getattr(module, "BLUR_FROM", None))}
    try:
        output, elapsed_ms = runner.image_call(
            module, name, "deblur", image=case.image, wanted=given, makers=makers, where=where
        )
    except runner.NotInFrame as reason:
        return dict.fromkeys(STATISTICS, math.nan) | {"note": str(reason)}
    kind = runner.input_kind(module, name)
    picture = runner.checked_linear(output, kind=kind, shape=case.image.shape, where=where).mean(axis=-1, dtype=float)
    found, as_it_is = _scores(case.truth, picture), _scores(case.truth, case.image.mean(axis=-1, dtype=float))
    gained = found["psnr"] - as_it_is["psnr"]
    return {
        **found, "psnr_above_blurred": gained, "made_worse_percent": 100.0 * (gained < 0), "milliseconds": elapsed_ms,
    }  # fmt: skip


def _scores(sharp: np.ndarray, picture: np.ndarray) -> dict[str, float]:
    inner = np.s_[INNER_PX:-INNER_PX, INNER_PX:-INNER_PX]
    return {
        "psnr": blur_metrics.psnr_linear(sharp, picture),
        "ssim": blur_metrics.ssim_linear(sharp, picture),
        "psnr_inner": blur_metrics.psnr_linear(sharp[inner], picture[inner]),
    }


def findings(frames: Frames, scores: dict[str, Scores]) -> dict[str, dict]:
    """Return the median gain over the blurred frame, and the share made worse, by length and noise."""
    from uwsim.bench.blur.strata import by_group

    groups: dict[str, list[str]] = {}
    for name in scores:
        shot = frames.shots[name]
        groups.setdefault(f"{shot.length_px:g} px, noise {shot.noise_percent:g} %", []).append(name)
    shown = {"psnr_above_blurred": "PSNR above the blurred frame [dB], median", "made_worse_percent": "made worse [%]"}
    return {f"{metric}_by_group": by_group(groups, scores, metric, words) for metric, words in shown.items()}


TASK = Task(
    name="deconvolution",
    package=deconvolvers,
    function="deblur",
    inputs=("blur",),
    statistics=STATISTICS,
    case_names=case_names,
    case=case,
    score=score,
    conditions=conditions,
    findings=findings,
    frames=Frames,
)
