"""What was asked and what was claimed, held against the numbers: for the pages of the benchmarks."""

import math
from typing import NamedTuple

from uwsim.bench.records import markdown_table, number

NONE = "-"
YES, NO, PARTLY, OPEN = "borne out", "not borne out", "in part", "not measured"


class Goal(NamedTuple):
    """What is asked, what was found, and whether that meets it; None: not measured."""

    text: str
    found: str
    met: bool | None


class Verdict(NamedTuple):
    """Whether a claim holds, and the numbers that say so."""

    word: str
    numbers: str


def goal_table(goals: list[Goal]) -> str:
    """Return goals as a Markdown table."""
    verdicts = {True: "met", False: "**not met**", None: "not measured"}
    return markdown_table(["goal", "found", "verdict"], [[g.text, g.found, verdicts[g.met]] for g in goals], texts=3)


def shown(value: float, places: int | None = None) -> str:
    """Return a number as text: with so many decimals, else to four digits; "-" for none."""
    if not math.isfinite(value):
        return NONE
    return number(value) if places is None else f"{value:z.{places}f}"
