"""What is asked of poses from pictures, and the dissertation's claims on its real ones, held against rendered ones."""

import math

from uwsim.bench.judged import NO, OPEN, PARTLY, YES, Goal, Verdict, shown
from uwsim.bench.pnp_page.printed import Printed
from uwsim.bench.pose_page.study import (
    BEST,
    ERRORS,
    IGNORING,
    PRINTED,
    REFINED,
    SEARCHED,
    TABLES,
    TEN,
    THICK,
    PictureStudy,
)

CLEAR = "tank_clear"
FOUND_PERCENT, RIGHT_PERCENT = 99.0, 95.0
COVERED_PERCENT = (80.0, 98.0)
_SAME = 1.05
OFF_AXIS_DEG, OFF_AXIS_PERCENT = 0.7, 1.0


def of_pictures(known: Printed, study: PictureStudy) -> list[Goal]:
    """Return the goals, detection first."""
    clear = study.cases(group=TABLES, water=CLEAR)
    found = study.mean(REFINED, "points_found_percent", clear)
    covered = study.mean(REFINED, "points_covered_percent", clear)
    low, high = COVERED_PERCENT
    right = [study.value(case, SEARCHED, "points_right_percent") for case in study.cases(group=TEN)]
    share = 100.0 * sum(one >= 100 for one in right) / len(right) if right else math.nan
    return [
        _goal(f"clear water: spheres found >= {FOUND_PERCENT:g} %", found, found >= FOUND_PERCENT, "%"),
        _goal(f"clear water: centres in their 90 % ellipses {low:g} to {high:g} %", covered, low <= covered <= high,
              "%"),
        _goal(f"ten points: all names right by the search in >= {RIGHT_PERCENT:g} % of the pictures", share,
              share >= RIGHT_PERCENT, "%"),
        _rows_met(known, study),
        *(_less(study, first, second, group) for first, second, group in (
            (REFINED, BEST, THICK), (BEST, IGNORING, THICK), (REFINED, BEST, TABLES))),
    ]  # fmt: skip


def _goal(text: str, value: float, met: bool, unit: str) -> Goal:
    return Goal(text, "-", None) if math.isnan(value) else Goal(text, f"{shown(value, 2)} {unit}", bool(met))


def _rows_met(known: Printed, study: PictureStudy) -> Goal:
    """Whether the mean errors with the port's geometry are at most those printed, row by row."""
    text = f"{REFINED}: mean errors at most those printed of Ours, in each row of tables 5.1 to 5.5"
    met, count, place = 0, 0, known.columns.index("Ours")
    for table in known.table:
        for quantity, metric in zip(("rotation_deg", "translation_percent"), ERRORS, strict=True):
            for aside, printed in getattr(table, quantity).items():
                own = study.mean(REFINED, metric, study.row(table.depth_mm, int(aside)))
                if not math.isnan(own):
                    count, met = count + 1, met + (own <= printed[place])
    return Goal(text, f"{met} of {count} entries", met == count) if count else Goal(text, "-", None)


def _less(study: PictureStudy, first: str, second: str, group: str) -> Goal:
    cases = study.cases(group=group)
    pairs = [[study.median(name, metric, cases) for name in (first, second)] for metric in ERRORS]
    text = f"{first} at most as far off as {second}, group {group}: medians, rotation and translation"
    if any(math.isnan(value) for pair in pairs for value in pair):
        return Goal(text, "-", None)
    words = "; ".join(f"{shown(own, 3)} by {shown(other, 3)}" for own, other in pairs)
    return Goal(text, words, all(own <= other for own, other in pairs))


def claims(known: Printed, study: PictureStudy) -> dict[str, Verdict]:
    """Return the verdicts on the claims about real pictures, on rendered ones."""
    return {name: rule(study) for name, rule in _RULES.items() if name in known.claims}


def _consistent(study: PictureStudy) -> Verdict:
    cases = study.cases(group=TABLES)
    flags, texts = [], []
    for metric, unit in zip(ERRORS, ("deg", "%"), strict=True):
        means = {name: study.mean(name, metric, cases) for name in (PRINTED, "opnp", "lhm", "rpnp", "dls")}
        if any(map(math.isnan, means.values())):
            return Verdict(OPEN, "no such run here")
        flags += [means[PRINTED] <= _SAME * mean for mean in means.values()]
        texts.append(", ".join(f"{name} {mean:.2f}" for name, mean in means.items()) + f" {unit}")
    return Verdict(_word(flags), f"means over the rendered rows: {'; '.join(texts)}")


def _off_axis(study: PictureStudy) -> Verdict:
    spans = []
    for metric in ERRORS:
        of_depth = []
        for far in study.steps("distance_mm", study.cases(group=TABLES)):
            cases = study.cases(group=TABLES, distance_mm=far)
            means = [study.mean(PRINTED, metric, study.row(far, aside)) for aside in study.steps("off_axis_mm", cases)]
            of_depth.append(max(means) - min(means))
        if not of_depth or any(map(math.isnan, of_depth)):
            return Verdict(OPEN, "no such run here")
        spans.append(max(of_depth))
    flags = [spans[0] <= OFF_AXIS_DEG, spans[1] <= OFF_AXIS_PERCENT]
    return Verdict(_word(flags), f"here at most {spans[0]:.2f} deg and {spans[1]:.2f} % by offset")


def _word(flags: list[bool]) -> str:
    return YES if all(flags) else PARTLY if any(flags) else NO


_RULES = {"consistent": _consistent, "off_axis_real": _off_axis}
