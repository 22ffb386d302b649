"""Flat bodies with a pattern: charts, marker boards, the ColorChecker. Frames: x right, y up, z out of the face."""

from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field, model_validator

from uwsim.optics import sources
from uwsim.scene import markers, usaf
from uwsim.scene.base import Positive
from uwsim.scene.placed import File, Placed, Reflectance, read_grey, reflectance_on_grid


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
