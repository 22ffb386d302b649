"""Motion blur: length and angle of the blur of each frame in motion.

What NEEDS may list:
  sharp    (H, W, 3) the momentary exposure at mid-exposure, in the linear units of the image, without noise

Truth is the median displacement of the picture during the exposure; the summary "uniform" is over the frames
in which all of the picture moves alike. A failure is an error above 2 px or 10 degrees, or no estimate.
"""

from functools import partial
from types import ModuleType

from uwsim.bench import runner
from uwsim.bench.task import Case, Task, linear_buffer
from uwsim.dataset.store import Dataset
from uwsim.metrics import blur as blur_metrics
from uwsim.motion_blur import estimators

STATISTICS = {
    "length_error_px": "median", "angle_error_deg": "median", "failure_percent": "mean",
    "milliseconds": "median",
}  # fmt: skip


def case_names(dataset: Dataset) -> list[str]:
    """Return the frames in motion; ValueError if there are none."""
    names = [frame.name for frame in dataset.frames if frame.info.blur is not None]
    if not names:
        raise ValueError(f"{dataset.folder}: blur needs a frame in motion, the dataset has none")
    return names


def case(dataset: Dataset, name: str) -> Case:
    frame = dataset.frame(name)
    blur = frame.info.blur
    return Case(
        name=name,
        image=frame.image,
        makers={"sharp": partial(linear_buffer, frame, "sharp")},
        truth=blur,
    )


def summaries(dataset: Dataset, cases: list[str]) -> dict[str, list[str]]:
    """Return the cases of "all", and of "uniform" where there are any."""
    uniform = [name for name in cases if dataset.frame(name).info.blur.uniform]
    return {"all": cases} | ({"uniform": uniform} if uniform else {})


def estimated(module: ModuleType, name: str, given: tuple[str, ...], case: Case) -> tuple[object, float]:
    """Return (the Estimate of a method: length_px, angle_deg; milliseconds of the call)."""
    where = f"blur: {name}: case {case.name}"
    estimate, elapsed_ms = runner.image_call(
        module, name, "estimate", image=case.image, wanted=given, makers=case.makers, where=where
    )
    for key in ("length_px", "angle_deg"):
        try:
            float(getattr(estimate, key))
        except (AttributeError, TypeError, ValueError):
            raise ValueError(
                f"{where}: returned {estimate!r:.80}, allowed: an Estimate of numbers length_px, angle_deg"
            ) from None
    return estimate, elapsed_ms


def score(module: ModuleType, name: str, given: tuple[str, ...], case: Case) -> dict[str, float]:
    estimate, elapsed_ms = estimated(module, name, given, case)
    length_error_px = float(blur_metrics.length_error_px(float(estimate.length_px), case.truth.length_px))
    angle_error_deg = float(blur_metrics.angle_error_deg(float(estimate.angle_deg), case.truth.angle_deg))
    return {
        "length_error_px": length_error_px,
        "angle_error_deg": angle_error_deg,
        "failure_percent": 100.0 * float(blur_metrics.blur_failure(length_error_px, angle_error_deg)),
        "milliseconds": elapsed_ms,
    }


TASK = Task(
    name="blur",
    package=estimators,
    function="estimate",
    inputs=("sharp",),
    statistics=STATISTICS,
    case_names=case_names,
    case=case,
    score=score,
    summaries=summaries,
)
