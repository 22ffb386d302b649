"""Figures of the blur page that the scores alone make."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from uwsim.bench.blur_page.study import OURS, PRINTED, Study
from uwsim.bench.canvas import new_figure, save
from uwsim.bench.study import title
from uwsim.metrics.blur import MEDIAN_OVER_SD

LEAST_SHOWN = 1e-3
"""Floor of the logarithmic axes: smaller errors, 0 among them, are drawn there with a mark of their own."""
_FLOOR_MARK = "v"
_COLOURS = [f"C{index}" for index in (0, 1, 2, 3, 4, 5, 6, 8, 9)]
"""Without the grey: that is the yardsticks'."""


def errors_over_length(study: Study, path: Path, *, cases: list[str]) -> None:
    """Draw the median errors over the length of the blur, and below them what the bound allows.

    Errors below LEAST_SHOWN, such as 0 where the true angle is one that a method tries, stand at it as triangles.
    """
    figure, (panels,) = new_figure(1, 2, width=5.5, height=4.4)
    steps = study.steps("length_px", cases)
    of_length = [[case for case in cases if study.conditions[case]["length_px"] == step] for step in steps]
    below = False
    for panel, (quantity, unit) in zip(panels, (("length", "px"), ("angle", "deg")), strict=True):
        metric = f"{quantity}_error_{unit}"
        below |= _lines(
            panel, study, steps, lambda name, n, metric=metric: study.median(name, metric, of_length[n]),
            floor=LEAST_SHOWN,
        )  # fmt: skip
        bounds = [[study.bound(case, quantity) for case in found] for found in of_length]
        bound = [MEDIAN_OVER_SD * np.nanmedian(found) for found in bounds]
        panel.plot(steps, bound, "k:", linewidth=2, label="Cramer-Rao bound (median error at it)")
        panel.set(xlabel="length of the blur [px]", ylabel=f"{quantity} error [{unit}], median", yscale="log")
        panel.set_ylim(bottom=LEAST_SHOWN / 1.25)
        panel.grid(color="0.9")
    if below:
        panels[0].plot([], [], _FLOOR_MARK, color="0.3", label=f"below {LEAST_SHOWN:g}, drawn at it")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=4, fontsize=8)
    save(figure, path)


def failures(study: Study, path: Path, *, cases: list[str]) -> None:
    """Draw the share of failures over the length of the blur, and over the noise."""
    figure, (panels,) = new_figure(1, 2, width=5.5, height=4, sharey=True)
    labels = {"length_px": "length of the blur [px]", "noise_percent": "noise [% of white]"}
    for panel, (key, label) in zip(panels, labels.items(), strict=True):
        steps = study.steps(key, cases)
        groups = [[case for case in cases if study.conditions[case][key] == step] for step in steps]
        _lines(panel, study, steps, lambda name, n, groups=groups: study.mean(name, "failure_percent", groups[n]))
        panel.set(xlabel=label, ylim=(-2, 102))
        panel.grid(color="0.9")
    panels[0].set_ylabel("failures [%]")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=4, fontsize=8)
    save(figure, path)


def deconvolution_gains(study: Study, path: Path, *, cases: list[str], goals: dict[float, float], noise: float) -> None:
    """Draw the gain in PSNR over the blurred frame, and the share of frames made worse, over the length of the blur.

    goals: gain by length [px]; noise: of the cases [%].
    """
    figure, (panels,) = new_figure(1, 2, width=5.5, height=4.6)
    steps = study.steps("length_px", cases)
    groups = [[case for case in cases if study.conditions[case]["length_px"] == step] for step in steps]
    shown = {
        "psnr_above_blurred": ("PSNR above the blurred frame [dB], median", study.median),
        "made_worse_percent": ("frames made worse [%]", study.mean),
    }  # fmt: skip
    for panel, (metric, (label, statistic)) in zip(panels, shown.items(), strict=True):
        _lines(panel, study, steps, lambda name, n, m=metric, s=statistic: s(name, m, groups[n]), raw=False)
        panel.axhline(0, color="0.3", linewidth=1)
        panel.set(xlabel=f"length of the blur [px], noise {noise:g} %", ylabel=label)
        panel.grid(color="0.9")
    panels[0].plot(list(goals), list(goals.values()), "k_", markersize=14, label="goal of mmse")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=4, fontsize=7)
    save(figure, path)


def rendered(study: Study, path: Path, *, groups: dict[str, list[str]]) -> None:
    """Draw failures and the error of the field by group of rendered frames."""
    figure, (panels,) = new_figure(1, 2, width=6, height=4.6)
    places = list(range(len(groups)))
    found = list(groups.values())
    shown = {
        "failure_percent": ("failures [%]", study.mean),
        "field_error_px": ("error of the field [px], median", study.median),
    }  # fmt: skip
    for panel, (metric, (label, statistic)) in zip(panels, shown.items(), strict=True):
        _lines(panel, study, places, lambda name, n, m=metric, s=statistic: s(name, m, found[n]), joined=False)
        panel.set(ylabel=label)
        panel.set_xticks(places, list(groups), rotation=60, ha="right", fontsize=7)
        panel.grid(axis="y", color="0.9")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=4, fontsize=8)
    save(figure, path)


def _lines(
    panel, study: Study, steps: list, of: Callable[[str, int], float], *, raw: bool = True, joined: bool = True,
    floor: float | None = None,
) -> bool:  # fmt: skip
    """Draw of(method, number of the step) per method, as a line or, where steps are no scale, as points.

    Returns whether there are values below `floor`, which are drawn at it, marked.
    """
    below = False
    for index, method in enumerate(study.methods):
        if method == study.raw and not raw:
            continue
        heights = np.array([of(method, number) for number in range(len(steps))])
        if np.isnan(heights).all():
            continue
        own = method.endswith(OURS) or method == PRINTED
        yardstick, mark = {study.raw: ("--", "x"), study.oracle: ("-.", "+")}.get(method, (None, "o" if own else "."))
        style = yardstick or ("-" if index < len(_COLOURS) else ":")
        colour = "0.5" if yardstick else _COLOURS[index % len(_COLOURS)]
        panel.plot(
            steps, heights if floor is None else np.maximum(heights, floor), label=title(method), color=colour,
            linestyle=style if joined else "", linewidth=2.4 if own else 1.2, marker=mark,
        )  # fmt: skip
        if floor is not None and (low := heights < floor).any():
            below = True
            panel.plot(np.asarray(steps)[low], np.full(low.sum(), floor), _FLOOR_MARK, color=colour, markersize=8)
    return below
