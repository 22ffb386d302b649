"""Tables of the pose page, as Markdown."""

import math

from uwsim.bench.judged import NONE, shown
from uwsim.bench.pnp_page.study import BEST, PARALLEL, PARTS, PRINTED, PoseStudy, Ratio, name_of
from uwsim.bench.records import markdown_table

COMPARED = (
    (PRINTED, PARALLEL), (PRINTED, "epnp_gn"), (PRINTED, "opnp"), (PARALLEL, "iepnp"),
    ("paraperspective", "weak_perspective"), ("opnp", None), (PRINTED, None), ("parallel_covariance", None),
    ("paraperspective_lm", None), (BEST, None), (BEST, "opnp"), ("opencv_sqpnp", None), ("poselib", None),
)  # fmt: skip
"""Pairs of solvers that geometric means are given of; None: ML*."""
_FAILS = ("epnp_gn", "iepnp", PARALLEL, PRINTED, "opnp", BEST)
_SHARES = {
    "fail_percent": "failed", "missed_minimum_percent": "missed the least minimum", "no_pose_percent": "no pose"
}  # fmt: skip


def ratio_text(ratio: Ratio, *, interval: bool = True) -> str:
    """Return "1.013 (1.008-1.018)", with the number of settings where some are left out."""
    if math.isnan(ratio.value):
        return NONE
    text = f"{ratio.value:.3f}" if ratio.value < 10 else f"{ratio.value:.3g}"
    text += f" ({ratio.low:.3f}-{ratio.high:.3f})" if interval else ""
    return text if ratio.count == ratio.of else f"{text}, {ratio.count} of {ratio.of}"


def means(study: PoseStudy) -> str:
    """Return geometric means of ratios of medians, rotation / translation, by group of settings."""
    groups, rows = study.groups(), []
    for first, second in COMPARED:
        second = second or study.oracle
        if first not in study.methods or second not in study.methods:
            continue
        cells = [
            "<br>".join(ratio_text(study.ratio(first, second, part, cases)) for part in PARTS)
            for cases in groups.values()
        ]
        rows.append([f"{name_of(first)} / {name_of(second)}", *cells])
    return markdown_table(["comparison", *(f"{words} ({len(cases)})" for words, cases in groups.items())], rows)


def shares(study: PoseStudy) -> str:
    """Return shares of problems [%] by group of settings: failed, missed, without a pose."""
    groups = study.groups()
    rows = [
        [name_of(method), *("; ".join(shown(study.mean(method, key, cases), 2) for key in _SHARES)
                            for cases in groups.values())]
        for method in study.methods if method != study.raw
    ]  # fmt: skip
    return markdown_table([f"{'; '.join(_SHARES.values())} [%]", *groups], rows)


def fails(study: PoseStudy) -> str:
    """Return shares of failed problems [%] of the solvers that the dissertation is about."""
    groups = study.groups()
    rows = [
        [name_of(method), *(shown(study.mean(method, "fail_percent", cases), 2) for cases in groups.values())]
        for method in _FAILS if method in study.methods
    ]  # fmt: skip
    return markdown_table(["failed [%]", *groups], rows)


def to_ml(study: PoseStudy, cases: list[str], methods: list[str]) -> str:
    """Return each solver's ratios to ML* in some settings, rotation / translation, with their bootstrap intervals."""
    rows = []
    for case in cases:
        cells = []
        for method in methods:
            texts = []
            for part in PARTS:
                value, low, high = (
                    study.value(case, method, f"{part}_ratio_{end}") for end in ("to_ml", "low", "high")
                )
                texts.append(NONE if math.isnan(value) else f"{value:.3f} ({shown(low, 3)}-{shown(high, 3)})")
            cells.append("<br>".join(texts))
        rows.append([case, *cells])
    return markdown_table(["setting", *map(name_of, methods)], rows)


def exact(study: PoseStudy) -> str:
    """Return the share of noise-free problems solved exactly [%], by setting."""
    cases = [case for case in study.cases() if study.conditions[case]["noise_px"] == 0]
    if not cases:
        return "No setting without noise was run."
    groups: dict[str, list[str]] = {}
    for case in cases:
        groups.setdefault(study.conditions[case]["layout"], []).append(case)
    rows = [
        [name_of(method), *(shown(study.mean(method, "exact_percent", some), 2) for some in groups.values())]
        for method in study.methods if method != study.raw
    ]  # fmt: skip
    return markdown_table(["exact without noise [%]", *groups], rows)


def speeds(study: PoseStudy, *, peer: str = "opencv_sqpnp") -> str:
    """Return CPU times by problem [us], of many problems of six points and by number of points."""
    times = study.part("time")
    few = [case for case in times if study.conditions[case]["points"] in (4, 8, 24, 64, 104)]
    cases = {case: f"n = {study.conditions[case]['points']}" for case in few}
    rows = []
    for method in study.methods:
        many = study.speed(method)
        rows.append([
            name_of(method), shown(many, 1), shown(many / study.speed(peer), 2),
            *(shown(study.value(case, method, "microseconds_per_problem"), 1) for case in cases),
        ])  # fmt: skip
    return markdown_table(["solver", "n = 6, many", f"by {name_of(peer)}'s", *cases.values()], rows)
