"""What a recipe draws or sets on a grid: distributions, choices, axes."""

from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from uwsim.scene.base import Strict


class Uniform(Strict):
    """A number, or a list of numbers, uniform between `low` and `high`."""

    distribution: Literal["uniform", "log_uniform"]
    low: float | tuple[float, ...]
    high: float | tuple[float, ...]

    @model_validator(mode="after")
    def _ordered(self):
        low, high = np.asarray(self.low), np.asarray(self.high)
        if low.shape != high.shape or np.any(low > high):
            raise ValueError(f"low is {self.low}, high is {self.high}; allowed: same length, low <= high")
        if self.distribution == "log_uniform" and np.any(low <= 0):
            raise ValueError(f"low is {self.low}, allowed for log_uniform: above 0")
        return self

    def draw(self, rng: np.random.Generator):
        low, high = np.asarray(self.low, float), np.asarray(self.high, float)
        if self.distribution == "log_uniform":
            return np.asarray(np.exp(rng.uniform(np.log(low), np.log(high)))).tolist()
        return np.asarray(rng.uniform(low, high)).tolist()


class Choice(Strict):
    """One of a list of values; `in_order` takes them in turn over the frames of the group."""

    distribution: Literal["choice", "in_order"]
    values: Annotated[tuple[bool | str | int | float | tuple[float, ...] | dict, ...], Field(min_length=1)]

    def pick(self, rng: np.random.Generator, index: int):
        if self.distribution == "in_order":
            return self.values[index % len(self.values)]
        return self.values[int(rng.integers(len(self.values)))]


class Axis(Strict):
    """One axis of a grid: lists of values, one list per path, all of the same length; they move together.

    `set` puts values, `multiply` scales the number, or every number of the list, that stands at a path (of a group's
    axes and sets, the last word): so that two axes can share a path, such as turbidity and albedo those of the water.
    """

    set: dict[str, tuple] = {}
    multiply: dict[str, tuple[float, ...]] = {}

    @model_validator(mode="before")
    @classmethod
    def _lists(cls, values):
        if not isinstance(values, dict):
            return values
        listed = {key: table for key, table in values.items() if isinstance(table, dict)}
        return values | {
            key: {path: tuple(one) if isinstance(one, list) else one for path, one in table.items()}
            for key, table in listed.items()
        }

    @model_validator(mode="after")
    def _equally_long(self):
        lengths = {path: len(values) for path, values in (*self.set.items(), *self.multiply.items())}
        if not lengths or len(set(lengths.values())) > 1 or 0 in lengths.values():
            raise ValueError(f"axis has {lengths or 'no'} values, allowed: lists of the same length, at least one")
        return self

    @property
    def length(self) -> int:
        return len(next(iter((*self.set.values(), *self.multiply.values()))))
