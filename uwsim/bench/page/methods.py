"""What the methods make of one frame each: restorations, blur kernels, poses."""

import math

import numpy as np

from uwsim.bench import blur, pose, restoration
from uwsim.bench.page.kernel import kernel_drawing
from uwsim.bench.page.markup import cell, escape, figure, grid, paragraph, picture, section, sortable_table
from uwsim.bench.page.pictures import through_camera
from uwsim.bench.page.plots import legend, styles
from uwsim.bench.page.pose_overlay import pose_figure
from uwsim.bench.records import Result, number, role
from uwsim.bench.run import Algorithm, load
from uwsim.bench.runner import NotInFrame
from uwsim.bench.task import Case, Task
from uwsim.dataset.frame import Frame
from uwsim.dataset.store import Dataset

_SEARCHED_CASES = 8


def runnable(result: Result | None, task: Task) -> list[Algorithm]:
    """Return the algorithms of a result that can be run again: shipped and installed ones."""
    found = []
    for name in dict.fromkeys(record.algorithm for record in result.records) if result else ():
        try:
            algorithm = load(task, name)
        except ValueError:  # a user's own file is not known by its name
            continue
        if not algorithm.missing:
            found.append(algorithm)
    return found


def restoration_section(frame: Frame, dataset: Dataset, result: Result) -> str:
    """Return what each method makes of a still frame, beside the stored picture and the reference."""
    title = "Restorations of one frame"
    if frame.info.blur is not None:
        return section("restorations", title, paragraph("This dataset has no still frame, so nothing was restored."))
    case = restoration.case(dataset, frame.name)
    figures, left_out = [_restored("as stored", case.image, case.truth, "the input of every method")], []
    for algorithm in runnable(result, restoration.TASK):
        if role(result, algorithm.name) == "do-nothing":  # shown as stored
            continue
        try:
            image, _ = restoration.restored(algorithm.module, algorithm.name, algorithm.given, case)
        except NotInFrame as reason:
            left_out.append(f" Left out: {algorithm.name}: {reason}.")
            continue
        kind = "the oracle, " if role(result, algorithm.name) else ""
        given = ", ".join(algorithm.given) or "the picture alone"
        figures.append(_restored(algorithm.name, image, case.truth, f"{kind}given {given}"))
    twin = picture(case.truth, "The water-free twin")
    figures.append(figure(twin, "reference", "the water-free twin through the same camera, without noise"))
    text = f"Frame {frame.name}. PSNR and SSIM are taken on 8-bit sRGB against the reference; no gain is fitted."
    return section("restorations", title, paragraph(text + "".join(left_out)), grid(figures, "medium"))


def _restored(name: str, image: np.ndarray, truth: np.ndarray, note: str) -> str:
    scores = restoration.picture_scores(truth, image)
    psnr = f"{scores['psnr']:.2f} dB" if math.isfinite(scores["psnr"]) else "identical"
    words = f'<span class="scores">PSNR {psnr}, SSIM {scores["ssim"]:.3f}</span>; {escape(note)}'
    return figure(picture(image, f"The frame, {name}"), name, words)


def blur_section(dataset: Dataset, result: Result | None) -> str:
    """Return a frame in motion, its sharp twin, the true kernel and what the estimators say."""
    title = "Motion blur"
    frames = [frame for frame in dataset.frames if frame.info.blur is not None]
    if not frames:
        return section("blur", title, paragraph("This dataset has no frame in motion, so there is no blur to show."))
    frames = [frame for frame in frames if frame.info.blur.uniform] or frames
    frame = sorted(frames, key=lambda frame: frame.info.blur.length_px)[len(frames) // 2]
    true = frame.info.blur
    estimates = _estimates(frame, dataset, result) if result else {}
    style_of = {name: style for name, style in styles(result).items() if name in estimates} if result else {}
    drawing = kernel_drawing(true, estimates, {name: f"var(--c{colour})" for name, (colour, _) in style_of.items()})
    spread = "" if true.uniform else f", spread {true.spread_px:.2g} px"
    words = f"wide band: the true path of a point during the exposure, {true.length_px:.3g} px at "
    words += f"{true.angle_deg:.3g}°{spread}; lines: the estimates"
    stored = picture(frame.image, "The blurred frame as stored")
    sharp = picture(through_camera(frame, "sharp"), "The same scene without motion")
    figures = [
        figure(stored, "as stored", f"frame {escape(frame.name)}"),
        figure(sharp, "sharp twin", "a momentary exposure in the middle of the real one, without noise"),
        figure(drawing, "kernel", escape(words) + (legend(style_of) if style_of else "")),
    ]
    return section("blur", title, grid(figures, "medium"), _blur_table(true, estimates) if estimates else "")


def _estimates(frame: Frame, dataset: Dataset, result: Result) -> dict[str, tuple[float, float]]:
    case = blur.case(dataset, frame.name)
    found = {}
    for algorithm in runnable(result, blur.TASK):
        estimate, _ = blur.estimated(algorithm.module, algorithm.name, algorithm.given, case)
        found[algorithm.name] = float(estimate.length_px), float(estimate.angle_deg)
    return found


def _blur_table(true, estimates: dict[str, tuple[float, float]]) -> str:
    heads = [("algorithm", False), ("length [px]", True), ("angle [deg]", True)]
    rows = [
        [cell(escape(name)), *(_number(value, "no estimate") for value in pair)]
        for name, pair in {"truth": (true.length_px, true.angle_deg), **estimates}.items()
    ]
    return sortable_table(heads, rows, "This frame; angle: x right, y up, modulo 180°", kind="short")


def pose_section(dataset: Dataset, result: Result | None) -> str:
    """Return a frame with markers, the true axes and those that a solver found."""
    title = "Pose from markers"
    try:
        names = pose.case_names(dataset)
    except ValueError:
        text = "This dataset has no frame with a visible marker, so there is no pose to show."
        return section("pose", title, paragraph(text))
    case = _pose_case(dataset, names)
    found, rows = {}, []
    for algorithm in runnable(result, pose.TASK):
        found[algorithm.name], _ = pose.solved(algorithm.module, algorithm.name, algorithm.given, case)
        scores = pose.score(algorithm.module, algorithm.name, algorithm.given, case)
        numbers = [scores[key] for key in ("rotation_error_deg", "translation_error_percent", "corner_error_px")]
        rows.append([cell(escape(algorithm.name)), *(_number(value, "no pose") for value in numbers)])
    texts = ("rotation error [deg]", "translation error [%]", "corner error [px]")
    heads = [("solver", False), *((text, True) for text in texts)]
    numbers = sortable_table(heads, rows, f"Errors in frame {case.name}", kind="short") if rows else ""
    return section("pose", title, pose_figure(case, found, result), numbers)


def _pose_case(dataset: Dataset, names: list[str]) -> Case:
    """Return the first of the cases in which a marker is detected; looks at a few, else takes the first."""
    cases = (pose.case(dataset, name) for name in names[:_SEARCHED_CASES])
    seen = next((case for case in cases if len(case.truth.detected.body_m)), None)
    return seen or pose.case(dataset, names[0])


def _number(value: float, otherwise: str) -> str:
    known = math.isfinite(value)
    return cell(number(value) if known else otherwise, value=value if known else None, numeric=True)
