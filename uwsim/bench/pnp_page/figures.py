"""The dissertation's figures 5.4 to 5.28 as ours: the same axes, ML* and the bound drawn in."""

import math
from pathlib import Path

import numpy as np

from uwsim.bench.canvas import new_figure, save
from uwsim.bench.pnp_page.study import BEST, ERRORS, MEANS, PARTS, PRINTED, PoseStudy, name_of

LABELS = {
    "noise_px": "noise, standard deviation [px]", "depth_ratio": "depth / edge", "depth_m": "depth [m]",
    "off_axis_m": "distance from the optical axis [m]", "angle_deg": "angle about y [deg]", "points": "points",
}  # fmt: skip
_UNITS = {"rotation": "rotation error [deg]", "translation": "translation error [%]"}
_LOWEST, _HIGHEST = 1e-3, 2e2
# as many colours as shapes have no common divisor: no two of the solvers look alike
_COLOURS = (
    "#d62728",
    "#1f77b4",
    "#2ca02c",
    "#ff7f0e",
    "#9467bd",
    "#17becf",
    "#8c564b",
    "#e377c2",
    "#7f7f7f",
    "#bcbd22",
)
_MARKERS = "osv^<>DPX*h"


def names(study: PoseStudy) -> dict[str, str]:
    """Return {figure, such as "5.4": file} of those that the result has settings of, in order."""
    found = {one["figure"] for one in study.conditions.values()} - {None}
    return {figure: f"figure_{_key(figure)[0]}_{_key(figure)[1]:02d}.png" for figure in sorted(found, key=_key)}


def _key(figure: str) -> tuple[int, int]:
    chapter, number = figure.split(".")
    return int(chapter), int(number)


def draw(study: PoseStudy, folder: Path) -> None:
    """Write the file of each figure."""
    for figure, name in names(study).items():
        cases = study.cases(figure=figure)
        if study.conditions[cases[0]]["sweep"] == "points":
            _times(study, folder / name, cases)
        else:
            _errors(study, folder / name, [case for case in cases if study.conditions[case]["noise_px"] > 0])


def _errors(study: PoseStudy, path: Path, cases: list[str]) -> None:
    """Draw medians above means, rotation beside translation."""
    figure, panels = new_figure(2, 2, width=5.2, height=3.1, sharex=True)
    sweep = study.conditions[cases[0]]["sweep"]
    by_ratio = sweep == "depth_m" and study.conditions[cases[0]]["depth_ratio"] is not None
    key = "depth_ratio" if by_ratio else sweep
    steps = [study.conditions[case][key] for case in cases]
    for row, (words, metrics) in zip(panels, (("median", ERRORS), ("mean", MEANS)), strict=True):
        for panel, part in zip(row, PARTS, strict=True):
            for index, method in enumerate(study.methods):
                heights = [study.value(case, method, metrics[part]) for case in cases]
                _line(panel, study, method, index, steps, heights)
            if words == "median":
                panel.plot(steps, [study.bound(case, part) for case in cases], "k:", linewidth=2, label="bound")
            panel.set(ylabel=f"{_UNITS[part]}, {words}", yscale="log")
            panel.set_ylim(*_limits(panel))
            panel.grid(color="0.9")
    for panel in panels[1]:
        panel.set_xlabel(LABELS[key])
    figure.legend(*panels[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=6, fontsize=7)
    save(figure, path, dpi=80)


def _limits(panel) -> tuple[float, float]:
    """Return limits around what is drawn and is neither round-off nor beyond all measure."""
    heights = np.concatenate([np.asarray(line.get_ydata(), float) for line in panel.lines])
    shown = heights[(heights >= _LOWEST) & (heights <= _HIGHEST)]
    return (0.8 * shown.min(), 1.25 * shown.max()) if shown.size else (_LOWEST, _HIGHEST)


def _times(study: PoseStudy, path: Path, cases: list[str]) -> None:
    figure, ((panel,),) = new_figure(1, 1, width=10.4, height=4.6)
    steps = [study.conditions[case]["points"] for case in cases]
    for index, method in enumerate(study.methods):
        heights = [study.value(case, method, "microseconds_per_problem") for case in cases]
        _line(panel, study, method, index, steps, heights)
    panel.set(xlabel=LABELS["points"], ylabel="CPU time by problem [us]", yscale="log")
    panel.grid(color="0.9")
    figure.legend(*panel.get_legend_handles_labels(), loc="outside lower center", ncols=6, fontsize=7)
    save(figure, path, dpi=80)


def _line(panel, study: PoseStudy, method: str, index: int, steps: list[float], heights: list[float]) -> None:
    if all(map(math.isnan, heights)) or method == study.raw:
        return
    oracle, own = method == study.oracle, method in (BEST, PRINTED)
    panel.plot(
        steps, np.array(heights), label=name_of(method), color="k" if oracle else _COLOURS[index % len(_COLOURS)],
        linestyle="-" if own or oracle else "--", linewidth=2.2 if own else 1.0,
        marker=_MARKERS[index % len(_MARKERS)], markersize=5 if own else 4,
    )  # fmt: skip
