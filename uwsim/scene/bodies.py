"""Bodies of a scene. A body's frame: x right, y up, z out of its face; flat bodies are centred on the origin."""

from pathlib import Path
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field, model_validator

from uwsim.camera import pose
from uwsim.images import decode
from uwsim.optics import sources
from uwsim.optics.spectrum import WAVELENGTHS_NM
from uwsim.scene import markers, usaf
from uwsim.scene.base import NonNegative, Positive, Strict, Table, Vector3

Reflectance = Annotated[float, Field(ge=0, le=1)] | Table
File = Annotated[Path, Field(strict=False)]  # from text


def reflectance_on_grid(reflectance: float | Table, *, where: str) -> np.ndarray:
    """Return a diffuse reflectance over wavelength, (61,)."""
    if isinstance(reflectance, Table):
        values = reflectance.on_grid(where=where)
        if values.max() > 1:
            raise ValueError(f"{where} reaches {values.max():g}, allowed: 0 to 1")
        return values
    return np.full(len(WAVELENGTHS_NM), float(reflectance))


class Placed(Strict):
    """Where a body is. With `towards_m` its face looks at that point, else its axes are the world's.

    `rotation_deg` then turns it about its own x, y, z axes. Instances are numbered from 1 in order.
    """

    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9_-]+$")]
    position_m: Vector3
    towards_m: Vector3 | None = None
    rotation_deg: Vector3 = (0.0, 0.0, 0.0)

    @model_validator(mode="after")
    def _placeable(self):
        _ = self.world_from_body
        return self

    @property
    def world_from_body(self) -> np.ndarray:
        if self.towards_m is None:
            base = pose.from_parts(np.eye(3), self.position_m)
        else:
            base = pose.facing(self.position_m, self.towards_m, where=f"body {self.name}")
        return pose.rotated(base, self.rotation_deg)


class Plain(Placed):
    """A body of one reflectance."""

    reflectance: Reflectance

    @model_validator(mode="after")
    def _reflects(self):
        _ = self.spectrum
        return self

    @property
    def spectrum(self) -> np.ndarray:
        return reflectance_on_grid(self.reflectance, where=f"body {self.name}: reflectance")


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


class Chart(Placed):
    """A flat two-tone body: `coverage` mixes the dark and the bright reflectance."""

    dark: Reflectance = 0.03
    bright: Reflectance = 0.80

    @model_validator(mode="after")
    def _two_tones(self):
        _ = self.spectra
        return self

    @property
    def spectra(self) -> tuple[np.ndarray, np.ndarray]:
        """Reflectance of the dark and of the bright tone, (61,) each."""
        return tuple(
            reflectance_on_grid(tone, where=f"body {self.name}: {key}")
            for key, tone in (("dark", self.dark), ("bright", self.bright))
        )

    @property
    def size_m(self) -> tuple[float, float]:
        return self.width_m, self.height_m

    smooth: ClassVar[bool] = True  # texture filter: bilinear; hard module edges need the nearest texel


class TexturedChart(Chart):
    """A chart whose coverage is the grey value of an image file, 0 dark, 1 bright."""

    kind: Literal["textured"]
    file: File
    width_m: Positive

    @model_validator(mode="after")
    def _readable(self):
        _ = self.coverage
        return self

    @property
    def height_m(self) -> float:
        rows, columns = self.coverage.shape
        return self.width_m * rows / columns

    @property
    def coverage(self) -> np.ndarray:
        return read_grey(self.file)


class UsafChart(Chart):
    """A USAF-1951 resolving power chart with the groups `first_group` to `last_group`."""

    kind: Literal["usaf_1951"]
    width_m: Positive
    first_group: Annotated[int, Field(ge=-6, le=9)] = -4
    last_group: Annotated[int, Field(ge=-6, le=9)] = -1

    @model_validator(mode="after")
    def _fits(self):
        _ = self.layout
        return self

    @property
    def layout(self) -> usaf.Layout:
        return usaf.layout(first_group=self.first_group, last_group=self.last_group, width_mm=1e3 * self.width_m)

    @property
    def height_m(self) -> float:
        return 1e-3 * self.layout.height_mm

    @property
    def coverage(self) -> np.ndarray:
        return usaf.draw(self.layout)


class MarkerBoard(Chart):
    """A board of ArUco or AprilTag markers with ids in reading order from `first_id`."""

    kind: Literal["marker_board"]
    dictionary: str = "DICT_4X4_50"
    columns: Annotated[int, Field(ge=1, le=50)]
    rows: Annotated[int, Field(ge=1, le=50)]
    marker_size_m: Positive
    gap_m: Positive
    first_id: Annotated[int, Field(ge=0)] = 0
    smooth: ClassVar[bool] = False

    @model_validator(mode="after")
    def _drawable(self):
        markers.check(self.dictionary, ids=self.ids)
        return self

    @property
    def ids(self) -> range:
        return range(self.first_id, self.first_id + self.rows * self.columns)

    @property
    def width_m(self) -> float:
        return self.columns * (self.marker_size_m + self.gap_m) + self.gap_m

    @property
    def height_m(self) -> float:
        return self.rows * (self.marker_size_m + self.gap_m) + self.gap_m

    @property
    def corners_m(self) -> np.ndarray:
        """Corners of all markers in the body's frame, (n, 4, 3): top left, top right, bottom right, bottom left."""
        return markers.corners(rows=self.rows, columns=self.columns, marker_size_m=self.marker_size_m, gap_m=self.gap_m)


class ColorChecker(Placed):
    """The 24 patches of the ColorChecker with measured reflectances on a dark frame."""

    kind: Literal["colorchecker"]
    width_m: Positive
    gap_share: Annotated[float, Field(gt=0, lt=0.5)] = 0.12
    frame_reflectance: Annotated[float, Field(ge=0, le=1)] = 0.04

    @property
    def pitch_m(self) -> float:
        """Distance of neighbouring patches."""
        return self.width_m / (sources.COLORCHECKER_COLUMNS + self.gap_share)

    @property
    def height_m(self) -> float:
        return self.pitch_m * (sources.COLORCHECKER_ROWS + self.gap_share)

    @property
    def patches(self) -> list[tuple[str, tuple[float, float], np.ndarray]]:
        """Name, centre (x, y) [m] in the body's frame and reflectance (61,) of every patch."""
        rows, columns, pitch = sources.COLORCHECKER_ROWS, sources.COLORCHECKER_COLUMNS, self.pitch_m
        return [
            (name, ((i % columns - (columns - 1) / 2) * pitch, ((rows - 1) / 2 - i // columns) * pitch), reflectance)
            for i, (name, reflectance) in enumerate(sources.colorchecker())
        ]


Body = Annotated[
    Rectangle | Mesh | Heightfield | TexturedChart | UsafChart | MarkerBoard | ColorChecker,
    Field(discriminator="kind"),
]


def read_grey(path: Path) -> np.ndarray:
    """Read an image file as grey values in [0, 1], (H, W) float; 8 or 16 bit, taken as linear.

    Raises ValueError in one line if it is missing or no image.
    """
    import cv2

    if not path.is_file():
        raise ValueError(f"file: {path} does not exist")
    image = decode(path, cv2.IMREAD_GRAYSCALE | cv2.IMREAD_ANYDEPTH)
    if image is None or min(image.shape) < 2:
        raise ValueError(f"file: {path} is not an image of at least 2 x 2 pixels")
    return image / float(np.iinfo(image.dtype).max)
