"""Results of a benchmark: one record per case, algorithm and metric, the same for every benchmark."""

import json
import math
import re
from collections.abc import Iterable
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from pydantic import ConfigDict

from uwsim.files import read_json, write_text
from uwsim.validation import validated

ARROWS = {"higher": "↑", "lower": "↓"}
TITLES = {
    "psnr": "PSNR", "mse": "MSE", "ssim": "SSIM", "psnr_gain": "PSNR, gain fitted", "ssim_gain": "SSIM, gain fitted",
    "colour_difference": "ΔE00", "colour_difference_gain": "ΔE00, gain fitted", "mtf50_ratio": "MTF50 / truth's",
    "usaf_transfer": "USAF transfer", "tags_found": "tags found", "sift_matches": "SIFT matches",
    "orb_matches": "ORB matches", "oracle_share": "oracle's share", "oracle_share_gain": "oracle's share, gain fitted",
    "uciqe_o": "UCIQE (O)", "uiqm_f": "UIQM (F)", "uiqm_m": "UIQM (M)", "failure_percent": "failures",
    "detected_percent": "detected", "psnr_inner": "PSNR, inner", "psnr_above_blurred": "PSNR above blurred",
    "milliseconds": "time", "microseconds_per_problem": "time by problem", "fail_percent": "failures",
    "rotation_ratio_to_ml": "rotation / ML*", "translation_ratio_to_ml": "translation / ML*",
    "missed_minimum_percent": "missed minimum", "no_pose_percent": "no pose", "exact_percent": "exact, no noise",
    "right_percent": "right poses", "wrong_percent": "wrong poses",
    "relative_radiance_error": "image error",
}  # fmt: skip
_NOTE_KEYS = ("case", "algorithm", "metric")
# below this an error is the round-off of the arithmetic
ROUND_OFF = 1e-9


@dataclass(frozen=True)
class Record:
    """One number. `given`: the truth that the algorithm was shown (its NEEDS).

    `value` is None where there is no finite number; `note` then says why ("identical images", "no estimate",
    "not installed: ..."). `case` is a frame, or a summary over cases ("all"; blur also "uniform", restoration also
    the names of waters): those that the provenance lists under `summaries`.
    """

    case: str
    algorithm: str
    given: tuple[str, ...]
    metric: str
    value: float | None
    unit: str
    better: str
    note: str = ""


@dataclass(frozen=True)
class Result:
    """The outcome of one run; `provenance` says of what, on what, with what."""

    benchmark: str
    provenance: dict
    records: tuple[Record, ...]
    __pydantic_config__ = ConfigDict(extra="forbid")

    def to_dict(self) -> dict:
        """Return what stands in the JSON file; notes on records stand in its provenance, under `notes`."""
        records, notes = [], []
        for record in self.records:
            entry = {**asdict(record), "given": list(record.given)}
            note = entry.pop("note")
            if note:
                notes.append({key: entry[key] for key in _NOTE_KEYS} | {"note": note})
            records.append(entry)
        return {"benchmark": self.benchmark, "provenance": self.provenance | {"notes": notes}, "records": records}

    def to_json(self) -> str:
        return json.dumps(self.to_dict(), indent=1, allow_nan=False) + "\n"

    def write(self, path: Path) -> None:
        """Write the JSON file: complete or absent."""
        write_text(path, self.to_json())


def result_from_dict(content: dict, where: str = "result") -> Result:
    """Return the Result of a parsed JSON file; ValueError in one line if it is none."""
    result = validated(Result, content, where=f"{where}: not a benchmark result")
    notes = {tuple(n.get(key) for key in _NOTE_KEYS): n.get("note", "") for n in result.provenance.get("notes", [])}
    records = [replace(r, note=notes.get(tuple(getattr(r, key) for key in _NOTE_KEYS), r.note)) for r in result.records]
    provenance = {key: value for key, value in result.provenance.items() if key != "notes"}
    return Result(result.benchmark, provenance, tuple(records))


def read_result(path: Path) -> Result:
    """Read a result file; ValueError in one line if it is missing or broken."""
    return result_from_dict(read_json(path), str(path))


def record_from_score(template: Record, score: float) -> Record:
    """Return the record of a score: +inf stands for identical images, NaN for no estimate (or what the note says)."""
    if math.isfinite(score):
        return replace(template, value=float(score))
    reason = (template.note or "no estimate") if math.isnan(score) else "identical images"
    return replace(template, value=None, note=reason)


