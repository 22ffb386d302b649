"""A recipe: groups of frames, each a base scene with fixed changes and drawn values.

Keys of `set` and `draw` are paths into the scene file, such as `water.particle_factor`, `rig.camera.width_px`,
`rig.lamps.0.half_angle_deg` or `bodies.board.rotation_deg` (bodies and lamps by name or number). A `grid` takes all
combinations of the values on its axes.
"""

import copy
import math
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, TypeAdapter, model_validator

from uwsim import seeds
from uwsim.files import find_shipped, read_toml
from uwsim.render import smooth, stopping
from uwsim.scene.base import Strict
from uwsim.scene.load import scene_values
from uwsim.scene.models import Scene
from uwsim.validation import validated

_BATCHES = 4  # of samples_per_pixel, where the recipe does not say

Name = Annotated[str, Field(pattern=r"^[A-Za-z0-9_-]+$")]


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


class Group(Strict):
    """Frames that share a base scene: `frames` of them, or one for each combination on the axes of a `grid`.

    The last axis of a grid runs fastest.
    """

    name: Name
    scene: str
    frames: Annotated[int, Field(ge=1, le=1_000_000)] | None = None
    set: dict[str, object] = {}
    grid: tuple[Axis, ...] = ()
    draw: dict[str, Annotated[Uniform | Choice, Field(discriminator="distribution")]] = {}

    @model_validator(mode="after")
    def _counted(self):
        if (self.frames is None) != bool(self.grid):
            got = "missing, and no grid" if self.frames is None else f"got {self.frames} with a grid"
            raise ValueError(f"frames: {got}, allowed: frames, or a grid, which has one for each combination")
        return self

    @property
    def count(self) -> int:
        """Number of frames."""
        return self.frames or math.prod(axis.length for axis in self.grid)

    def steps(self, index: int) -> list[tuple[Axis, int]]:
        """Return the axes of the grid, each with the number of its values that frame `index` of the group has."""
        places = np.unravel_index(index, [axis.length for axis in self.grid]) if self.grid else ()
        return [(axis, int(place)) for axis, place in zip(self.grid, places, strict=True)]


class NoiseRule(Strict):
    """Render every light picture until its Monte-Carlo noise is low enough, see `uwsim.render.stopping`.

    region: relative error of region means. Single pixels must be good enough for the sensor too. A picture that is not
    so far after `max_samples` per pixel ends there, and its frame says so.
    """

    region: Annotated[float, Field(ge=1e-4, le=0.5)]
    max_samples: Annotated[int, Field(le=10_000_000)]

    @model_validator(mode="after")
    def _usable(self):
        stopping.most_batches(self.max_samples)
        return self


class Recipe(Strict):
    """A recipe file. Frames are numbered through the groups in order.

    What ends the render of a picture is `samples_per_pixel`, in `batches` (4), or `noise`. `orders`: frames also have
    `direct_unscattered` and `backscatter_single`; `denoise`: scattered light denoised, biased (`uwsim.render.smooth`).
    """

    name: Name
    description: str
    seed: Annotated[int, Field(ge=0)]
    samples_per_pixel: Annotated[int, Field(ge=2, le=1_000_000)] | None = None
    batches: Annotated[int, Field(ge=2, le=64)] | None = None
    noise: NoiseRule | None = None
    orders: bool = False
    denoise: bool = False
    set: dict[str, object] = {}
    group: Annotated[tuple[Group, ...], Field(min_length=1)]

    @model_validator(mode="before")
    @classmethod
    def _four_batches(cls, values):
        counted = isinstance(values, dict) and "samples_per_pixel" in values
        return {"batches": _BATCHES} | values if counted else values

    @model_validator(mode="after")
    def _usable(self):
        if (self.samples_per_pixel is None) == (self.noise is None):
            raise ValueError("give either samples_per_pixel or noise = {region, max_samples}")
        if self.noise is not None and self.batches is not None:
            raise ValueError(f"batches is {self.batches}, allowed: none with noise, whose batches are of fixed size")
        if self.noise is None and self.batches is None:
            raise ValueError("batches is null, allowed: a whole number, or no entry")
        if self.noise is None and self.samples_per_pixel % self.batches:
            raise ValueError(
                f"samples_per_pixel is {self.samples_per_pixel}, allowed: a multiple of batches = {self.batches}"
            )
        names = [group.name for group in self.group]
        if len(set(names)) != len(names):
            raise ValueError(f"group names {names} are not unique")
        return self

    @property
    def until(self) -> stopping.Until:
        """What ends the render of every light picture."""
        if self.noise is None:
            return stopping.until(self.samples_per_pixel, self.batches, None)
        return stopping.Until(region=self.noise.region, batches=stopping.most_batches(self.noise.max_samples))

    @property
    def options(self) -> smooth.Options:
        """What every frame has on request."""
        return smooth.Options(orders=self.orders, denoise=self.denoise)

    @property
    def frames(self) -> int:
        return sum(group.count for group in self.group)

    def locate(self, frame: int) -> tuple[Group, int]:
        """Return the group of a frame and the frame's number inside it."""
        index = frame
        for group in self.group:
            if index < group.count:
                return group, index
            index -= group.count
        raise ValueError(f"frame {frame}: the recipe has {self.frames} frames")


