"""Tables of the restoration page, as Markdown: scores per water, and printed tables with the numbers found here."""

import math
from statistics import fmean

from uwsim.bench.records import column_title, markdown_table, number, role
from uwsim.bench.restoration_page.printed import Printed, Table
from uwsim.bench.restoration_page.study import Study, joined
from uwsim.bench.study import title

COLUMNS = (
    "psnr", "ssim", "psnr_gain", "ssim_gain", "colour_difference", "colour_difference_gain", "mtf50_ratio",
    "usaf_transfer", "tags_found", "corner_error_px", "tag_pose_error_percent", "sift_matches", "orb_matches",
    "oracle_share", "oracle_share_gain", "milliseconds",
)  # fmt: skip
"""Metrics of the main tables."""
VARIANTS = {"uiqm": ("uiqm_m", "uiqm_f"), "uciqe": ("uciqe_o",), "psnr": ("psnr",), "ssim": ("ssim",)}
"""A printed metric's name -> what is measured for it here."""
_PLACES = {
    **dict.fromkeys(("psnr", "psnr_gain", "uiqm_m", "uiqm_f"), 2),
    **dict.fromkeys(("ssim", "ssim_gain", "uciqe_o", "oracle_share", "oracle_share_gain"), 3),
    **dict.fromkeys(("tags_found", "sift_matches", "orb_matches"), 1),
}  # fmt: skip
NONE = "-"


def shown(value: float, metric: str | None = None) -> str:
    """Return a score as text: with the decimals that its metric deserves, else four digits."""
    if math.isnan(value):
        return NONE
    if math.isinf(value):
        return "identical"
    return f"{value:.{_PLACES[metric]}f}" if metric in _PLACES else number(value)


def measured(study: Study) -> tuple[list[str], list[str]]:
    """Return (the metrics of the main tables that have a value in some case, those that have none)."""
    known = {record.metric for record in study.result.records if record.value is not None}
    return [name for name in COLUMNS if name in known], [name for name in COLUMNS if name not in known]


def scores(study: Study, water: str | None) -> str:
    """Return the table of all methods in a water (in all: None); the best restorer of a column is bold."""
    columns = [name for name in measured(study)[0] if any(_finite(study, name, water))]
    best = {name: _best(study, name, water) for name in columns}
    rows = []
    for method in study.methods:
        kind = role(study.result, method)
        cells = [f"{title(method)} ({kind})" if kind else title(method), ", ".join(study.given[method]) or NONE]
        for name in columns:
            text = shown(study.summary(method, name, water), name)
            cells.append(f"**{text}**" if text == best[name] and method in study.restorers else text)
        rows.append(cells)
    return markdown_table(
        ["method", "given", *(column_title(study.of_metric[name]) for name in columns)], rows, texts=2
    )


def _best(study: Study, metric: str, water: str | None) -> str | None:
    best = study.best(study.restorers, metric, water)
    return None if best is None else shown(study.summary(best, metric, water), metric)


def _finite(study: Study, metric: str, water: str | None) -> list[bool]:
    return [not math.isnan(study.summary(method, metric, water)) for method in study.methods]


def scenes(study: Study, table: Table, printed: Printed) -> str:
    """Return a table of chapter six: printed row and scene here side by side, one pair of columns per method."""
    metric = VARIANTS[table.metric][0]
    head, columns = ["image", "scene here"], []
    for column in table.columns:
        algorithm = _taking_part(study, printed, column)
        head += [f"{printed.name(column)} printed", *(["here"] if algorithm else [])]
        columns.append((column, algorithm))
    here = [(scene, study.case_of(scene, table.water)) for scene in study.scenes]
    here = [(scene, case) for scene, case in here if case is not None]
    rows = []
    for place in range(max(len(table.rows), len(here))):
        name = list(table.rows)[place] if place < len(table.rows) else NONE
        scene, case = here[place] if place < len(here) else (NONE, None)
        cells = [name, scene]
        for column, algorithm in columns:
            cells.append(f"{table.column(column)[place]:.2f}" if place < len(table.rows) else NONE)
            if algorithm:
                cells.append(NONE if case is None else shown(study.value(case, algorithm, metric), metric))
        rows.append(cells)
    means = ["mean", ""]
    for column, algorithm in columns:
        means.append(f"{table.mean(column):.2f}")
        if algorithm:
            found = [study.value(case, algorithm, metric) for _, case in here]
            known = [value for value in found if not math.isnan(value)]
            means.append(shown(fmean(known), metric) if known else NONE)
    return markdown_table(head, [*rows, means], texts=2)


