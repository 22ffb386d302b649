"""What problems a benchmark makes itself: the table `problems` of its TOML file as strict, frozen models."""

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

from uwsim.bench.pnp.layouts import LAYOUTS, POINTS, RANDOM, is_random

Name = Annotated[str, Field(min_length=1)]
SWEEPS = ("noise_px", "depth_m", "off_axis_m", "angle_deg", "points")
PLACES = ("box", "depth", "off_axis", "angle")


class _Strict(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)


class Part(_Strict):
    """Settings that differ in one quantity, `sweep`; `placed` says where the targets are.

    box: origin, or each random point, evenly in the box (`nearest_m` and up, 1 m deep). depth: origin at a depth and
    up to 0.4 of it off the axis; of random points the box begins there. off_axis: origin at (0, off_axis_m, depth_m).
    angle: origin on the axis at depth_m, turned about the camera's y by the angle.
    """

    figure: Annotated[Name | None, Field(description="of the dissertation, such as 5.4")] = None
    use: Annotated[Literal["protocol", "hold_out"], Field(description="hold_out: no method was set on it")] = "protocol"
    layout: Annotated[Literal[*LAYOUTS, *RANDOM], Field(description="of the target's points")]
    edge_m: Annotated[float | None, Field(gt=0, description="of a layout that is not random")] = None
    placed: Literal[PLACES]
    sweep: Literal[SWEEPS]
    values: Annotated[tuple[float, ...], Field(min_length=1)]
    quick_values: Annotated[tuple[float, ...] | None, Field(description="in quick runs; left out: none")] = None
    focal_px: Annotated[float, Field(gt=0)]
    noise_px: Annotated[float | None, Field(ge=0, description="standard deviation of each coordinate")] = None
    depth_m: Annotated[float | None, Field(gt=0)] = None
    angle_deg: Annotated[float | None, Field(ge=-90, le=90)] = None
    off_axis_m: Annotated[float | None, Field(ge=0)] = None
    trials: Annotated[int | None, Field(ge=1, description="instead of the protocol's")] = None
    quick_trials: Annotated[int | None, Field(ge=1, description="instead of the protocol's")] = None
    timed_calls: Annotated[int, Field(ge=1, le=20, description="of which the fastest counts")] = 1

    @model_validator(mode="after")
    def _quantities_agree(self):
        needed = {"noise_px": True, "depth_m": self.placed != "box", "angle_deg": self.placed == "angle",
                  "off_axis_m": self.placed == "off_axis"}  # fmt: skip
        for name, wanted in needed.items():
            wanted = wanted and name != self.sweep
            if (getattr(self, name) is not None) != wanted:
                got = "missing" if wanted else f"got {getattr(self, name)}"
                allowed = "a value" if wanted else f"none with placed {self.placed} and sweep {self.sweep}"
                raise ValueError(f"{name}: {got}, allowed: {allowed}")
            if name == self.sweep and not needed[name]:
                raise ValueError(f"sweep: got {self.sweep} with placed {self.placed}, allowed: of what the place has")
        if is_random(self.layout) != (self.edge_m is None):
            raise ValueError(f"edge_m: got {self.edge_m} with layout {self.layout}, allowed: with those not random")
        if is_random(self.layout) and self.placed in ("off_axis", "angle"):
            raise ValueError(f"placed: got {self.placed} with layout {self.layout}, allowed: box, depth")
        if (self.layout == "random") != (self.sweep == "points"):
            raise ValueError(f"sweep: got {self.sweep} with layout {self.layout}, allowed: points with random alone")
        return self

    @model_validator(mode="after")
    def _values_agree(self):
        low = {"depth_m": 0.0, "angle_deg": -90.0, "points": 4.0}.get(self.sweep, 0.0)
        if min(self.values) < low or (self.sweep == "angle_deg" and max(self.values) > 90):
            raise ValueError(
                f"values: got {min(self.values)} to {max(self.values)}, allowed: from {low:g} of {self.sweep}"
            )
        if self.sweep == "points" and any(value != int(value) for value in self.values):
            raise ValueError("values: allowed: whole numbers of points")
        if len(set(self.values)) < len(self.values):
            raise ValueError("values: one stands twice, allowed: each once")
        if unknown := set(self.quick_values or ()) - set(self.values):
            raise ValueError(f"quick_values: got {min(unknown)}, allowed: of values")
        return self

    def points(self, value: float) -> int:
        """Return how many points the target has at a value of the sweep."""
        return int(value) if self.sweep == "points" else POINTS[self.layout]


class Protocol(_Strict):
    """Problems by setting: `trials` of each, in quick runs `quick_trials` of the parts with `quick_values`."""

    seed: Annotated[int, Field(ge=0)]
    trials: Annotated[int, Field(ge=10)]
    quick_trials: Annotated[int, Field(ge=10)]
    resamples: Annotated[int, Field(ge=50, le=10000, description="of the bootstrap")]
    parts: Annotated[dict[Name, Part], Field(min_length=1)]

    @model_validator(mode="after")
    def _something_is_quick(self):
        if all(part.quick_values is None for part in self.parts.values()):
            raise ValueError("parts: none has quick_values, allowed: at least one")
        return self
