"""The dissertation's printed numbers on pose: benchmarks/printed/pose.toml as strict, frozen models."""

from functools import cache

from pydantic import model_validator

from uwsim.bench.restoration_page.printed import Name, Strict
from uwsim.files import read_toml, shipped
from uwsim.validation import validated, with_tuples

Span = tuple[float, float]
Rows = dict[Name, tuple[float, ...]]


class Table(Strict):
    """One of tables 5.1 to 5.5: mean errors of 90 real poses at a depth, rows by distance from the axis [mm]."""

    number: Name
    depth_mm: int
    rotation_deg: Rows
    translation_percent: Rows


class Number(Strict):
    """Errors that the text states of a figure, of the part of ours that answers to it.

    `value` of the sweep; without it, ranges over all of it.
    """

    place: Name
    figure: Name
    part: Name
    value: float | None = None
    rotation_deg: Span
    translation_percent: Span


class Claim(Strict):
    """A sentence of the text."""

    text: Name
    place: Name


class Printed(Strict):
    """All of the file."""

    source: Name
    columns: tuple[Name, ...]
    table: tuple[Table, ...]
    number: tuple[Number, ...]
    claims: dict[Name, Claim]

    @model_validator(mode="after")
    def _rows_agree(self):
        for table in self.table:
            for name, row in [*table.rotation_deg.items(), *table.translation_percent.items()]:
                if len(row) != len(self.columns):
                    raise ValueError(f"table {table.number}: row {name} has {len(row)}, allowed: {len(self.columns)}")
        for number in self.number:
            if any(low > high for low, high in (number.rotation_deg, number.translation_percent)):
                raise ValueError(f"number of figure {number.figure}: allowed: the smaller first")
        return self

    def rows(self, quantity: str) -> list[dict[str, float]]:
        """Return {method: error} of every row of the tables; quantity: rotation_deg or translation_percent."""
        found = [row for table in self.table for row in getattr(table, quantity).values()]
        return [dict(zip(self.columns, row, strict=True)) for row in found]

    def mean(self, quantity: str, method: str) -> float:
        """Return the mean of a method's column over the tables."""
        found = [row[method] for row in self.rows(quantity)]
        return sum(found) / len(found)


@cache
def printed() -> Printed:
    """Return the printed numbers; ValueError in one line if the file is broken."""
    path = shipped("benchmarks") / "printed" / "pose.toml"
    return validated(Printed, with_tuples(read_toml(path)), where=path)
