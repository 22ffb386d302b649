"""The sections of the blur page, one for each of its benchmarks: figures, tables and words of their numbers."""

import math
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import numpy as np

from uwsim.bench.blur.strata import strata
from uwsim.bench.blur_page import figures, goals, tables
from uwsim.bench.blur_page.study import DECONVOLVER, OURS, Study
from uwsim.bench.judged import NONE, shown
from uwsim.bench.records import markdown_table
from uwsim.bench.study import title
from uwsim.metrics.blur import within_interval

ERRORS, FAILURES = "errors_over_length.png", "failures.png"
GAINS, RENDERED = "deconvolution.png", "rendered.png"
_MAIN = (
    "failure_percent", "length_error_px", "angle_error_deg", "length_error_to_bound_ratio",
    "angle_error_to_bound_ratio", "refused_percent", "kept_failure_percent", "milliseconds",
)  # fmt: skip
_RESTORED = ("psnr", "ssim", "psnr_inner", "psnr_above_blurred", "made_worse_percent", "milliseconds")
_UNDONE = ("psnr", "ssim", "psnr_above_blurred", "made_worse_percent", "left_alone_percent", "milliseconds")
_GROUPS_SHOWN = ("group", "water", "speed")


def controlled(study: Study) -> str:
    """Return the section on estimators, on frames made here."""
    shots = [case for case in study.cases() if study.conditions[case]["length_px"] > 0]
    test = goals.pictures(study, use="test")
    parts = [
        f"## Estimators\n\n{_made(study)}",
        "All frames in motion:", tables.overview(study, _MAIN, shots),
        "Pictures that no method was set on, without those that repeat themselves:",
        tables.overview(study, _MAIN, test),
        f"![Error over the length of the blur]({ERRORS})", f"![Failures]({FAILURES})",
        "By length, all frames: length error, median/90 % [px]; angle error, median/90 % [deg]; failures [%]:",
        tables.spreads(study, tables.groups_of(study, "length_px", shots, lambda value: f"{value:g} px")),
        "Failures by noise [%]:", _failures(study, "noise_percent", shots, lambda value: f"{value:g} %"),
        "Failures by texture [%]:", _failures(study, "texture", shots, title),
        "Failures by how the blur was made, at the same angles and noise [%]:", _making(study),
        "Root mean square error over the bound on Gaussian fields, whose spectrum is known (1: at the bound):",
        _fields(study),
        "Median error over 0.6745 of the bound, pictures, by length; those that repeat themselves apart:",
        *(_ratios(study, quantity) for quantity in ("length", "angle")),
        "Errors within the 90 % intervals that `whittle` states [%]:", _covered(study),
        "Sharp frames called blurred by 2 px or more [%]:", _sharp(study),
    ]  # fmt: skip
    return "\n\n".join(part for part in parts if part)


def _made(study: Study) -> str:
    origin, found = study.result.provenance, study.conditions.values()
    made = Counter(one["blurred_by"] if one["length_px"] else "sharp" for one in found)
    quick = ", a quick run" if origin["quick"] else ""
    names = {use: sorted({one["texture"] for one in found if one["use"] == use}) for use in ("tuning", "test")}
    return (
        f"{len(found)} frames of 256 x 256 pixels made while it runs{quick}: {made['otf']} blurred by the exact "
        f"transfer function, {made['sub_frames']} by averaging sub-frames, {made['sharp']} sharp. Textures for tuning: "
        f"{', '.join(names['tuning'])}; for the test: {', '.join(names['test'])}."
    )


def _failures(study: Study, key: str, cases: list[str], words) -> str:
    groups = tables.groups_of(study, key, cases, words)
    return tables.by_group(study, groups, lambda name, some: study.mean(name, "failure_percent", some),
                           methods=study.methods, places=1)  # fmt: skip


def _making(study: Study) -> str:
    """Return failures by the way the blur was made, on the frames that both ways have."""
    keys = ("texture", "length_px", "angle_deg", "noise_percent")
    of = {case: tuple(study.conditions[case][key] for key in keys) for case in study.cases()}
    both = {of[c] for c in study.cases(blurred_by="otf")} & {of[c] for c in study.cases(blurred_by="sub_frames")}
    cases = [case for case, place in of.items() if place in both and study.conditions[case]["length_px"] > 0]
    return _failures(study, "blurred_by", cases, title) if cases else "No frame was made both ways."


