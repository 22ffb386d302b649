"""Benchmark tables that sort, and plots of the scores."""

from uwsim.bench.page.markup import cell, escape, paragraph, sortable_table
from uwsim.bench.page.plots import score_plots
from uwsim.bench.records import TITLES, Record, Result, column_title, role, summary_names, table, text
from uwsim.bench.records import cell as words
from uwsim.dataset.store import Dataset

PLOTTED = {
    "restoration": ("psnr", "ssim"),
    "blur": ("length_error_px", "angle_error_deg"),
    "pose": ("rotation_error_deg", "translation_error_percent"),
}
_WHICH = {"all": "all cases", "uniform": "cases in which the whole picture moves alike"}


def benchmark(result: Result, dataset: Dataset) -> str:
    """Return heading, description, summary tables, plots and the table of cases of one result."""
    definition = result.provenance.get("definition", {})
    parts = [f"<h3>{escape(result.benchmark)}</h3>", paragraph(definition.get("description", ""))]
    parts += [summary_table(result, case) for case in summary_names(result)]
    if result.provenance.get("further"):
        parts.append(summary_table(result, "all", further=True))
    parts += [_finding(finding) for finding in result.provenance.get("findings", {}).values()]
    parts.append(paragraph(_how(result), "note"))
    parts += [paragraph(f"{note[0].upper()}{note[1:]}.", "note") for note in result.provenance.get("cameras", [])]
    plotted = PLOTTED.get(definition.get("task", result.benchmark), ())
    parts += [score_plots(result, dataset, plotted), cases_table(result)]
    return "".join(parts)


def _finding(finding: dict) -> str:
    heads = [(text, number > 0) for number, text in enumerate(finding["head"])]
    rows = [
        [cell(escape(words(value)), numeric=not isinstance(value, str)) for value in row] for row in finding["rows"]
    ]
    return sortable_table(heads, rows, finding["caption"], kind="short")


def summary_table(result: Result, case: str, *, further: bool = False) -> str:
    """Return a summary: one row per algorithm, do-nothing and oracle marked, the best method in bold."""
    head, rows = table(result, case, further=further)
    heads = [("algorithm", False), ("given", False), *((column_title(record), True) for record in head)]
    best = [_best(result, [row[index] for row in rows]) for index in range(len(head))]
    body = []
    for row in rows:
        kind = role(result, row[0].algorithm)
        badge = f'<span class="badge">{escape(kind)}</span>' if kind else ""
        cells = [cell(escape(row[0].algorithm) + badge), cell(escape(", ".join(row[0].given) or "-"))]
        body.append(cells + [_score(record, record is best[index]) for index, record in enumerate(row)])
    which = f"{_WHICH.get(case, case)}{', further scores' if further else ''}"
    return sortable_table(heads, body, f"{result.benchmark}, {which}")


def cases_table(result: Result) -> str:
    """Return every case and algorithm, folded away."""
    summaries = summary_names(result)
    rows: dict[tuple[str, str], list[Record]] = {}
    for record in result.records:
        if record.case not in summaries:
            rows.setdefault((record.case, record.algorithm), []).append(record)
    if not rows:
        return ""
    first = next(iter(rows.values()))
    heads = [("case", False), ("algorithm", False), *((column_title(record), True) for record in first)]
    body = [
        [cell(escape(case)), cell(escape(name)), *(_score(record, False) for record in records)]
        for (case, name), records in rows.items()
    ]
    label = f"{result.benchmark}, case by case"
    return f"<details><summary>{escape(label)}</summary>{sortable_table(heads, body, label)}</details>"


def _score(record: Record, best: bool) -> str:
    kind = "best" if best else ("missing" if record.value is None else "")
    # identical images have no finite score, and none is better: they sort as infinite
    value = record.value
    if value is None and record.note.startswith("identical"):
        value = float("inf")
    return cell(escape(text(record)), value=value, kind=kind, numeric=True)


def _best(result: Result, column: list[Record]) -> Record | None:
    """Return the best record of a column among the methods proper; None if they tie or there is one."""
    methods = [record for record in column if record.value is not None and not role(result, record.algorithm)]
    if len(methods) < 2:
        return None
    values = sorted((record.value for record in methods), reverse=methods[0].better == "higher")
    if values[0] == values[1]:
        return None
    return next(record for record in methods if record.value == values[0])


def _how(result: Result) -> str:
    """Return in words what the numbers are: statistic, cases, dataset."""
    provenance = result.provenance
    statistics = provenance.get("statistics", {}).items()
    means = [TITLES.get(name, name) for name, statistic in statistics if statistic == "mean"]
    count = provenance.get("cases", "?")
    words = "Median over the cases"
    words += f", for {', '.join(means)} the mean. " if means else ". "
    words += f"{count} {'case' if count == 1 else 'cases'}{' (quick run)' if provenance.get('quick') else ''}"
    dataset = provenance.get("dataset")
    if dataset:
        words += f" of dataset {dataset['name']}, seed {dataset['seed']}, dataset.json {dataset['sha256'][:12]}"
    return words + ". An arrow shows which way is better; given: the truth that the algorithm was shown."
