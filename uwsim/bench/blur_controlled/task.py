"""Motion blur on frames made here: what is known of them exactly is their blur, their noise and their texture.

What NEEDS may list:
  sharp    (H, W, 3) the frame without motion, linear, without noise

Truth is the blur that the frame was made with. Scores are those of `uwsim.bench.blur` but for the field. Sharp frames
have one score alone: `sharp_called_blurred_percent`, the share of them that a method calls blurred by 2 px or more.
"""

import math
from collections import defaultdict
from dataclasses import dataclass
from functools import lru_cache, partial
from types import ModuleType

import numpy as np

from uwsim.bench.blur import estimates
from uwsim.bench.blur.strata import SHOWN, by_group
from uwsim.bench.blur_controlled import textures
from uwsim.bench.blur_controlled.frames import Frames, Made
from uwsim.bench.kept import Scores
from uwsim.bench.task import Case, Task
from uwsim.metrics import blur as blur_metrics
from uwsim.motion_blur import estimators
from uwsim.motion_blur.bound import bound, spectrum_of_sharp
from uwsim.motion_blur.spectrum import Spectrum

STATISTICS = {
    **estimates.STATISTICS, "sharp_called_blurred_percent": "mean", "milliseconds": "median",
}  # fmt: skip
_DIGITS = 5
_SHOWN = {metric: SHOWN[metric] for metric in ("failure_percent", "length_error_px", "angle_error_deg")}


@dataclass(frozen=True)
class Controlled(Case):
    """A frame made here; `truth` is a `Truth`, `made` all that is known of it."""

    made: Made


def case_names(frames: Frames) -> list[str]:
    return list(frames.shots)


def case(frames: Frames, name: str) -> Controlled:
    made = frames.frame(name)
    sharp = np.repeat(made.sharp[..., None], 3, axis=-1).astype(np.float32)
    truth = estimates.Truth(made.shot.length_px, made.shot.angle_deg, partial(_bound, frames, made))
    return Controlled(name=name, image=made.image, makers={"sharp": lambda: sharp}, truth=truth, made=made)


def _bound(frames: Frames, made: Made) -> np.ndarray:
    """Return the bound from the field's own spectrum, or from that of the sharp frame of a picture."""
    texture, shot = frames.texture(made.shot.texture), made.shot
    if texture.picture is None:
        spectrum = textures.field_spectrum(texture)
    else:
        spectrum = _sharp_spectrum(made.sharp.shape, made.sharp.tobytes())
    return bound(
        spectrum, noise_std=made.noise_std, length_px=shot.length_px, angle_deg=shot.angle_deg, shape=made.sharp.shape
    )  # fmt: skip


@lru_cache(maxsize=32)
def _sharp_spectrum(shape: tuple[int, int], content: bytes) -> Spectrum:
    return spectrum_of_sharp(np.frombuffer(content).reshape(shape))


def score(module: ModuleType, name: str, given: tuple[str, ...], case: Controlled) -> dict[str, float | str]:
    estimate, elapsed_ms = estimates.estimated(module, name, given, case)
    if case.truth.length_px > 0:
        found = estimates.scores(estimate, case.truth) | {"sharp_called_blurred_percent": math.nan}
    else:
        found = dict.fromkeys((*estimates.STATISTICS, *estimates.DETAILS), math.nan)
        called = blur_metrics.sharp_called_blurred(estimate.length_px, getattr(estimate, "verdict", "blur"))
        found["sharp_called_blurred_percent"] = 100.0 * float(called)
    found["milliseconds"] = elapsed_ms
    # thousands of frames: the digits that say nothing would be most of the file
    return {key: value if key == "note" else float(f"{value:.{_DIGITS}g}") for key, value in found.items()}


def conditions(frames: Frames, cases: list[str]) -> dict[str, dict]:
    """Return what each frame is of, as the page groups them."""
    found = {}
    for name in cases:
        shot = frames.shots[name]
        texture = frames.texture(shot.texture)
        found[name] = {
            "texture": shot.texture, "use": texture.use, "gaussian": texture.picture is None,
            "periodic": texture.periodic, "blurred_by": shot.blurred_by, "length_px": shot.length_px,
            "angle_deg": shot.angle_deg, "noise_percent": shot.noise_percent,
        }  # fmt: skip
    return found


def summaries(frames: Frames, cases: list[str]) -> dict[str, list[str]]:
    """Return the cases of "all", and those of the test textures that do not repeat themselves."""
    shots = {name: frames.texture(frames.shots[name].texture) for name in cases}
    test = [name for name, texture in shots.items() if texture.use == "test" and not texture.periodic]
    return {"all": cases} | ({"test": test} if test else {})


def findings(frames: Frames, scores: dict[str, Scores]) -> dict[str, dict]:
    """Return tables by length, noise, texture and kind of blur, of the frames in motion."""
    groups: dict[str, list[str]] = defaultdict(list)
    keys = {"length_px": "length", "noise_percent": "noise", "texture": "texture", "blurred_by": "blurred by"}
    found = {name: one for name, one in conditions(frames, list(scores)).items() if one["length_px"] > 0}
    for key, words in keys.items():
        for name, one in found.items():
            groups[f"{words}: {_text(one[key], key)}"].append(name)
    return {f"{metric}_by_group": by_group(groups, scores, metric, words) for metric, words in _SHOWN.items()}


def _text(value: object, key: str) -> str:
    if key == "length_px":
        return f"{value:g} px"
    return f"{value:g} %" if key == "noise_percent" else str(value).replace("_", " ")


def conditions_with_bounds(frames: Frames, cases: list[str]) -> dict[str, dict]:
    """Return `conditions` with the bound on each frame's length and angle."""
    return estimates.with_bounds(conditions(frames, cases), lambda name: case(frames, name).truth)


TASK = Task(
    name="blur_controlled",
    package=estimators,
    function="estimate",
    inputs=("sharp",),
    statistics=STATISTICS,
    case_names=case_names,
    case=case,
    score=score,
    summaries=summaries,
    details=estimates.DETAILS,
    conditions=conditions_with_bounds,
    findings=findings,
    frames=Frames,
)