def summarise(scores: list[float], statistic: str) -> tuple[float, str]:
    """Return the median or mean of the scores and a note.

    NaN (no estimate) is left out and counted in the note; +inf (identical images) takes part, so that a
    median is infinite only where the middle case is.
    """
    known = sorted(score for score in scores if not math.isnan(score))
    if not known:
        return math.nan, "no estimate"
    note = "" if len(known) == len(scores) else f"over {len(known)} of {len(scores)} cases"
    if statistic == "mean":
        return math.fsum(known) / len(known), note
    low, high = known[(len(known) - 1) // 2], known[len(known) // 2]
    return (low if low == high else (low + high) / 2), note


def role(result: Result, algorithm: str) -> str:
    """Return "do-nothing", "oracle" or "" as the benchmark's definition says."""
    definition = result.provenance.get("definition", {})
    for key, word in (("do_nothing", "do-nothing"), ("oracle", "oracle")):
        if definition.get(key) == algorithm:
            return word
    return ""


def summary_names(result: Result) -> list[str]:
    """Return the summaries that the result holds, "all" first."""
    present = {record.case for record in result.records}
    # results of earlier versions do not list them
    return [name for name in result.provenance.get("summaries", ("all", "uniform")) if name in present]


def table(result: Result, case: str = "all", *, further: bool = False) -> tuple[list[Record], list[list[Record]]]:
    """Return (a record per metric for the head, a row of records per algorithm) of a summary or a case.

    Without the metrics that the provenance lists under `further`, or these alone.
    """
    second = result.provenance.get("further", ())
    rows: dict[str, list[Record]] = {}
    for record in result.records:
        if record.case == case and (record.metric in second) == further:
            rows.setdefault(record.algorithm, []).append(record)
    if not rows:
        raise ValueError(f"{result.benchmark}: no records of case {case!r}")
    return next(iter(rows.values())), list(rows.values())


def markdown(result: Result) -> str:
    """Return the summaries as Markdown tables; do-nothing and oracle are marked.

    Metrics of the provenance's `further` stand in a table of their own, over all cases; below it its `findings`.
    """
    parts = []
    for case in summary_names(result):
        caption = f"{result.benchmark}, {case} cases" if case != "all" else result.benchmark
        parts.append(_summary(caption, result, *table(result, case)))
    if result.provenance.get("further"):
        parts.append(_summary(f"{result.benchmark}, further scores", result, *table(result, further=True)))
    for finding in result.provenance.get("findings", {}).values():
        parts.append(f"### {finding['caption']}\n\n{finding_table(finding)}\n")
    parts += [f"Note: {text}.\n" for text in result.provenance.get("cameras", [])]
    return "\n".join(parts)


def _summary(caption: str, result: Result, head: list[Record], rows: list[list[Record]]) -> str:
    lines = []
    for row in rows:
        kind = role(result, row[0].algorithm)
        name = f"{row[0].algorithm} ({kind})" if kind else row[0].algorithm
        lines.append([name, ", ".join(row[0].given) or "-", *(text(record) for record in row)])
    titles = ["algorithm", "given", *(column_title(record) for record in head)]
    return f"### {caption}\n\n{markdown_table(titles, lines, texts=2)}\n"


def markdown_table(head: list[str], rows: Iterable[Iterable[str]], *, texts: int = 1) -> str:
    """Return a Markdown table; all columns after the first `texts` are numbers."""
    lines = [head, ["---"] * texts + ["---:"] * (len(head) - texts), *rows]
    return "\n".join(_row(cells) for cells in lines)


def finding_table(finding: dict) -> str:
    """Return one of a result's `findings` as a Markdown table, without its caption."""
    return markdown_table(finding["head"], [map(cell, row) for row in finding["rows"]])


def cell(value: str | float | None) -> str:
    """Return a cell of a finding as text."""
    return value if isinstance(value, str) else "-" if value is None else number(value)


def column_title(record: Record) -> str:
    """Return "length error [px] ↓": the metric, its unit and which way is better."""
    title = TITLES.get(record.metric) or re.sub("_(px|deg|percent|mm)$", "", record.metric).replace("_", " ")
    unit = f" [{record.unit.replace('^2', '²')}]" if record.unit else ""
    return f"{title}{unit} {ARROWS.get(record.better, '')}".rstrip()


def text(record: Record) -> str:
    """Return a value to four significant digits, or the note where there is no number."""
    if record.value is None:
        return record.note or "-"
    return number(record.value)


def number(value: float) -> str:
    """Return a finite number to four significant digits, or as "< 1e-09" where it is round-off."""
    return "< 1e-9" if 0 < abs(value) < ROUND_OFF else f"{value:.4g}"


def _row(cells: Iterable[str]) -> str:
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"
