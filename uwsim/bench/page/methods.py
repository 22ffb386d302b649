"""What the methods make of one frame each: restorations and poses, and their numbers."""

import math

import numpy as np

from uwsim.bench import pose, restoration
from uwsim.bench.page.markup import cell, escape, figure, grid, paragraph, picture, section, sortable_table
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
    figures, left_out = [scored_picture("as stored", case.image, case.truth, "the input of every method")], []
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
        figures.append(scored_picture(algorithm.name, image, case.truth, f"{kind}given {given}"))
    twin = picture(case.truth, "The water-free twin")
    figures.append(figure(twin, "reference", "the water-free twin through the same camera, without noise"))
    text = f"Frame {frame.name}. PSNR and SSIM are taken on 8-bit sRGB against the reference; no gain is fitted."
    return section("restorations", title, paragraph(text + "".join(left_out)), grid(figures, "medium"))


def scored_picture(name: str, image: np.ndarray, truth: np.ndarray, note: str) -> str:
    """Return the figure of an 8-bit picture with its scores against the truth; `note`: plain text."""
    scores = restoration.picture_scores(truth, image)
    psnr = f"{scores['psnr']:.2f} dB" if math.isfinite(scores["psnr"]) else "identical"
    words = f'<span class="scores">PSNR {psnr}, SSIM {scores["ssim"]:.3f}</span>; {escape(note)}'
    return figure(picture(image, f"The frame, {name}"), name, words)


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
        rows.append([cell(escape(algorithm.name)), *(number_cell(value, "no pose") for value in numbers)])
    texts = ("rotation error [deg]", "translation error [%]", "corner error [px]")
    heads = [("solver", False), *((text, True) for text in texts)]
    numbers = sortable_table(heads, rows, f"Errors in frame {case.name}", kind="short") if rows else ""
    return section("pose", title, pose_figure(case, found, result), numbers)


def _pose_case(dataset: Dataset, names: list[str]) -> Case:
    """Return the first of the cases in which a marker is detected; looks at a few, else takes the first."""
    cases = (pose.case(dataset, name) for name in names[:_SEARCHED_CASES])
    seen = next((case for case in cases if len(case.truth.detected.body_m)), None)
    return seen or pose.case(dataset, names[0])


def number_cell(value: float, otherwise: str) -> str:
    """Return the cell of a number, or of words where it is none."""
    known = math.isfinite(value)
    return cell(number(value) if known else otherwise, value=value if known else None, numeric=True)
