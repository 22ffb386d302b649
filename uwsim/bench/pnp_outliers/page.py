"""The page of poses among outliers: README.md, a figure and JSON in one folder; its numbers are the records'."""

import math
from pathlib import Path

import numpy as np

from uwsim.bench.canvas import new_figure, save
from uwsim.bench.judged import NONE, shown
from uwsim.bench.records import Result, markdown_table
from uwsim.bench.study import StudyByCondition, title
from uwsim.files import write_text

TASKS = ("pnp_outliers",)
JSON, FIGURE = "pnp_outliers.json.gz", "outliers.png"
_SHARES = {"right_percent": "right", "wrong_percent": "wrong", "no_pose_percent": "no pose"}
_RATIOS = ("rotation", "translation")
_DRAWN = {"right_percent": "right poses [%]", "rotation_error_deg": "rotation error [deg], median",
          "translation_error_percent": "translation error [%], median"}  # fmt: skip
_MARKERS = "osv^D*"
_COLOURS = ("#7f7f7f", "#ff7f0e", "#2ca02c", "#1f77b4", "#d62728", "#000000")


def write(folder: Path, *, result: Result, dataset: object) -> Path:
    """Write figure, JSON and the page of a result; return the page."""
    folder, study = Path(folder), StudyByCondition(result)
    folder.mkdir(exist_ok=True)
    draw(study, folder / FIGURE)
    result.write(folder / JSON)
    page = folder / "README.md"
    write_text(page, text(study))
    return page


def text(study: StudyByCondition) -> str:
    """Return the page."""
    origin = study.result.provenance
    made = study.definition["outliers"]
    trials = sorted({one["trials"] for one in study.conditions.values()})
    parts = [
        "# Pose from points with outliers among them", _INTRODUCTION,
        f"{len(study.cases())} settings of {' or '.join(map(str, trials))} problems; seed {made['seed']}. Good points "
        f"have {made['noise_px']:g} px of noise at a focal length of {made['focal_px']:g} px; solvers are told that "
        f"points off by more than {made['threshold_std']:g} standard deviations are outliers."
        + (" **A quick run**: few problems." if origin["quick"] else ""),
        _absent(study), f"![Right poses and errors over the share of outliers]({FIGURE})",
        "## Right, wrong, no pose", f"{'; '.join(_SHARES.values())}, in percent of the problems, by share of outliers.",
        *_by_part(study, _shares),
        "## Errors", "Median errors over those of ML*, rotation above translation, with paired bootstrap intervals of "
        "95 %; a problem without a pose counts as an infinite error.",
        *_by_part(study, _ratios),
        "## Time", "CPU time by problem [ms]: one problem at a time, but for the do-nothing entry.",
        *_by_part(study, _time),
        "## How it is measured", _METHOD,
    ]  # fmt: skip
    return "\n\n".join(part for part in parts if part) + "\n"


def _absent(study: StudyByCondition) -> str:
    found = {one.algorithm: one.note for one in study.result.records if one.note.startswith("not installed")}
    return "\n".join(f"- `{name}`: {note}." for name, note in found.items())


def _parts(study: StudyByCondition) -> dict[str, list[str]]:
    """Return {part: its settings}, in order."""
    found: dict[str, list[str]] = {}
    for case, one in study.conditions.items():
        found.setdefault(one["part"], []).append(case)
    return found


def _words(condition: dict) -> str:
    kind = f"{condition['points']} points, {'flat' if condition['flat'] else 'solid'}"
    return f"{kind}, images of outliers {'swapped' if condition['wrong'] == 'swapped' else 'anywhere'}"


def _by_part(study: StudyByCondition, cell) -> list[str]:
    """Return a caption and a table by part: a row by method, a column by share of outliers."""
    texts = []
    for cases in _parts(study).values():
        heads = [f"{study.conditions[case]['outliers_percent']:g} %" for case in cases]
        rows = [[_name(study, method), *(cell(study, case, method) for case in cases)] for method in study.methods]
        texts += [f"{_words(study.conditions[cases[0]])}:", markdown_table(["outliers", *heads], rows)]
    return texts


