"""What problems with outliers a benchmark makes itself: the table `outliers` of its TOML file as strict models."""

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

Name = Annotated[str, Field(min_length=1)]
LEAST_GOOD = 4
"""Good points that every problem keeps: fewer leave the pose open, whatever the solver."""


class _Strict(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)


class Part(_Strict):
    """Problems that differ in their share of outliers.

    Targets are drawn anew in each problem: solid ones evenly in the box before the camera, flat ones evenly in a square
    of 0.6 m whose origin is in that box. anywhere: images of outliers are drawn evenly over the square of +-0.5 on the
    plane z = 1. swapped: outliers have each other's images, as marks that were taken for one another.
    """

    points: Annotated[int, Field(ge=LEAST_GOOD, le=1000)]
    flat: bool = False
    wrong: Literal["anywhere", "swapped"] = "anywhere"
    outliers_percent: Annotated[tuple[Annotated[float, Field(ge=0, lt=100)], ...], Field(min_length=1)]
    quick_outliers_percent: Annotated[tuple[float, ...] | None, Field(description="in quick runs; left out: none")] = (
        None
    )

    @model_validator(mode="after")
    def _shares_agree(self):
        values = self.outliers_percent
        if len(set(values)) < len(values):
            raise ValueError("outliers_percent: one stands twice, allowed: each once")
        if unknown := set(self.quick_outliers_percent or ()) - set(values):
            raise ValueError(f"quick_outliers_percent: got {min(unknown)}, allowed: of outliers_percent")
        for value in values:
            count = self.count(value)
            if self.points - count < LEAST_GOOD:
                most = 100 * (1 - LEAST_GOOD / self.points)
                raise ValueError(f"outliers_percent: got {value} of {self.points} points, allowed: 0 to {most:g}")
            if self.wrong == "swapped" and count == 1:
                raise ValueError(f"outliers_percent: got {value}, one point, allowed: none or two and more to swap")
        return self

    def count(self, percent: float) -> int:
        """Return how many of the points are outliers."""
        return round(self.points * percent / 100)


class Outliers(_Strict):
    """Problems by part: `trials` of each share, in quick runs `quick_trials` of the parts with quick shares.

    `threshold_std`: what solvers are told to take for an outlier, in standard deviations of a coordinate's noise.
    """

    seed: Annotated[int, Field(ge=0)]
    trials: Annotated[int, Field(ge=10)]
    quick_trials: Annotated[int, Field(ge=10)]
    resamples: Annotated[int, Field(ge=50, le=10000, description="of the bootstrap")]
    focal_px: Annotated[float, Field(gt=0)]
    noise_px: Annotated[float, Field(gt=0, description="standard deviation of each coordinate")]
    threshold_std: Annotated[float, Field(gt=0)]
    parts: Annotated[dict[Name, Part], Field(min_length=1)]

    @model_validator(mode="after")
    def _something_is_quick(self):
        if all(part.quick_outliers_percent is None for part in self.parts.values()):
            raise ValueError("parts: none has quick_outliers_percent, allowed: at least one")
        return self