def load_recipe(name: str) -> tuple[Recipe, Path]:
    """Return a recipe given by its path or by the name of a shipped one, with the path it was read from."""
    path = find_shipped("scenes/datasets", name)
    return validated(Recipe, read_toml(path), where=path), path


def draw_scene(recipe: Recipe, frame: int, *, where: object) -> Scene:
    """Return the scene of one frame; the same (recipe, frame) always gives the same scene.

    Raises ValueError naming the recipe if a path does not exist in the scene or a drawn scene is not allowed.
    """
    group, index = recipe.locate(frame)
    base = Path(group.scene)
    if base.suffix == ".toml" and not base.is_absolute() and (Path(str(where)).parent / base).is_file():
        base = Path(str(where)).parent / base
    try:
        values, _ = scene_values(str(base))
    except ValueError as error:
        raise ValueError(f"{where}: group {group.name}: {error}") from None
    values = copy.deepcopy(values)
    steps = group.steps(index)
    on_grid = {path: listed[place] for axis, place in steps for path, listed in axis.set.items()}
    for path, value in (recipe.set | group.set | on_grid).items():
        put(values, path, copy.deepcopy(value), where=where)
    for path, kind in sorted(group.draw.items()):
        rng = seeds.generator(recipe.seed, frame, f"draw {path}")
        drawn = kind.pick(rng, index) if isinstance(kind, Choice) else kind.draw(rng)
        put(values, path, drawn, where=where)
    for axis, place in steps:
        for path, factors in axis.multiply.items():
            put(values, path, _scaled(entry(values, path, where=where), factors[place], path, where), where=where)
    return validated(Scene, values, where=f"{where}: group {group.name}, frame {frame}")


def put(values: dict, path: str, value: object, *, where: object) -> None:
    """Set the entry at a dotted path. New keys and tables are made; the strict scene model refuses unknown ones."""
    *parents, last = path.split(".")
    node = values
    for key in (*parents, None):
        if not isinstance(node, dict | list):
            raise ValueError(f"{where}: path {path!r} goes into {node!r}, which has no keys")
        if key is not None:
            node = node.setdefault(key, {}) if isinstance(node, dict) else node[_position(node, key, path, where)]
    if isinstance(node, list):
        node[_position(node, last, path, where)] = value
    else:
        node[last] = value


def entry(values: dict, path: str, *, where: object) -> object:
    """Return what stands at a dotted path; ValueError if nothing does."""
    node = values
    for key in path.split("."):
        if isinstance(node, dict) and key in node:
            node = node[key]
        elif isinstance(node, list | tuple):
            node = node[_position(node, key, path, where)]
        else:
            raise ValueError(f"{where}: path {path!r}: no {key!r} there, allowed: a path of the scene that has a value")
    return node


def _scaled(value: object, factor: float, path: str, where: object) -> object:
    if isinstance(value, list | tuple):
        return [_scaled(one, factor, path, where) for one in value]
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ValueError(f"{where}: multiply {path!r}: got {value!r} there, allowed: a number or a list of numbers")
    return value * factor


def _position(entries: list, key: str, path: str, where: object) -> int:
    """Return the index of a list entry given by number or by its name."""
    names = [entry.get("name") if isinstance(entry, dict) else None for entry in entries]
    if key in names:
        return names.index(key)
    if key.isdigit() and int(key) < len(entries):
        return int(key)
    raise ValueError(f"{where}: path {path!r}: no entry {key!r}, allowed: {names or 'none'} or their numbers")


def resolved(recipe: Recipe) -> dict:
    """Return the recipe as plain data for dataset.json; a group without a grid has no entry of that name."""
    data = TypeAdapter(Recipe).dump_python(recipe, mode="json")
    for group in data["group"]:
        if not group["grid"]:
            del group["grid"]
    return data
