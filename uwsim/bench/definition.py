"""What a benchmark is: benchmarks/<name>.toml as a strict, frozen model."""

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

from uwsim.bench.blur_controlled.protocol import Protocol as Frames
from uwsim.bench.pnp.protocol import Protocol as Problems
from uwsim.bench.pnp_outliers.protocol import Outliers
from uwsim.files import find_shipped, read_toml
from uwsim.validation import validated, with_tuples

Name = Annotated[str, Field(min_length=1)]
MADE_FROM = {"blur_controlled": "frames", "deconvolution": "frames", "pnp": "problems", "pnp_outliers": "outliers"}
"""Tasks whose cases are made while the benchmark runs, and the table that says how."""


_TAKE_BLUR = ("deconvolution", "deblurring", "pose")


class Variant(BaseModel):
    """An algorithm file under another name: with keywords of its own, and for formation models fitted or not."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)

    algorithm: Annotated[Name, Field(description="the file")]
    keywords: Annotated[dict[str, bool | int | float | str], Field(description="given to its function")] = {}
    fitted: Annotated[bool, Field(description="its PARAMETERS are fitted to the truth of every case")] = False
    blur_from: Annotated[Name | None, Field(description="estimator whose blur it is given; left out: the true one")] = (
        None
    )
    restored_by: Annotated[Name | None, Field(description="restoration that pictures pass before detection")] = None
    deblurred_by: Annotated[
        Name | None,
        Field(description="deconvolver that pictures pass before, with blur_from"),
    ] = None
    labels: Annotated[
        Literal["truth", "search"],
        Field(description="how spheres are told apart: true places, or a search"),
    ] = "truth"


class Definition(BaseModel):
    """A benchmark: a task, the dataset it is scored on or the frames it makes, and the algorithms that take part."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)

    task: Annotated[
        Literal["restoration", "blur", "deblurring", "pose", "validity", *MADE_FROM],
        Field(description="which kind of algorithm is scored"),
    ]
    description: Annotated[Name, Field(description="one sentence for tables and reports")]
    dataset: Annotated[Name | None, Field(description="recipe that makes the dataset: scenes/datasets/<name>.toml")] = (
        None
    )
    frames: Annotated[Frames | None, Field(description="of tasks that make their frames")] = None
    problems: Annotated[Problems | None, Field(description="of the task that makes pose problems")] = None
    outliers: Annotated[Outliers | None, Field(description="of the task that makes pose problems with outliers")] = None
    quick_dataset: Annotated[Name | None, Field(description="recipe of a smaller dataset for quick runs")] = None
    algorithms: Annotated[
        tuple[Name, ...] | None, Field(description="names in table order; left out: every file in the folder")
    ] = None
    variants: Annotated[dict[Name, Variant], Field(description="more algorithms, each made of a file")] = {}
    do_nothing: Annotated[Name, Field(description="the algorithm whose score is the one to beat")]
    oracle: Annotated[Name | None, Field(description="the algorithm that is given the truth")] = None
    quick_cases: Annotated[int, Field(ge=1, description="cases of a quick run, spread over the dataset")]

    @model_validator(mode="after")
    def _cases_agree(self):
        needed, makes = MADE_FROM.get(self.task, "dataset"), self.task in MADE_FROM
        if getattr(self, needed) is None:
            raise ValueError(f"{needed}: missing, allowed: {'a table' if makes else 'a recipe'} with task {self.task}")
        for other in ("dataset", "frames", "problems", "outliers", *(["quick_dataset"] if makes else [])):
            if other != needed and getattr(self, other) is not None:
                raise ValueError(f"{other}: given with task {self.task}, allowed: {needed} alone")
        return self

    @property
    def made_from(self) -> Frames | Problems | Outliers | None:
        """What the cases are made from, of tasks that make their own."""
        return getattr(self, MADE_FROM[self.task]) if self.task in MADE_FROM else None

    @model_validator(mode="after")
    def _variants_agree(self):
        for name, variant in self.variants.items():
            if self.task != "pose" and (variant.restored_by or variant.deblurred_by or variant.labels != "truth"):
                raise ValueError(f"variants: {name} has restored_by, deblurred_by or labels, allowed: with task pose")
            if self.task == "pose" and (variant.deblurred_by is None) != (variant.blur_from is None):
                raise ValueError(f"variants: {name}: deblurred_by and blur_from belong together with task pose")
            if self.task not in _TAKE_BLUR and variant.blur_from is not None:
                raise ValueError(f"variants: {name} has blur_from, allowed: with tasks {', '.join(_TAKE_BLUR)}")
            if self.task != "validity" and variant.fitted:
                raise ValueError(f"variants: {name} is fitted, allowed: with task validity")
            if self.algorithms is not None and name not in self.algorithms:
                raise ValueError(f"variants: {name} is not listed, allowed: one of algorithms {self.algorithms}")
        return self

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
    return path.stem, definition_from(read_toml(path), where=path)


def definition_from(content: dict, *, where: object) -> Definition:
    """Return the definition of a parsed TOML file, or of a result's provenance; ValueError in one line."""
    return validated(Definition, with_tuples(content), where=where)
