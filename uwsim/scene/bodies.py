"""Bodies of a scene. A body's frame: x right, y up, z out of its face; flat bodies are centred on the origin."""

from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from uwsim.scene.base import NonNegative, Positive
from uwsim.scene.charts import Chart, ColorChecker, MarkerBoard, TexturedChart, UsafChart
from uwsim.scene.layouts import MarkerLayout
from uwsim.scene.placed import File, Placed, Plain, read_grey
from uwsim.scene.plants import Plants
from uwsim.scene.sand import Sand
from uwsim.scene.snow import MarineSnow
from uwsim.scene.stones import Stones
from uwsim.scene.structures import Pipe, Rope, RustyWall, Tank
from uwsim.scene.surface import Generated
from uwsim.scene.targets import CharucoBoard, SiemensStar, SlantedEdge

__all__ = (
    "Body", "CharucoBoard", "Chart", "ColorChecker", "File", "Generated", "Heightfield", "MarineSnow", "MarkerBoard",
    "MarkerLayout", "Mesh", "Pipe", "Placed", "Plants", "Rectangle", "Rope", "RustyWall", "Sand", "SiemensStar",
    "SlantedEdge", "Stones", "Tank", "TexturedChart", "UsafChart", "numbered",
)  # fmt: skip


class Rectangle(Plain):
    """A flat rectangle, the same on both sides."""

    kind: Literal["rectangle"]
    width_m: Positive
    height_m: Positive


class Mesh(Plain):
    """A triangle mesh from a PLY or OBJ file, in the body's frame [m] times `scale`."""

    kind: Literal["mesh"]
    file: File
    scale: Positive = 1.0

    @model_validator(mode="after")
    def _readable(self):
        if self.file.suffix.lower() not in (".ply", ".obj"):
            raise ValueError(f"file: got {self.file}, allowed: a .ply or .obj file")
        if not self.file.is_file():
            raise ValueError(f"file: {self.file} does not exist")
        return self


class Heightfield(Plain):
    """A relief over the body's x-y plane: z = relief x grey value (0-1) of an image, row 0 at +y."""

    kind: Literal["heightfield"]
    file: File
    width_m: Positive
    height_m: Positive
    relief_m: NonNegative

    @model_validator(mode="after")
    def _readable(self):
        _ = self.heights_m
        return self

    @property
    def heights_m(self) -> np.ndarray:
        """Heights above the body's plane, (rows, columns). [m]"""
        return self.relief_m * read_grey(self.file)


_Flat = Rectangle | TexturedChart | UsafChart | MarkerBoard | ColorChecker
_Target = SiemensStar | SlantedEdge | CharucoBoard | MarkerLayout
_Asset = Stones | Sand | Plants | Tank | RustyWall | Pipe | Rope
Body = Annotated[_Flat | Mesh | Heightfield | MarineSnow | _Target | _Asset, Field(discriminator="kind")]


def numbered(bodies) -> list[tuple[int, Body]]:
    """Return the bodies with their instance numbers, from 1 in order; particles are no bodies and have none."""
    return list(enumerate((body for body in bodies if not isinstance(body, MarineSnow)), start=1))
