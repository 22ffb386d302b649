"""The dissertation's printed numbers on motion blur: benchmarks/printed/blur.toml as strict, frozen models."""

from functools import cache
from typing import Literal

from pydantic import model_validator

from uwsim.bench.restoration_page.printed import Method, Name, Strict
from uwsim.bench.restoration_page.printed import Table as AnyTable
from uwsim.files import read_toml, shipped
from uwsim.validation import validated, with_tuples

PICTURES = ("boulder", "pebbles")


class Table(AnyTable):
    """Part of table 4.2: one metric of one picture, rows by blur length [px]."""

    picture: Literal[PICTURES]

    def gain(self, length: str) -> float:
        """Return what the proposed method has above UFPDeblur at a length."""
        row = dict(zip(self.columns, self.rows[length], strict=True))
        return row["Proposed"] - row["UFPDeblur"]

    @property
    def gains(self) -> dict[int, float]:
        return {int(length): self.gain(length) for length in self.rows}


class Picture(Strict):
    """A row of table 4.1, and the texture that stands for it here."""

    standard_deviation: float
    stands_for: Name


class Claim(Strict):
    """A sentence of the text; `value`: the number in it that is not a cell of a table."""

    text: Name
    place: Name
    value: float | None = None


class Printed(Strict):
    """All of the file."""

    source: Name
    pictures: dict[Literal[PICTURES], Picture]
    runtime_s: dict[Name, dict[Literal[PICTURES], float]]
    methods: dict[Name, Method]
    claims: dict[Name, Claim]
    table: tuple[Table, ...]

    @model_validator(mode="after")
    def _methods_are_known(self):
        for name in {name for table in self.table for name in table.method_names} | set(self.runtime_s):
            if name not in self.methods:
                raise ValueError(f"method {name!r}, allowed: {', '.join(self.methods)}")
        return self

    def of(self, metric: str, picture: str) -> Table:
        """Return the part of table 4.2 of a metric and a picture."""
        return next(table for table in self.table if (table.metric, table.picture) == (metric, picture))

    def parts(self, metric: str) -> list[Table]:
        """Return the parts of table 4.2 of a metric, in the order of PICTURES."""
        return [self.of(metric, picture) for picture in PICTURES]


@cache
def printed() -> Printed:
    """Return the printed numbers; ValueError in one line if the file is broken."""
    path = shipped("benchmarks") / "printed" / "blur.toml"
    return validated(Printed, with_tuples(read_toml(path)), where=path)