def _fields(study: Study) -> str:
    cases = [case for case in study.cases(gaussian=True) if study.conditions[case]["length_px"] > 0]
    quantities = ("length", "angle")
    rows = [
        [tables.labelled(study, name), *(shown(study.rms_to_bound(name, one, cases), 2) for one in quantities)]
        for name in study.methods
    ]
    return markdown_table(["method", *quantities], rows)


def _ratios(study: Study, quantity: str) -> str:
    metric = f"{quantity}_error_to_bound_ratio"
    cases = goals.pictures(study)
    groups = tables.groups_of(study, "length_px", cases, lambda value: f"{value:g} px")
    repeating = [case for case in study.cases(periodic=True) if study.conditions[case]["length_px"] > 0]
    groups |= {"repeating, all": repeating} if repeating else {}
    return tables.by_group(study, groups, lambda name, some: study.median(name, metric, some),
                           methods=study.methods, places=1, caption=quantity)  # fmt: skip


def _covered(study: Study) -> str:
    """Return how often the stated intervals hold the truth, by kind of texture."""
    kinds = {
        "pictures of the test": goals.pictures(study, use="test"),
        "pictures for tuning": goals.pictures(study, use="tuning"),
        "pictures that repeat themselves": [
            case for case in study.cases(periodic=True) if study.conditions[case]["length_px"] > 0
        ],
        "Gaussian fields": [case for case in study.cases(gaussian=True) if study.conditions[case]["length_px"] > 0],
    }  # fmt: skip
    rows = []
    for words, cases in kinds.items():
        ratios = [study.values(OURS, f"{quantity}_error_to_sd", cases) for quantity in ("length", "angle")]
        cells = [shown(100 * float(np.mean(within_interval(some))), 1) if some.size else NONE for some in ratios]
        rows.append([words, str(len(cases)), *cells])
    return markdown_table(["textures", "frames", "length", "angle"], rows)


def _sharp(study: Study) -> str:
    cases = study.cases(length_px=0.0)
    if not cases:
        return "No sharp frame was made."
    groups = {f"{len(cases)} frames": cases}
    groups |= tables.groups_of(study, "noise_percent", cases, lambda value: f"noise {value:g} %")
    groups |= tables.groups_of(study, "texture", cases, title)
    return tables.by_group(study, groups, lambda name, some: study.mean(name, "sharp_called_blurred_percent", some),
                           methods=study.methods, places=0)  # fmt: skip


def controlled_figures(study: Study, folder: Path) -> None:
    test = goals.pictures(study, use="test")
    figures.errors_over_length(study, folder / ERRORS, cases=test)
    figures.failures(study, folder / FAILURES, cases=test)


def deconvolution(study: Study) -> str:
    """Return the section on deconvolution."""
    cases = study.cases()
    by_length = {
        f"{noise:g} %": tables.groups_of(
            study, "length_px", study.cases(noise_percent=noise), lambda value: f"{value:g} px"
        )
        for noise in study.steps("noise_percent")
    }  # fmt: skip
    parts = [
        "## Deconvolution",
        f"{len(cases)} frames of 256 x 256 pixels. A method's name alone: given the true blur; with an estimator's "
        f"name: given that estimator's. The row `{study.raw}` is the blurred frame as it is.",
        tables.overview(study, _RESTORED, cases), f"![Gain over the blurred frame, and frames made worse]({GAINS})",
        *(
            f"PSNR [dB], median, noise {noise}:\n\n" + tables.by_group(
                study, groups, lambda name, some: study.median(name, "psnr", some), methods=study.methods, places=2)
            for noise, groups in by_length.items()
        ),
        *(
            f"Frames made worse than they were [%], noise {noise}:\n\n" + tables.by_group(
                study, groups, lambda name, some: study.mean(name, "made_worse_percent", some),
                methods=[name for name in study.methods if name != study.raw], places=0)
            for noise, groups in by_length.items()
        ),
        "PSNR with an estimated blur above that with the true one [dB], without borders. By noise, median and 10th "
        "percentile:",
        _losses(study, "noise_percent", lambda noise: f"noise {noise:g} %", lambda lost: (
            ", ".join(f"{value:+.2f}" for value in np.quantile(lost, (0.5, 0.1))))),
        "By length, mean: what an estimator calls no blur is left as it is, and loses all of the gain:",
        _losses(study, "length_px", lambda length: f"{length:g} px", lambda lost: f"{np.mean(lost):+.2f}"),
    ]  # fmt: skip
    return "\n\n".join(part for part in parts if part)


