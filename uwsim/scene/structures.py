"""What tanks and harbours are made of: a tank, a rusty wall with a weld seam, a pipe, a rope."""

from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from uwsim.scene import noise
from uwsim.scene.base import NonNegative, Positive
from uwsim.scene.placed import Reflectance
from uwsim.scene.surface import Part, TwoTone, check_vertices, generator, grid_faces, revolved, tube

_SIDES = 96  # of a pipe
_ROPE_SIDES, _ROPE_STEPS = 72, 24  # points around; rows per turn of a strand


class Tank(TwoTone):
    """Floor and four walls of a tank, open at the top, as seen from inside.

    The origin is the middle of the floor; `width_m` along x, `length_m` along y, `depth_m` along z. With `tile_m` they
    are `bright` tiles with `dark` joints `joint_m` wide; else all is bright.
    """

    kind: Literal["tank"]
    width_m: Positive
    length_m: Positive
    depth_m: Positive
    tile_m: Positive | None = None
    joint_m: Positive = 0.004
    dark: Reflectance = 0.15
    bright: Reflectance = 0.45

    @model_validator(mode="after")
    def _usable(self):
        if self.tile_m is not None:
            if self.joint_m >= 0.5 * self.tile_m:
                raise ValueError(f"joint_m: got {self.joint_m:g} m, allowed: below half of tile_m, "
                                 f"{0.5 * self.tile_m:g} m")  # fmt: skip
            lines = [2 * side / self.tile_m + 3 for side in (self.width_m, self.length_m, self.depth_m)]
            x, y, z = lines
            check_vertices(int(x * y + 2 * (x + y) * z), where=f"body {self.name}: tile_m {self.tile_m:g} m")
        _ = self.tones
        return self

    def make_parts(self) -> dict[str, Part]:
        w, l, d = self.width_m, self.length_m, self.depth_m
        x, y, z = np.eye(3)
        planes = (
            (np.array([-w / 2, -l / 2, 0]), x * w, y * l),
            (np.array([-w / 2, l / 2, 0]), x * w, z * d),
            (np.array([w / 2, -l / 2, 0]), -x * w, z * d),
            (np.array([w / 2, l / 2, 0]), -y * l, z * d),
            (np.array([-w / 2, -l / 2, 0]), y * l, z * d),
        )
        names = ("floor", "back", "front", "right", "left")
        return {name: self._tiled(*plane) for name, plane in zip(names, planes, strict=True)}

    def _tiled(self, corner: np.ndarray, along: np.ndarray, up: np.ndarray) -> Part:
        """Return a rectangle that begins at a corner and faces along x up."""
        sides = [np.linalg.norm(side) for side in (along, up)]
        (u, is_joint_u), (v, is_joint_v) = (_tiles(side, tile_m=self.tile_m, joint_m=self.joint_m) for side in sides)
        grid_u, grid_v = np.meshgrid(u / sides[0], v[::-1] / sides[1])
        vertices = corner + grid_u.reshape(-1, 1) * along + grid_v.reshape(-1, 1) * up
        joint = is_joint_v[::-1, None] | is_joint_u[None]
        return Part(vertices, grid_faces(len(v), len(u)), self.tones, face_share=np.tile(1.0 - joint.ravel(), 2))


