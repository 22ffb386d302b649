"""What a benchmark is: benchmarks/<name>.toml as a strict, frozen model."""

from pathlib import Path
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

from uwsim.files import find_shipped, read_toml
from uwsim.validation import validated

Name = Annotated[str, Field(min_length=1)]


class Definition(BaseModel):
    """A benchmark: a task, the dataset it is scored on, and the algorithms that take part."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)

    task: Annotated[Literal["restoration", "blur", "pose"], Field(description="which kind of algorithm is scored")]
    description: Annotated[Name, Field(description="one sentence for tables and reports")]
    dataset: Annotated[Name, Field(description="recipe that makes the dataset: scenes/datasets/<name>.toml")]
    algorithms: Annotated[
        tuple[Name, ...] | None, Field(description="names in table order; left out: every file in the folder")
    ] = None
    do_nothing: Annotated[Name, Field(description="the algorithm whose score is the one to beat")]
    oracle: Annotated[Name | None, Field(description="the algorithm that is given the truth")] = None
    quick_cases: Annotated[int, Field(ge=1, description="cases of a quick run, spread over the dataset")]

    @model_validator(mode="after")
    def _algorithms_agree(self):
        if self.algorithms is None:
            return self
        repeated = sorted({name for name in self.algorithms if self.algorithms.count(name) > 1})
        if repeated:
            raise ValueError(f"algorithms: {', '.join(repeated)} listed twice, allowed: each once")
        for key in ("do_nothing", "oracle"):
            if getattr(self, key) is not None and getattr(self, key) not in self.algorithms:
                raise ValueError(f"{key}: got {getattr(self, key)!r}, allowed: one of algorithms {self.algorithms}")
        return self


def read_definition(name: str) -> tuple[str, Definition]:
    """Return (name, definition) of a shipped benchmark or of a TOML file given by its path.

    Raises ValueError in one line: file, key, value, what is allowed.
    """
    path = find_shipped("benchmarks", name)
    return path.stem, _parse(path)


def _parse(path: Path) -> Definition:
    content = read_toml(path)
    if isinstance(content.get("algorithms"), list):
        content["algorithms"] = tuple(content["algorithms"])
    return validated(Definition, content, where=path)
