"""A recipe: groups of frames, each a base scene with fixed changes and drawn values.

Keys of `set` and `draw` are paths into the scene file, such as `water.particle_factor`, `rig.camera.width_px`,
`rig.lamps.0.half_angle_deg` or `bodies.board.rotation_deg` (bodies and lamps by name or number). A `grid` takes all
combinations of the values on its axes.
"""

import copy
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, TypeAdapter, model_validator

from uwsim import seeds
from uwsim.dataset import moments
from uwsim.dataset.draws import Axis, Choice, Uniform
from uwsim.dataset.paths import entry, put, scaled
from uwsim.files import find_shipped, read_toml
from uwsim.render import smooth, stopping
from uwsim.scene.base import Strict
from uwsim.scene.load import scene_values
from uwsim.scene.models import Scene
from uwsim.scene.sequence import RigCamera, Sequence
from uwsim.validation import validated

_BATCHES = 4  # of samples_per_pixel, where the recipe does not say

Name = Annotated[str, Field(pattern=r"^[A-Za-z0-9_-]+$")]


class Group(Strict):
    """Frames that share a base scene: `frames` of them, or one for each combination on the axes of a `grid`.

    The last axis of a grid runs fastest. With a `sequence` each combination is one sequence (paths that begin with
    `sequence.` lead into it), without a grid the group is one. `cameras`: each frame is taken by all of them at once,
    one frame of the dataset for each, one after the other. `split`: where exports put the frames; groups of
    different splits must not show the same bodies in the same places (`make` refuses that). `denoise`: other than the
    recipe's.
    """

    name: Name
    scene: str
    split: Literal["train", "val", "test"] | None = None
    denoise: bool | None = None
    frames: Annotated[int, Field(ge=1, le=1_000_000)] | None = None
    set: dict[str, object] = {}
    grid: tuple[Axis, ...] = ()
    sequence: Sequence | None = None
    cameras: tuple[RigCamera, ...] = ()
    draw: dict[str, Annotated[Uniform | Choice, Field(discriminator="distribution")]] = {}

    @model_validator(mode="after")
    def _counted(self):
        if self.sequence is not None and self.frames is not None:
            raise ValueError(f"frames: got {self.frames} with a sequence, allowed: sequence.frames or duration_s")
        if self.sequence is None and (self.frames is None) != bool(self.grid):
            got = "missing, and no grid" if self.frames is None else f"got {self.frames} with a grid"
            raise ValueError(f"frames: {got}, allowed: frames, or a grid, which has one for each combination")
        names = [camera.name for camera in self.cameras]
        if len(set(names)) != len(names):
            raise ValueError(f"cameras: names {names} are not unique")
        return self

    @property
    def combinations(self) -> int:
        """Number of different draws: of sequences, or of moments without one."""
        return self.frames or math.prod(axis.length for axis in self.grid)

    @property
    def count(self) -> int:
        """Number of frames."""
        return self.combinations * (1 if self.sequence is None else self.sequence.count) * max(1, len(self.cameras))

    def place(self, index: int) -> moments.Place:
        """Return which combination, step of the sequence and camera frame `index` of the group is."""
        steps = 1 if self.sequence is None else self.sequence.count
        return moments.Place.of(index, steps=steps, cameras=max(1, len(self.cameras)))

    def sequence_name(self, combination: int) -> str:
        """Return the name of a sequence of the group."""
        return self.name if not self.grid else f"{self.name}_{combination:03d}"

    def steps(self, combination: int) -> list[tuple[Axis, int]]:
        """Return the axes of the grid, each with the number of its values that a combination has."""
        places = np.unravel_index(combination, [axis.length for axis in self.grid]) if self.grid else ()
        return [(axis, int(place)) for axis, place in zip(self.grid, places, strict=True)]