def _tiles(side_m: float, *, tile_m: float | None, joint_m: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the borders (n,) of tiles and joints along a side, and which of the n - 1 between them are joints."""
    if tile_m is None:
        return np.array([0, side_m]), np.array([False])
    starts = np.arange(tile_m, side_m, tile_m)
    inner = np.stack([starts - joint_m / 2, starts + joint_m / 2], axis=-1).ravel()
    borders = np.concatenate([[0], inner[(inner > 0) & (inner < side_m)], [side_m]])
    middles = (borders[1:] + borders[:-1]) / 2
    return borders, np.abs(middles - tile_m * np.round(middles / tile_m)) < joint_m / 2


class RustyWall(TwoTone):
    """A steel wall in the body's x-y plane with paint (`bright`) and rust (`dark`), and a weld seam along x at y = 0.

    `rust_share`: how much of it is rusty, about. Rust lifts the surface by up to `rust_m` and runs down from where it
    is (along -y). The seam is a bead `seam_width_m` wide and `seam_height_m` high with the ripples of the pool that
    solidified, `seam_pitch_m` apart, of the reflectance `seam`; 0 width: none.
    """

    kind: Literal["rusty_wall"]
    width_m: Positive
    height_m: Positive
    rust_share: Annotated[float, Field(ge=0, le=1)] = 0.45
    rust_m: NonNegative = 0.002
    seam_width_m: NonNegative = 0.014
    seam_height_m: NonNegative = 0.004
    seam_pitch_m: Positive = 0.006
    spacing_m: Positive = 0.002
    dark: Reflectance = "rust"
    bright: Reflectance = 0.30
    seam: Reflectance = 0.20
    seed: Annotated[int, Field(ge=0)]

    @model_validator(mode="after")
    def _usable(self):
        check_vertices(len(self._x_m) * len(self._y_m), where=f"body {self.name}: spacing_m {self.spacing_m:g} m")
        if self.seam_width_m >= self.height_m:
            raise ValueError(f"seam_width_m: got {self.seam_width_m:g} m, allowed: below height_m, {self.height_m:g} m")
        if self.seam_width_m > 0 and self.seam_pitch_m < 2 * self.spacing_m:
            raise ValueError(f"seam_pitch_m: got {self.seam_pitch_m:g} m, allowed: at least 2 spacing_m, "
                             f"{2 * self.spacing_m:g} m")  # fmt: skip
        _ = self.tones, self.tone("seam")
        return self

    @property
    def _x_m(self) -> np.ndarray:
        return np.linspace(-0.5, 0.5, 1 + max(1, round(self.width_m / self.spacing_m))) * self.width_m

    @property
    def _y_m(self) -> np.ndarray:
        """Rows from the top; the seam has rows of its own, so that it ends where it says."""
        count = 1 + max(1, round(self.height_m / self.spacing_m))
        rows = np.linspace(0.5, -0.5, count) * self.height_m
        if self.seam_width_m == 0:
            return rows
        half = self.seam_width_m / 2
        return np.concatenate([rows[rows > half * 1.01], np.linspace(half, -half, 13), rows[rows < -half * 1.01]])

    def make_parts(self) -> dict[str, Part]:
        x, y = (axis.ravel() for axis in np.meshgrid(self._x_m, self._y_m))
        height, share = self._rust(np.stack([x, y, np.zeros_like(x)], axis=-1))
        height = height + self._bead(x, y)
        vertices = np.stack([x, y, height], axis=-1)
        faces = grid_faces(len(self._y_m), len(self._x_m))
        on_seam = np.all(np.abs(y[faces]) <= self.seam_width_m / 2 * 1.001, axis=-1) & (self.seam_width_m > 0)
        parts = {"wall": Part(vertices, faces[~on_seam], self.tones, vertex_share=share)}
        if on_seam.any():
            # a weld rusts as the wall does, and is bare steel where it does not
            tones = (self.tone("dark"), self.tone("seam"))
            parts["seam"] = Part(vertices, faces[on_seam], tones, vertex_share=np.clip(0.35 + 0.65 * share, 0, 1))
        return parts

    def _rust(self, flat: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return how high rust lifts the surface (n,) [m], and the shares of the paint."""
        rng = generator(self.seed, "rust")
        patches = noise.fractal_noise(flat / 0.16, octaves=6, rng=rng, gain=0.6)
        # what is above decides what runs down: noise that is long along y
        runs = noise.fractal_noise(flat / np.array([0.025, 0.5, 1.0]), octaves=4, rng=rng)
        pits = noise.fractal_noise(flat / 0.008, octaves=3, rng=rng)
        rust = patches + 0.45 * runs + 0.12 * pits
        if self.seam_width_m > 0:
            rust = rust + 0.35 * np.exp(-((flat[:, 1] / (2 * self.seam_width_m)) ** 2))  # heat took the paint off
        limit = np.quantile(rust, 1 - self.rust_share)
        rusty = noise.contrast(rust, threshold=limit, softness=0.16)
        height = self.rust_m * rusty * (0.6 + 0.4 * np.clip(pits, -1, 1))
        tint = np.clip(rusty * (0.94 + 0.22 * pits), 0, 1)
        return height, np.clip(1 - tint - 0.05 * (1 - rusty) * np.abs(runs), 0, 1)

    def _bead(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        if self.seam_width_m == 0:
            return np.zeros_like(x)
        across = np.clip(2 * y / self.seam_width_m, -1, 1)
        ripples = np.cos(2 * np.pi * (x / self.seam_pitch_m + 0.9 * across**2))
        return self.seam_height_m * np.sqrt(np.clip(1 - across**2, 0, 1)) * (1 + 0.16 * ripples) / 1.16


class Pipe(TwoTone):
    """A pipe along the body's z axis with its middle in the origin, open at both ends, with a flange at each.

    `radius_m` is the outer one; without `flange_m` (how far flanges stand out) there are none. `fouling`: share of the
    tone `dark` in patches.
    """

    kind: Literal["pipe"]
    length_m: Positive
    radius_m: Positive
    wall_m: Positive = 0.004
    flange_m: NonNegative = 0.0
    flange_length_m: Positive = 0.012
    fouling: Annotated[float, Field(ge=0, le=1)] = 0.3
    dark: Reflectance = "leaf_brown"
    bright: Reflectance = 0.40
    seed: Annotated[int, Field(ge=0)] = 0

    @model_validator(mode="after")
    def _usable(self):
        if self.wall_m >= self.radius_m:
            raise ValueError(f"wall_m: got {self.wall_m:g} m, allowed: below radius_m, {self.radius_m:g} m")
        if self.flange_m > 0 and 2 * self.flange_length_m >= self.length_m:
            raise ValueError(f"flange_length_m: got {self.flange_length_m:g} m, allowed: below half of length_m, "
                             f"{self.length_m / 2:g} m")  # fmt: skip
        _ = self.tones
        return self

    def make_parts(self) -> dict[str, Part]:
        vertices, faces = revolved(self._profile(), sides=_SIDES)
        rng = generator(self.seed, "fouling")
        size_m = 2.0 * self.radius_m
        patches = noise.fractal_noise(vertices / size_m, octaves=6, rng=rng, gain=0.65)
        limit = np.quantile(patches, 1 - self.fouling) if self.fouling > 0 else np.inf
        share = 1 - noise.contrast(patches, threshold=limit, softness=0.2)
        return {"pipe": Part(vertices, faces, self.tones, vertex_share=share)}

    def _profile(self) -> np.ndarray:
        """Return radius and height (n, 2) around the wall's section, in steps that show the fouling."""
        outer, inner, half = self.radius_m, self.radius_m - self.wall_m, self.length_m / 2
        rows = np.linspace(-1, 1, int(np.clip(self.length_m / (0.08 * self.radius_m), 8, 400)))
        if self.flange_m == 0:
            out = np.stack([np.full(len(rows), outer), rows * half], axis=-1)
        else:
            wide, edge = outer + self.flange_m, half - self.flange_length_m
            middle = np.stack([np.full(len(rows), outer), rows * edge], axis=-1)
            out = np.concatenate([[(wide, -half), (wide, -edge)], middle, [(wide, edge), (wide, half)]])
        inside = np.stack([np.full(len(rows), inner), -rows * half], axis=-1)
        return np.concatenate([out, inside])


class Rope(TwoTone):
    """A laid rope of three strands between (-length_m / 2, 0, 0) and (length_m / 2, 0, 0) that sags along -y.

    `length_m` is the distance of its ends, `sag_m` how far the middle hangs below them (a parabola), `lay_m` the length
    in which a strand goes round once. Fibres mix the tones; the grooves between strands are dark.
    """

    kind: Literal["rope"]
    length_m: Positive
    diameter_m: Positive
    sag_m: NonNegative = 0.0
    lay_m: Positive | None = None
    dark: Reflectance = "soil_wet"
    bright: Reflectance = "soil_dry"
    seed: Annotated[int, Field(ge=0)] = 0

    @model_validator(mode="after")
    def _usable(self):
        if self.diameter_m > 0.2 * self.length_m:
            raise ValueError(f"diameter_m: got {self.diameter_m:g} m, allowed: up to a fifth of length_m, "
                             f"{0.2 * self.length_m:g} m")  # fmt: skip
        if self.sag_m > self.length_m:
            raise ValueError(f"sag_m: got {self.sag_m:g} m, allowed: up to length_m, {self.length_m:g} m")
        check_vertices(self._rows * _ROPE_SIDES, where=f"body {self.name}")
        _ = self.tones
        return self

    @property
    def _turn_m(self) -> float:
        return self.lay_m if self.lay_m is not None else 3.5 * self.diameter_m

    @property
    def _rows(self) -> int:
        return 2 + int((self.length_m + 2 * self.sag_m) / self._turn_m * _ROPE_STEPS)

    def make_parts(self) -> dict[str, Part]:
        t = np.linspace(-1, 1, self._rows)
        line = np.stack([t * self.length_m / 2, self.sag_m * (t**2 - 1), np.zeros_like(t)], axis=-1)
        way = np.gradient(line, axis=0)
        way /= np.linalg.norm(way, axis=-1, keepdims=True)
        along = np.append(0, np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=-1)))
        angle = np.arange(_ROPE_SIDES) * 2 * np.pi / _ROPE_SIDES
        side = np.array([0, 0, 1.0])
        up = np.cross(side, way)
        around = np.cos(angle)[None, :, None] * up[:, None] + np.sin(angle)[None, :, None] * np.cross(way, up)[:, None]
        # angle to the middle of the nearest strand
        off = (angle[None] - 2 * np.pi * along[:, None] / self._turn_m + np.pi / 3) % (2 * np.pi / 3) - np.pi / 3
        radius = _three_strands(off) * self.diameter_m / 2
        vertices, faces = tube(line[:, None] + radius[..., None] * around)
        rng = generator(self.seed, "fibres")
        fibres = np.stack([off * 7, along[:, None] / (0.6 * self.diameter_m) + 0 * off, 0 * off], axis=-1)
        share = 0.78 + 0.3 * noise.fractal_noise(fibres.reshape(-1, 3), octaves=3, rng=rng)
        share = share * (0.25 + 0.75 * np.cos(1.35 * off.ravel()) ** 2)
        return {"rope": Part(vertices, faces, self.tones, vertex_share=np.clip(np.append(share, [0.5, 0.5]), 0, 1))}


def _three_strands(off: np.ndarray) -> np.ndarray:
    """Return the radius of three touching circles about the origin, within the unit circle, at angles off a circle."""
    strand = 1 / (1 + 2 / np.sqrt(3))
    middle = 1 - strand
    return middle * np.cos(off) + np.sqrt(np.maximum(strand**2 - (middle * np.sin(off)) ** 2, 0))