def _losses(study: Study, key: str, words: Callable, written: Callable[[np.ndarray], str]) -> str:
    """Return what estimated blurs cost, by a condition of the cases; `written` makes a cell of the losses [dB]."""
    groups = tables.groups_of(study, key, study.cases(), words)
    rows = []
    for name, variant in study.definition.get("variants", {}).items():
        if name not in study.methods or variant["algorithm"] not in study.methods or not variant["blur_from"]:
            continue
        losses = [goals.loss(study, variant["algorithm"], name, cases) for cases in groups.values()]
        rows.append([title(name), *(written(lost) if lost.size else NONE for lost in losses)])
    return markdown_table(["method", *groups], rows) if rows else "No method took part with an estimated blur."


def deconvolution_figures(study: Study, folder: Path) -> None:
    noise = goals.GAINS_NOISE_PERCENT
    figures.deconvolution_gains(
        study, folder / GAINS, cases=study.cases(noise_percent=noise), noise=noise,
        goals=goals.GAINS_DB if DECONVOLVER in study.methods else {},
    )  # fmt: skip


def rendered(study: Study) -> str:
    """Return the section on rendered frames."""
    groups, origin = strata(study.conditions), study.result.provenance
    quick = ", a quick run" if origin["quick"] else ""
    metrics = (*_MAIN[:-1], "field_error_px", "field_answered_percent", "milliseconds")
    uniform = study.cases(uniform=True)
    parts = [
        "## Rendered frames",
        f"{len(study.cases())} frames in motion of the dataset {origin['dataset']['name']}{quick}, "
        f"{len(uniform)} of them in uniform motion.",
        tables.overview(study, metrics, study.cases()),
        "Uniform motion:" if uniform else "", tables.overview(study, metrics, uniform) if uniform else "",
        f"![Failures and error of the field by group]({RENDERED})",
        *(_by_stratum(study, groups, metric, words) for metric, words in (
            ("failure_percent", "Failures [%]"), ("length_error_px", "Length error [px], median"),
            ("field_error_px", "Error of the field over the pixels [px], median"))),
    ]  # fmt: skip
    return "\n\n".join(part for part in parts if part)


def _by_stratum(study: Study, groups: dict[str, list[str]], metric: str, words: str) -> str:
    rows = [
        [group, str(len(cases)), *(shown(study.summary(name, metric, cases)) for name in study.methods)]
        for group, cases in groups.items()
    ]
    return f"{words}:\n\n{markdown_table(['frames of', 'number', *map(title, study.methods)], rows)}"


def undone(study: Study) -> str:
    """Return the section on rendered frames brought back to their sharp twins."""
    groups, origin = strata(study.conditions), study.result.provenance
    quick = ", a quick run" if origin["quick"] else ""
    uniform = study.cases(uniform=True)
    parts = [
        "## Rendered frames undone",
        f"{len(study.cases())} frames in motion of the dataset {origin['dataset']['name']}{quick}. A method's name "
        f"alone: given the label, one straight motion; with an estimator's name: what that says. The row `{study.raw}` "
        "is the picture as it is.",
        tables.overview(study, _UNDONE, study.cases()),
        "Uniform motion:" if uniform else "", tables.overview(study, _UNDONE, uniform) if uniform else "",
        *(_by_stratum(study, groups, metric, words) for metric, words in (
            ("psnr_above_blurred", "PSNR above the picture as it is [dB], median"),
            ("made_worse_percent", "Made worse [%]"), ("left_alone_percent", "Left alone [%]"))),
    ]  # fmt: skip
    return "\n\n".join(part for part in parts if part)


def rendered_figures(study: Study, folder: Path) -> None:
    groups = {name: some for name, some in strata(study.conditions).items() if name.split(":")[0] in _GROUPS_SHOWN}
    figures.rendered(study, folder / RENDERED, groups=groups)


def sentences(study: Study, cases: list[str]) -> str:
    """Return who fails least often, and the best of those without a fit of the spectrum."""
    failed = {name: study.mean(name, "failure_percent", cases) for name in study.rivals}
    known = {name: share for name, share in failed.items() if not math.isnan(share)}
    words = ", ".join(f"{title(name)} {known[name]:.1f} %" for name in sorted(known, key=known.get))
    return f"Failures, from the fewest: {words}."
