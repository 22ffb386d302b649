"""The dissertation's printed numbers: benchmarks/printed/restoration.toml as strict, frozen models."""

import math
from functools import cache
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

from uwsim.files import read_toml, shipped
from uwsim.validation import validated, with_tuples

Name = Annotated[str, Field(min_length=1)]


class Strict(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)


class Note(Strict):
    """What contradicts a printed number, or without row and column a table."""

    row: Name | None = None
    column: Name | None = None
    text: Name


class Table(Strict):
    """A printed table: `rows` by name, one number per column; `methods` says which of the two its methods are."""

    number: Name
    title: Name
    metric: Literal["psnr", "ssim", "uiqm", "uciqe"]
    methods: Literal["rows", "columns"]
    water: Annotated[Name | None, Field(description="the water here that stands for the printed turbidity")] = None
    columns: tuple[Name, ...]
    rows: dict[Name, tuple[float, ...]]
    notes: tuple[Note, ...] = ()

    @model_validator(mode="after")
    def _agrees(self):
        for name, numbers in self.rows.items():
            if len(numbers) != len(self.columns):
                raise ValueError(f"row {name} has {len(numbers)} numbers, allowed: one for each of {self.columns}")
        for note in self.notes:
            if note.row not in (None, *self.rows) or note.column not in (None, *self.columns):
                raise ValueError(f"note on {note.row}, {note.column}, allowed: rows and columns of the table")
        return self

    @property
    def method_names(self) -> tuple[str, ...]:
        """The names of its methods as the table spells them."""
        return tuple(self.rows) if self.methods == "rows" else self.columns

    def column(self, name: str) -> list[float]:
        """Return the numbers of a column."""
        return [numbers[self.columns.index(name)] for numbers in self.rows.values()]

    def mean(self, column: str) -> float:
        """Return the mean of a column."""
        return math.fsum(self.column(column)) / len(self.rows)

    def wins(self, column: str) -> int:
        """Return in how many rows a column has the largest number."""
        place = self.columns.index(column)
        return sum(numbers[place] == max(numbers) for numbers in self.rows.values())


class Method(Strict):
    """A printed name: the algorithm measured under it here, or why there is none."""

    algorithm: Name | None = None
    not_measured: Name | None = None
    remark: Name | None = None
    misprints: tuple[Name, ...] = ()

    @model_validator(mode="after")
    def _one_of_both(self):
        if (self.algorithm is None) == (self.not_measured is None):
            raise ValueError("allowed: either algorithm or not_measured")
        return self


class Claimed(Strict):
    """Averages that the text claims of the proposed method over `rivals` others."""

    text: Name
    place: Name
    psnr: float
    ssim: float
    rivals: int


class Printed(Strict):
    """All of the file."""

    source: Name
    claimed: Claimed
    methods: dict[Name, Method]
    table: tuple[Table, ...]

    @model_validator(mode="after")
    def _methods_are_known(self):
        for table in self.table:
            for name in table.method_names:
                self.name(name)
        return self

    def tables(self, *numbers: str) -> list[Table]:
        """Return the tables of these numbers, such as "3.1", in their order in print."""
        return [table for table in self.table if table.number in numbers]

    def name(self, printed: str) -> str:
        """Return a method's name as in the text; ValueError for one that the file does not know."""
        for name, method in self.methods.items():
            if printed == name or printed in method.misprints:
                return name
        raise ValueError(f"method {printed!r}, allowed: {', '.join(self.methods)}, or a misprint of one")

    def method(self, printed: str) -> Method:
        """Return what is measured under a printed name."""
        return self.methods[self.name(printed)]


@cache
def printed() -> Printed:
    """Return the printed numbers; ValueError in one line if the file is broken."""
    path = shipped("benchmarks") / "printed" / "restoration.toml"
    return validated(Printed, with_tuples(read_toml(path)), where=path)
