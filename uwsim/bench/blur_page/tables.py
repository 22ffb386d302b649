"""Tables of the blur page, as Markdown."""

from collections.abc import Callable, Iterable

import numpy as np

from uwsim.bench.blur_page.study import Study
from uwsim.bench.judged import NONE, shown
from uwsim.bench.records import column_title, markdown_table, role
from uwsim.bench.study import title


def labelled(study: Study, method: str) -> str:
    """Return a method's name, do-nothing and oracle marked."""
    kind = role(study.result, method)
    return f"{title(method)} ({kind})" if kind else title(method)


def overview(study: Study, metrics: Iterable[str], cases: list[str]) -> str:
    """Return the benchmark's statistics of some metrics over these cases, a row per method."""
    known = [name for name in metrics if name in study.of_metric]
    known = [name for name in known if any(study.values(method, name, cases).size for method in study.methods)]
    rows = [
        [labelled(study, method), *(shown(study.summary(method, name, cases)) for name in known)]
        for method in study.methods
    ]
    return markdown_table(["method", *(column_title(study.of_metric[name]) for name in known)], rows)


def spreads(study: Study, groups: dict[str, list[str]]) -> str:
    """Return median / 90th percentile of length [px] and angle [deg] errors and failures [%], by group of cases."""
    rows = []
    for method in study.methods:
        cells = []
        for cases in groups.values():
            lengths, angles = (study.values(method, name, cases) for name in ("length_error_px", "angle_error_deg"))
            failed = shown(study.mean(method, "failure_percent", cases), 0)
            cells.append("; ".join([_spread(lengths), _spread(angles), failed]))
        rows.append([labelled(study, method), *cells])
    return markdown_table(["method", *groups], rows)


def _spread(values: np.ndarray) -> str:
    if not values.size:
        return NONE
    return "/".join(f"{value:.2f}" if value < 10 else f"{value:.0f}" for value in np.quantile(values, (0.5, 0.9)))


def by_group(
    study: Study, groups: dict[str, list[str]], of: Callable[[str, list[str]], float], *, methods: list[str],
    places: int | None = None, caption: str = "method",
) -> str:  # fmt: skip
    """Return a number of each method and group of cases: of(method, cases)."""
    rows = [
        [labelled(study, method), *(shown(of(method, cases), places) for cases in groups.values())]
        for method in methods
    ]
    return markdown_table([caption, *groups], rows)


def groups_of(study: Study, key: str, cases: list[str], words: Callable[[object], str]) -> dict[str, list[str]]:
    """Return {words of a condition's value: the cases of it}, in ascending order."""
    return {
        words(value): [case for case in cases if study.conditions[case][key] == value]
        for value in study.steps(key, cases)
    }  # fmt: skip
