"""A frame in motion: blurred, deblurred and sharp; its true kernel, and those that the estimators say."""

import numpy as np

from uwsim.bench import blur
from uwsim.bench.blur.estimates import Refusal
from uwsim.bench.page.kernel import kernel_drawing
from uwsim.bench.page.markup import cell, escape, figure, grid, paragraph, picture, section, sortable_table
from uwsim.bench.page.methods import number_cell, runnable, scored_picture
from uwsim.bench.page.plots import legend, styles
from uwsim.bench.records import Result
from uwsim.bench.task import Case, through_camera
from uwsim.bench.undone import DECONVOLVER, ESTIMATOR, undone, way_of
from uwsim.dataset.info import Blur
from uwsim.dataset.store import Dataset
from uwsim.discovery import find
from uwsim.motion_blur import deconvolvers, estimators, undo
from uwsim.motion_blur.deconvolution import nothing_to_undo

_TITLE = "Motion blur"


def blur_section(dataset: Dataset, result: Result | None) -> str:
    """Return a frame in motion, its sharp twin and its true kernel; with a result, what methods make of it."""
    frames = [frame for frame in dataset.frames if frame.info.blur is not None]
    if not frames:
        return section("blur", _TITLE, paragraph("This dataset has no frame in motion, so there is no blur to show."))
    frames = [frame for frame in frames if frame.info.blur.uniform] or frames
    frame = sorted(frames, key=lambda frame: frame.info.blur.length_px)[len(frames) // 2]
    true, sharp = frame.info.blur, through_camera(frame, "sharp")
    twin = figure(
        picture(sharp, "The same scene without motion"), "sharp twin",
        "a momentary exposure in the middle of the real one, without noise",
    )  # fmt: skip
    stored = scored_picture("as stored", frame.image, sharp, f"frame {frame.name}")
    if result is None:
        return section("blur", _TITLE, grid([stored, twin, _kernels(true, {}, {})], "medium"))
    case = blur.case(dataset, frame.name)
    found = _estimates(case, result)
    style_of = styles(result)
    line = f"var(--c{style_of.get(ESTIMATOR, (1, ''))[0]})"
    words, deblurred = _deblurred(case, sharp, true, found.get(ESTIMATOR) or _estimate(ESTIMATOR, case), line)
    pairs = {name: (float(estimate.length_px), float(estimate.angle_deg)) for name, estimate in found.items()}
    figures = [stored, *deblurred[:1], twin, *deblurred[1:], _kernels(true, pairs, style_of)]
    text = paragraph(f"{words} PSNR and SSIM are taken on 8-bit sRGB against the sharp twin.")
    return section("blur", _TITLE, text, grid(figures, "medium"), _table(true, pairs) if pairs else "")


def _estimates(case: Case, result: Result) -> dict[str, object]:
    return {
        algorithm.name: blur.estimated(algorithm.module, algorithm.name, algorithm.given, case)[0]
        for algorithm in runnable(result, blur.TASK)
    }


def _estimate(name: str, case: Case) -> object:
    return blur.estimated(find(estimators, name), name, (), case)[0]


def _deblurred(case: Case, sharp: np.ndarray, true: Blur, estimate: object, line: str) -> tuple[str, list[str]]:
    """Return in words what was done about the blur, and the picture and the kernels where something was.

    line: colour of the estimated kernel.
    """
    if isinstance(estimate, Refusal):
        return f"{ESTIMATOR} has no answer to this frame, so it is not deblurred: {estimate.reason}.", []
    module = find(deconvolvers, DECONVOLVER)
    way = way_of(module, DECONVOLVER, image=case.image, blur=estimate, blur_from=ESTIMATOR)
    if way.how == undo.LEFT_ALONE:
        what = "no blur in this frame" if nothing_to_undo(estimate) else "no tile of this frame that has one blur"
        return f"{ESTIMATOR} sees {what}: it is left as it is.", []
    where = f"{DECONVOLVER}: case {case.name}"
    try:
        image, _ = undone(module, DECONVOLVER, ("blur",), image=case.image, way=way, where=where)
    except ValueError as reason:
        return f"The frame is not deblurred: {reason}.", []
    length_px, angle_deg = float(estimate.length_px), float(estimate.angle_deg)
    said = f"{length_px:.3g} px at {angle_deg:.3g}°"
    note = f"by {DECONVOLVER}, told the estimated kernel, {said}"
    words = f"{DECONVOLVER} undoes the blur that {ESTIMATOR} finds in the picture."
    if way.field is not None:
        note = f"by {DECONVOLVER}, told the estimated kernels of {way.how}"
        words = (
            f"{ESTIMATOR} says that the blur is not uniform: {DECONVOLVER} undoes {way.how}, each with its own kernel."
        )
    elif estimate.verdict == "not uniform":
        words += " It says that the blur is not uniform; the frame is too small for tiles."
    drawing = kernel_drawing(true, {ESTIMATOR: (length_px, angle_deg)}, {ESTIMATOR: line})
    caption = f"wide band: true, {_words(true)}; line: estimated by {ESTIMATOR}, {said}"
    return words, [
        scored_picture("deblurred", image, sharp, note),
        figure(drawing, "true and estimated kernel", escape(caption)),
    ]


def _words(true: Blur) -> str:
    spread = "" if true.uniform else f", spread {true.spread_px:.2g} px"
    return f"{true.length_px:.3g} px at {true.angle_deg:.3g}°{spread}"


def _kernels(true: Blur, pairs: dict[str, tuple[float, float]], style_of: dict[str, tuple[int, str]]) -> str:
    shown = {name: style for name, style in style_of.items() if name in pairs}
    drawing = kernel_drawing(true, pairs, {name: f"var(--c{colour})" for name, (colour, _) in shown.items()})
    caption = f"wide band: the true path of a point during the exposure, {_words(true)}"
    caption += "; lines: the estimates" if pairs else ""
    title = "kernel, all estimators" if pairs else "kernel"
    return figure(drawing, title, escape(caption) + (legend(shown) if shown else ""))


def _table(true: Blur, pairs: dict[str, tuple[float, float]]) -> str:
    heads = [("algorithm", False), ("length [px]", True), ("angle [deg]", True)]
    rows = [
        [cell(escape(name)), *(number_cell(value, "no estimate") for value in pair)]
        for name, pair in {"truth": (true.length_px, true.angle_deg), **pairs}.items()
    ]
    return sortable_table(heads, rows, "This frame; angle: x right, y up, modulo 180°", kind="short")
