"""What each frame in motion was like, and tables of scores by such strata."""

import math
from collections.abc import Callable, Iterable

from uwsim.bench.kept import Scores
from uwsim.bench.records import summarise
from uwsim.dataset.frame import Frame
from uwsim.dataset.store import Dataset

SHOWN = {
    "failure_percent": "failures [%]", "length_error_px": "length error [px], median",
    "angle_error_deg": "angle error [deg], median", "field_error_px": "error of the field [px], median",
}  # fmt: skip
_LENGTHS_PX = (2.0, 5.0, 10.0, 20.0)
_VEILS_PERCENT = (10.0, 50.0)


def conditions(dataset: Dataset, cases: list[str]) -> dict[str, dict]:
    """Return what each case was like: group, water, motion, speed, label, share of backscatter in the light."""
    motions = {
        name: sequence.info.trajectory for sequence in dataset.sequences for name in sequence.frame_names()
    }  # fmt: skip
    return {name: _conditions(dataset.frame(name), motions.get(name, {})) for name in cases}


def _conditions(frame: Frame, trajectory: dict) -> dict:
    info, blur = frame.info, frame.info.blur
    light, veil = (float(frame.buffer(name).sum(dtype=float)) for name in ("radiance", "backscatter"))
    return {
        "group": info.group, "water": info.water.name, "motion": trajectory.get("kind", "straight"),
        "speed_percent": trajectory.get("speed_percent"), "length_px": blur.length_px, "angle_deg": blur.angle_deg,
        "spread_px": blur.spread_px, "uniform": blur.uniform,
        "veil_percent": 100 * veil / light if light > 0 else math.nan,
    }  # fmt: skip


def strata(found: dict[str, dict]) -> dict[str, list[str]]:
    """Return {stratum: cases} of conditions: by group, water, length, veil, and the arm's frames by speed."""
    ways: dict[str, Callable[[dict], str | None]] = {
        "group": lambda one: one["group"],
        "water": lambda one: one["water"],
        "length": lambda one: band(one["length_px"], _LENGTHS_PX, "px"),
        "veil": lambda one: band(one["veil_percent"], _VEILS_PERCENT, "% of the light"),
        "uniform": lambda one: "yes" if one["uniform"] else "no",
        "speed": lambda one: None if one["speed_percent"] is None else f"{one['motion']}, {one['speed_percent']:g} %",
    }
    groups: dict[str, list[str]] = {}
    for way, of in ways.items():
        values = {name: of(one) for name, one in found.items()}
        for value in sorted({value for value in values.values() if value is not None}, key=_by_number):
            groups[f"{way}: {value}"] = [name for name, other in values.items() if other == value]
    return groups


def band(value: float, edges: tuple[float, ...], unit: str) -> str:
    """Return "5 to 10 px": between which edges a value lies, the lower one included."""
    above = [edge for edge in edges if value >= edge]
    below = [edge for edge in edges if value < edge]
    if not above:
        return f"below {edges[0]:g} {unit}"
    return f"{above[-1]:g} to {below[0]:g} {unit}" if below else f"{above[-1]:g} {unit} and more"


def _by_number(text: str) -> tuple:
    words = text.replace(",", " ").split()
    numbers = [float(word) for word in words if word.replace(".", "", 1).isdigit()]
    # "below 2 px" comes before "2 to 5 px"
    return (words[0] if words[0].isalpha() and words[0] != "below" else "", numbers[:1], words[0] != "below", text)


def findings(dataset: Dataset, scores: dict[str, Scores]) -> dict[str, dict]:
    """Return a table of each of SHOWN by stratum: how many cases, and each algorithm's summary."""
    groups = strata(conditions(dataset, list(scores)))
    return {f"{metric}_by_stratum": by_group(groups, scores, metric, words) for metric, words in SHOWN.items()}


def by_group(groups: dict[str, Iterable[str]], scores: dict[str, Scores], metric: str, words: str) -> dict:
    """Return the finding of a metric by groups of cases: a row each, a column per algorithm."""
    names = list(dict.fromkeys(name for case in scores.values() for name in case))
    statistic = "mean" if metric.endswith("_percent") else "median"
    rows = []
    for group, cases in groups.items():
        values = [summarise([scores[case][name][metric] for case in cases], statistic)[0] for name in names]
        rows.append([group, len(list(cases)), *(value if math.isfinite(value) else None for value in values)])
    return {"caption": f"{words[0].upper()}{words[1:]}", "head": ["cases of", "number", *names], "rows": rows}