class NoiseRule(Strict):
    """Render every light picture until its Monte-Carlo noise is low enough, see `uwsim.render.stopping`.

    region: relative error of region means. Single pixels must be good enough for the sensor too, unless `pixels` is
    false: then that rule ends no render, and the frame says whether it holds. A picture that is not so far after
    `max_samples` per pixel ends there, and its frame says so. It has at least 8 batches.
    """

    region: Annotated[float, Field(ge=1e-4, le=0.5)]
    max_samples: Annotated[int, Field(le=10_000_000)]
    samples_per_batch: Annotated[int, Field(ge=1, le=10_000)] = stopping.SAMPLES_PER_BATCH
    pixels: bool = True

    @model_validator(mode="after")
    def _usable(self):
        _ = self.until
        return self

    @property
    def until(self) -> stopping.Until:
        most = stopping.most_batches(self.max_samples, self.samples_per_batch)
        return stopping.Until(
            region=self.region, batches=most, samples_per_batch=self.samples_per_batch, pixels=self.pixels
        )


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
        without = [group.name for group in self.group if group.split is None]
        if without and len(without) < len(self.group):
            raise ValueError(f"split: group {without[0]} has none, others have one; allowed: all or none")
        moving = [group for group in self.group if group.sequence is not None]
        names = [group.sequence_name(number) for group in moving for number in range(group.combinations)]
        if twice := {name for name in names if names.count(name) > 1}:
            raise ValueError(f"group: two sequences would be called {min(twice)}, allowed: another group name")
        return self

    @property
    def until(self) -> stopping.Until:
        """What ends the render of every light picture."""
        if self.noise is None:
            return stopping.until(self.samples_per_pixel, self.batches, None)
        return self.noise.until

    def options_of(self, group: Group) -> smooth.Options:
        """Return what the frames of a group have on request."""
        return smooth.Options(orders=self.orders, denoise=self.denoise if group.denoise is None else group.denoise)

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


@dataclass(frozen=True)
class Drawn:
    """One frame of a recipe: its scene, and what it is in a sequence or of several cameras at once.

    `still`: the scene as drawn, before a sequence moves its rig. `moment`: the keys of frame.json on sequence and rig,
    empty without either.
    """

    scene: Scene
    still: Scene
    sequence: Sequence | None
    moment: dict


def draw_scene(recipe: Recipe, frame: int, *, where: object) -> Scene:
    """Return the scene of one frame; see `draw`."""
    return draw(recipe, frame, where=where).scene


def draw(recipe: Recipe, frame: int, *, where: object) -> Drawn:
    """Return what one frame is; the same (recipe, frame) is always the same.

    Frames of one sequence, and of several cameras at once, share what is drawn: that of the first of them.
    Raises ValueError naming the recipe if a path does not exist in the scene or a drawn scene is not allowed.
    """
    group, index = recipe.locate(frame)
    place, first = group.place(index), frame - index + group.place(index).first
    text = f"{where}: group {group.name}, frame {frame}"
    values = _drawn_values(recipe, group, place, first=first, where=where)
    asked = values.pop("sequence", None) if group.sequence is not None else None
    still = validated(Scene, values, where=text)
    if group.sequence is None and not group.cameras:
        return Drawn(scene=still, still=still, sequence=None, moment={})
    sequence = None if asked is None else validated(Sequence, asked, where=f"{text}: sequence")
    if sequence is not None and sequence.count != group.sequence.count:
        raise ValueError(
            f"{text}: sequence has {sequence.count} frames, allowed: as in the group, {group.sequence.count} "
            "(frames, duration_s and fps stay the same)"
        )
    made, moment = moments.at_moment(
        still, values, sequence=sequence, name=group.sequence_name(place.combination), cameras=group.cameras,
        place=place, seed=recipe.seed, first=first, where=text,
    )  # fmt: skip
    return Drawn(scene=validated(Scene, made, where=text), still=still, sequence=sequence, moment=moment)


def _drawn_values(recipe: Recipe, group: Group, place: moments.Place, *, first: int, where: object) -> dict:
    """Return the values of a scene file with all that the recipe sets and draws; `sequence` beside them."""
    base = Path(group.scene)
    if base.suffix == ".toml" and not base.is_absolute() and (Path(str(where)).parent / base).is_file():
        base = Path(str(where)).parent / base
    try:
        values, _ = scene_values(str(base))
    except ValueError as error:
        raise ValueError(f"{where}: group {group.name}: {error}") from None
    values = copy.deepcopy(values)
    if group.sequence is not None:
        values["sequence"] = group.sequence.model_dump(mode="json")
    steps = group.steps(place.combination)
    on_grid = {path: listed[at] for axis, at in steps for path, listed in axis.set.items()}
    for path, value in (recipe.set | group.set | on_grid).items():
        put(values, path, copy.deepcopy(value), where=where)
    for path, kind in sorted(group.draw.items()):
        rng = seeds.generator(recipe.seed, first, f"draw {path}")
        drawn = kind.pick(rng, place.combination) if isinstance(kind, Choice) else kind.draw(rng)
        put(values, path, drawn, where=where)
    for axis, at in steps:
        for path, factors in axis.multiply.items():
            put(values, path, scaled(entry(values, path, where=where), factors[at], path, where), where=where)
    return values


def resolved(recipe: Recipe) -> dict:
    """Return the recipe as plain data for dataset.json; a group has no entry for what it lacks."""
    data = TypeAdapter(Recipe).dump_python(recipe, mode="json")
    for group in data["group"]:
        for key in ("split", "grid", "sequence", "cameras"):
            if not group[key]:
                del group[key]
    return data
