"""Flat test targets drawn by polygons, so that their edges are exact: Siemens star, slanted edge, ChArUco board."""

from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from uwsim.scene import markers
from uwsim.scene.base import NonNegative, Positive
from uwsim.scene.placed import Reflectance
from uwsim.scene.surface import Part, TwoTone, grid_faces

_STAR_CORNERS = 720  # at least, around a star


class FlatTarget(TwoTone):
    """A flat target of two tones in the body's x-y plane, centred on the origin."""

    dark: Reflectance = 0.03
    bright: Reflectance = 0.80

    @model_validator(mode="after")
    def _reflects(self):
        _ = self.tones
        return self


class SiemensStar(FlatTarget):
    """A Siemens star of `cycles` dark and bright spokes within a disc, on a bright board of side `width_m`.

    At the radius r a cycle is 2 pi r / cycles wide. Dark spokes begin at +x and follow each other from x towards y.
    """

    kind: Literal["siemens_star"]
    width_m: Positive
    diameter_m: Positive
    cycles: Annotated[int, Field(ge=4, le=360)] = 36

    @model_validator(mode="after")
    def _fits(self):
        if self.diameter_m >= self.width_m:
            raise ValueError(f"diameter_m: got {self.diameter_m:g} m, allowed: below width_m, {self.width_m:g} m")
        return self

    @property
    def height_m(self) -> float:
        return self.width_m

    def make_parts(self) -> dict[str, Part]:
        step = int(np.lcm(2 * self.cycles, 8))  # corners at every edge of a spoke and in the board's corners
        count = step * -(-_STAR_CORNERS // step)
        angle = np.arange(count) * 2 * np.pi / count
        ring = np.stack([np.cos(angle), np.sin(angle), np.zeros(count)], axis=-1)
        edge = ring * (self.width_m / 2 / np.abs(ring[:, :2]).max(axis=-1, keepdims=True))
        here, on = np.arange(count), (np.arange(count) + 1) % count
        spokes = np.stack([np.full(count, 2 * count), here, on], axis=-1)
        board = np.concatenate([np.stack([here, here + count, on + count], -1), np.stack([here, on + count, on], -1)])
        is_bright = (2 * self.cycles * here // count) % 2
        return {
            "face": Part(
                np.concatenate([ring * self.diameter_m / 2, edge, np.zeros((1, 3))]), np.concatenate([spokes, board]),
                self.tones, face_share=np.concatenate([is_bright, np.ones(len(board))]).astype(float),
            )
        }  # fmt: skip


class SlantedEdge(FlatTarget):
    """A dark half (-x) and a bright half (+x), parted by a straight edge through the origin.

    The edge is turned by `angle_deg` from +y towards -x.
    Source: the edge of ISO 12233; 5 degrees is its usual slant.
    """

    kind: Literal["slanted_edge"]
    width_m: Positive
    height_m: Positive
    angle_deg: Annotated[float, Field(gt=-45, lt=45)] = 5.0

    @model_validator(mode="after")
    def _crosses(self):
        if abs(self._reach_m) >= self.width_m / 2:
            raise ValueError(f"angle_deg: got {self.angle_deg:g}, allowed: an edge that ends at the top and the bottom "
                             f"of {self.width_m:g} x {self.height_m:g} m")  # fmt: skip
        return self

    @property
    def _reach_m(self) -> float:
        """How far the edge is at -x where it ends at the top."""
        return float(np.tan(np.radians(self.angle_deg))) * self.height_m / 2

    def make_parts(self) -> dict[str, Part]:
        w, h, reach = self.width_m / 2, self.height_m / 2, self._reach_m
        x, y = np.array([-w, reach, w, -w, -reach, w]), np.repeat([-h, h], 3)
        faces = np.array([[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4]])
        vertices = np.stack([x, y, np.zeros(6)], axis=-1)
        return {"face": Part(vertices, faces, self.tones, face_share=np.array([0.0, 0, 1, 1]))}


class CharucoBoard(FlatTarget):
    """A ChArUco board as OpenCV lays it out: a chessboard whose bright squares carry markers.

    `columns` x `rows` squares of `square_m`, the top left one dark; markers of `marker_m` with ids in reading order
    from `first_id`; `border_m` of bright board around.
    """

    kind: Literal["charuco_board"]
    dictionary: str = "DICT_5X5_100"
    columns: Annotated[int, Field(ge=3, le=40)]
    rows: Annotated[int, Field(ge=3, le=40)]
    square_m: Positive
    marker_m: Positive
    border_m: NonNegative = 0.01
    first_id: Annotated[int, Field(ge=0)] = 0

    @model_validator(mode="after")
    def _drawable(self):
        if self.marker_m >= self.square_m:
            raise ValueError(f"marker_m: got {self.marker_m:g} m, allowed: below square_m, {self.square_m:g} m")
        markers.check(self.dictionary, ids=self.ids)
        return self

    @property
    def ids(self) -> range:
        return range(self.first_id, self.first_id + self.rows * self.columns // 2)

    @property
    def width_m(self) -> float:
        return self.columns * self.square_m + 2 * self.border_m

    @property
    def height_m(self) -> float:
        return self.rows * self.square_m + 2 * self.border_m

    @property
    def _squares(self) -> list[tuple[int, int]]:
        """Row and column of the bright squares, in reading order."""
        return [(row, column) for row in range(self.rows) for column in range(self.columns) if (row + column) % 2]

    def _place(self, row: float, column: float) -> tuple[float, float, float]:
        return ((column - self.columns / 2) * self.square_m, (self.rows / 2 - row) * self.square_m, 0.0)

    @property
    def corners_m(self) -> np.ndarray:
        """Corners of all markers in the body's frame, (n, 4, 3): top left, top right, bottom right, bottom left."""
        middles = np.array([self._place(row + 0.5, column + 0.5) for row, column in self._squares])
        half = self.marker_m / 2
        offsets = np.array([[-half, half, 0], [half, half, 0], [half, -half, 0], [-half, -half, 0]])
        return middles[:, None] + offsets[None]

    @property
    def chessboard_corners_m(self) -> np.ndarray:
        """The inner corners of the chessboard in the body's frame (n, 3), in OpenCV's order of their ids."""
        return np.array([self._place(row, column) for row in range(1, self.rows) for column in range(1, self.columns)])

    def make_parts(self) -> dict[str, Part]:
        patterns = [markers.modules(self.dictionary, marker_id) for marker_id in self.ids]
        modules = len(patterns[0])
        per_square = modules + 2  # a margin on either side of the marker
        inside = (self.square_m - self.marker_m) / 2 + np.arange(modules + 1) * self.marker_m / modules
        lines_x, lines_y = (self._lines(inside, count) for count in (self.columns, self.rows))
        tone = np.zeros((self.rows * per_square, self.columns * per_square))
        for (row, column), pattern in zip(self._squares, patterns, strict=True):
            square = tone[row * per_square :, column * per_square :][:per_square, :per_square]
            square[:] = 1.0
            square[1:-1, 1:-1] = pattern
        tone = np.pad(tone, 1, constant_values=1.0) if self.border_m > 0 else tone
        x, y = np.meshgrid(lines_x - self.width_m / 2, self.height_m / 2 - lines_y)
        vertices = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=-1)
        faces = grid_faces(len(lines_y), len(lines_x))
        return {"face": Part(vertices, faces, self.tones, face_share=np.tile(tone.ravel(), 2))}

    def _lines(self, inside: np.ndarray, count: int) -> np.ndarray:
        """Return where tones may change along a side, from its beginning. [m]"""
        lines = (self.border_m + np.arange(count)[:, None] * self.square_m + np.append(0, inside)).ravel()
        lines = np.append(lines, self.border_m + count * self.square_m)
        return np.concatenate([[0], lines, [lines[-1] + self.border_m]]) if self.border_m > 0 else lines
