"""The field of blur over a frame: an estimator's, against the flow of every pixel.

An estimator may define `field(image)` beside `estimate`, for the same kind of image: {"centres_px": (n, 2) x right, y
down, pixel centres at integer + 0.5; "displacement_px": (n, 2) right, up, NaN where it has no answer; "verdict": n of
"blur", "no blur", "not uniform"}. Of an estimator without one the single estimate stands for all of the frame.
"""

import math
from types import ModuleType

import numpy as np

from uwsim.bench import runner
from uwsim.bench.blur.estimates import Refusal
from uwsim.bench.task import Case
from uwsim.metrics import blur as blur_metrics
from uwsim.motion_blur.deconvolution import nothing_to_undo

STATISTICS = {"field_error_px": "median", "field_answered_percent": "mean"}


def scores(module: ModuleType, name: str, case: Case, estimate: object) -> dict[str, float]:
    """Return the median error over the pixels that see a body and got an answer, and how many of them did.

    The case's truth holds `displacement_px` (H, W, 2), right and up, and `seen` (H, W) bool.
    """
    true_px, seen = case.truth.displacement_px, case.truth.seen
    found_px = uniform(estimate, seen.shape)
    if callable(getattr(module, "field", None)) and not isinstance(estimate, Refusal):
        where = f"blur: {name}: field of case {case.name}"
        output, _ = runner.image_call(
            module, name, "field", image=case.image, wanted=(), makers=case.makers, where=where
        )  # fmt: skip
        found_px = spread_out(output, seen.shape, where=where)
    answered = seen & ~np.isnan(found_px).any(axis=-1)
    errors = blur_metrics.field_error_px(found_px[answered], true_px[answered])
    return {
        "field_error_px": float(np.median(errors)) if errors.size else math.nan,
        "field_answered_percent": 100.0 * float(answered.sum() / seen.sum()) if seen.any() else math.nan,
    }


def uniform(estimate: object, shape: tuple[int, int]) -> np.ndarray:
    """Return the field (H, W, 2), right and up [px], of one straight motion; of none where the verdict says so."""
    length_px = 0.0 if nothing_to_undo(estimate) else float(estimate.length_px)
    angle = math.radians(0.0 if length_px == 0 else float(estimate.angle_deg))
    return np.broadcast_to(length_px * np.array([math.cos(angle), math.sin(angle)]), (*shape, 2))


def spread_out(output: object, shape: tuple[int, int], *, where: str) -> np.ndarray:
    """Return the field (H, W, 2) of what `field` gave: each pixel has the answer of the nearest tile.

    The sign of a motion is not seen, so neighbours must not be averaged. ValueError for anything that is no field.
    """
    from scipy.spatial import cKDTree

    try:
        centres_px, found_px = (np.asarray(output[key], dtype=float) for key in ("centres_px", "displacement_px"))
        verdicts = np.asarray(output["verdict"]).ravel()
        centres_px, found_px = centres_px.reshape(-1, 2), found_px.reshape(-1, 2).copy()
    except (KeyError, TypeError, ValueError, IndexError):
        allowed = "centres_px, displacement_px and verdict of tiles"
        got = " ".join(f"{output!r:.60}".split())
        raise ValueError(f"{where}: got {got}, allowed: {allowed}") from None
    if not len(centres_px) == len(found_px) == len(verdicts) > 0:
        sizes = len(centres_px), len(found_px), len(verdicts)
        raise ValueError(f"{where}: got {sizes} centres, displacements and verdicts, allowed: as many of each, >= 1")
    found_px[verdicts == "no blur"] = 0.0
    y, x = np.mgrid[: shape[0], : shape[1]] + 0.5
    nearest = cKDTree(centres_px).query(np.stack([x, y], axis=-1).reshape(-1, 2))[1]
    return found_px[nearest].reshape(*shape, 2)