def _taking_part(study: Study, printed: Printed, name: str) -> str | None:
    algorithm = printed.method(name).algorithm
    return algorithm if algorithm in study.methods else None


def by_method(study: Study, table: Table, printed: Printed, noise: dict[str, float]) -> str:
    """Return a table of chapter three: methods by row, printed on photographs, found here in each water.

    noise: the scores of white noise, which stand in the last row.
    """
    variants = [name for name in VARIANTS[table.metric] if name in study.of_metric]
    places = [(variant, water) for variant in variants for water in study.waters]
    head = ["method", *(f"{column}, printed" for column in table.columns)]
    head += [f"{title(variant)} here, {title(water)}" for variant, water in places]
    rows = []
    for name, numbers in table.rows.items():
        algorithm = _taking_part(study, printed, name)
        label = f"{name}: {title(algorithm)}" if algorithm else f"{name}: not measured"
        rows.append([label, *(f"{value:.2f}" for value in numbers), *_means(study, algorithm, places)])
    blanks = [NONE] * len(table.columns)
    rows.append([f"({title(study.raw)}: the picture as it is)", *blanks, *_means(study, study.raw, places)])
    rows.append(["(white noise)", *blanks, *(shown(noise[variant], variant) for variant, _ in places)])
    return markdown_table(head, rows)


def _means(study: Study, algorithm: str | None, places: list[tuple[str, str]]) -> list[str]:
    if algorithm is None:
        return [NONE] * len(places)
    return [shown(study.mean(algorithm, variant, water), variant) for variant, water in places]


def ablation_truth(study: Study, table: Table, printed: Printed) -> str:
    """Return what the rows of the ablation come to against the truth: PSNR and SSIM in each water."""
    places = [(metric, water) for metric in ("psnr", "ssim") if metric in study.of_metric for water in study.waters]
    rows = []
    for label, algorithm in [(study.raw, study.raw), *((row, _taking_part(study, printed, row)) for row in table.rows)]:
        if algorithm:
            name = label if label == algorithm else f"{label}: {title(algorithm)}"
            rows.append([name, *_means(study, algorithm, places)])
    return markdown_table(["row", *(f"{title(metric)}, {title(water)}" for metric, water in places)], rows)


def as_printed(table: Table, printed: Printed) -> str:
    """Return a table to which nothing here answers."""
    head = ["", *(printed.name(name) if name in table.method_names else name for name in table.columns)]
    return markdown_table(head, [[name, *(f"{value:.2f}" for value in row)] for name, row in table.rows.items()])


def notes(table: Table, printed: Printed) -> str:
    """Return what contradicts a table in print."""
    found = []
    for note in table.notes:
        places = [place for place in (note.row, note.column) if place]
        where = ", ".join(printed.name(place) if place in table.method_names else place for place in places)
        found.append(f"- {where}: {note.text}." if where else f"- {note.text[0].upper()}{note.text[1:]}.")
    return "\n".join(found)


def remarks(study: Study, tables: list[Table], printed: Printed) -> str:
    """Return what is measured here under the printed names of some tables, where that needs a word."""
    lines = []
    used = [name for table in tables for name in table.method_names]
    for name in dict.fromkeys(printed.name(one) for one in used):
        method = printed.methods[name]
        if method.algorithm is None:
            continue
        if method.algorithm not in study.methods:
            lines.append(f"- {name}: not measured: `{method.algorithm}` took no part in this run.")
        elif method.remark:
            lines.append(f"- {name}: `{method.algorithm}`; {method.remark}.")
    return "\n".join(lines)


def not_measured(printed: Printed) -> str:
    """Return the printed names for which there is nothing here, and why."""
    return "\n".join(
        f"- {name}: not measured: {method.not_measured}."
        for name, method in printed.methods.items()
        if method.not_measured
    )


def left_out(study: Study, printed: Printed) -> str:
    """Return a line on every metric and water that the page asks for and the result does not have.

    Also on methods without scores in some cases.
    """
    lines = []
    if absent := measured(study)[1]:
        lines.append(f"- Not in this result, so in no table: {joined([f'`{name}`' for name in absent])}.")
    wanted = dict.fromkeys(table.water for table in printed.table if table.water)
    if absent := [water for water in wanted if water not in study.waters]:
        names = joined([title(water) for water in absent])
        lines.append(f"- No case in {names}: tables and conclusions on these waters are left out.")
    for method in study.methods:
        if unscored := study.unscored(method):
            reasons = joined(list(dict.fromkeys(unscored.values())))
            lines.append(f"- {title(method)}: no scores in {len(unscored)} of {len(study.cases)} cases: {reasons}.")
    return "\n".join(lines)
