"""What all scene models share."""

from typing import Annotated

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

from uwsim.optics.spectrum import on_grid

Positive = Annotated[float, Field(gt=0)]
NonNegative = Annotated[float, Field(ge=0)]
Vector3 = tuple[float, float, float]


class Strict(BaseModel):
    """Frozen, no unknown keys, no NaN or infinity, no text or truth value for a number."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, strict=True)

    @model_validator(mode="before")
    @classmethod
    def _tuples(cls, values):
        return {key: _tuple(value) for key, value in values.items()} if isinstance(values, dict) else values


def _tuple(value: object) -> object:
    """Return lists, as files have them, as tuples, as the models have them."""
    return tuple(_tuple(entry) for entry in value) if isinstance(value, list) else value


class Table(Strict):
    """A spectrum as a table over wavelength; it must cover 400-700 nm."""

    wavelengths_nm: tuple[float, ...]
    values: tuple[NonNegative, ...]

    @model_validator(mode="after")
    def _usable(self):
        self.on_grid(where="values")
        return self

    def on_grid(self, *, where: str) -> np.ndarray:
        return on_grid(self.wavelengths_nm, self.values, where=where)