def _name(study: StudyByCondition, method: str) -> str:
    kind = {study.raw: " (do-nothing)", study.oracle: " (oracle)"}.get(method, "")
    return f"`{method}`{kind}"


def _shares(study: StudyByCondition, case: str, method: str) -> str:
    values = [study.value(case, method, key) for key in _SHARES]
    return NONE if any(map(math.isnan, values)) else "; ".join(f"{value:.3g}" for value in values)


def _ratios(study: StudyByCondition, case: str, method: str) -> str:
    texts = []
    for part in _RATIOS:
        value, low, high = (study.value(case, method, f"{part}_ratio_{end}") for end in ("to_ml", "low", "high"))
        known = "" if math.isnan(high) else f" ({_ratio(low)}-{_ratio(high)})"
        texts.append(NONE if math.isnan(value) else f"{_ratio(value)}{known}")
    return "<br>".join(texts)


def _ratio(value: float) -> str:
    return f"{value:.2f}" if value < 10 else f"{value:.3g}"


def _time(study: StudyByCondition, case: str, method: str) -> str:
    return shown(study.value(case, method, "microseconds_per_problem") / 1000, 2)


def draw(study: StudyByCondition, path: Path) -> None:
    """Write the figure: right poses and median errors over the share of outliers, a column by part."""
    parts = _parts(study)
    figure, panels = new_figure(len(_DRAWN), len(parts), width=3.4, height=2.5, sharex=True, sharey="row")
    for column, cases in zip(panels.T, parts.values(), strict=True):
        shares = [study.conditions[case]["outliers_percent"] for case in cases]
        for panel, (metric, label) in zip(column, _DRAWN.items(), strict=True):
            for index, method in enumerate(study.methods):
                heights = np.array([study.value(case, method, metric) for case in cases])
                panel.plot(
                    shares, heights, label=title(method), color=_COLOURS[index % len(_COLOURS)],
                    marker=_MARKERS[index % len(_MARKERS)], markersize=4, linewidth=1.2,
                    linestyle="-" if method not in (study.raw, study.oracle) else "--",
                )  # fmt: skip
            panel.grid(color="0.9")
            if metric != "right_percent":
                panel.set_yscale("log")
            if panel in panels[:, 0]:
                panel.set_ylabel(label)
        column[0].set_title(_words(study.conditions[cases[0]]).replace(", images", "\nimages"), fontsize=9)
        column[-1].set_xlabel("outliers [%]")
    figure.legend(*panels[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=6, fontsize=8)
    save(figure, path, dpi=90)


_INTRODUCTION = """Points of which some have wrong images, and who still finds the pose. Made by
`uwsim bench pnp_outliers --out DIR`; all numbers are in `pnp_outliers.json.gz` (one record per setting, solver and
metric), the settings in `benchmarks/pnp_outliers.toml`. `robust` is `uwsim.pose.robust.solve_robust` as it is,
`opencv_ransac` is `cv2.solvePnPRansac` as it is and, `opencv_ransac_2000`, with more draws; `all_points` is `best` on
everything, `oracle_inliers` is `best` on the good points alone."""

_METHOD = """- ML*: the least reprojection error of the good points reached from the true pose. Every problem of a
  setting has as many outliers.
- Right: turn and shift below five times the 95 % quantiles of ML*'s errors in that setting; wrong: a pose that is not
  right; no pose: the solver says so. A wrong pose is worse than none.
- Solid targets fill the box before the camera, flat ones lie in a square of 0.6 m, in any rotation; each problem has
  its own. Images of outliers are drawn evenly over +-0.5 on the plane z = 1, or swapped with those of other outliers.
- Good points beyond the threshold, one in a hundred, are outliers to a solver: why its errors may be above ML*'s.
- Intervals: percentiles of a paired bootstrap, the same draws for every solver. Time: one call of the whole setting."""
