"""Water plants that bend in a current."""

from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from uwsim.scene import noise
from uwsim.scene.base import NonNegative, Positive
from uwsim.scene.placed import Reflectance
from uwsim.scene.surface import Part, TwoTone, generator, grid_faces, merged, tube

_POINTS = 33  # along a blade
_LEAF_POINTS = 9
_ACROSS = 3  # points across a blade: a shallow gutter
_SIDES = 6  # of a stem
_WAVE_SHARE = 0.35  # wavelengths of the sway along a blade
_SPREAD_DEG = 22.0


class Plants(TwoTone):
    """Eelgrass (`blades`) or pondweed (`stems`) that grows along the body's z axis from a field about its origin.

    A current along `current_azimuth_deg` (from the body's x towards y) leans the tips over by `lean_deg`; they sway
    about that by `sway_deg` at `sway_phase_deg` of a cycle, which travels upwards along the plant and over the field
    in the direction of the current (a cycle per `sway_length_m`). Lengths stay as they are. Blades and leaves are thin,
    the same on both sides and let no light through.

    `sway_phase_deg` holds at time 0 of a sequence; every `sway_period_s` a cycle is over (`swayed`). Within an exposure
    plants are at rest, in picture and flow. With the values below tips reach 0.08 m/s and half of the surface stays
    under 0.013 m/s: 1.4 and 0.2 px in 16 ms, 1 m before a camera of f = 763 px behind a flat port.
    Source: lean, sway and period are this project's choice; the period is that of `trajectories.Heave`.
    """

    kind: Literal["plants"]
    form: Literal["blades", "stems"] = "blades"
    count: Annotated[int, Field(ge=1, le=200)] = 1
    field_m: tuple[NonNegative, NonNegative] = (0.0, 0.0)
    length_m: Positive = 0.30
    width_m: Positive = 0.006
    leaves: Annotated[int, Field(ge=1, le=60)] = 7
    lean_deg: Annotated[float, Field(ge=0, le=80)] = 15.0
    current_azimuth_deg: float = 0.0
    sway_deg: Annotated[float, Field(ge=0, le=60)] = 15.0
    sway_phase_deg: float = 0.0
    sway_period_s: Positive = 3.0
    sway_length_m: Positive = 0.8
    dark: Reflectance = "leaf_green"
    bright: Reflectance = "leaf_young"
    seed: Annotated[int, Field(ge=0)]

    @model_validator(mode="after")
    def _usable(self):
        if self.width_m > 0.25 * self.length_m:
            raise ValueError(f"width_m: got {self.width_m:g} m, allowed: up to a quarter of length_m, "
                             f"{0.25 * self.length_m:g} m")  # fmt: skip
        _ = self.tones
        return self

    def swayed(self, time_s: float) -> float:
        """Return the phase `time_s` after the time that `sway_phase_deg` is for, in [0, 360). [deg]"""
        return float((self.sway_phase_deg + 360.0 * time_s / self.sway_period_s) % 360.0)

    def make_parts(self) -> dict[str, Part]:
        rng = generator(self.seed, "plants")
        half = np.array(self.field_m) / 2
        pieces = []
        for _ in range(self.count):
            root = np.append(rng.uniform(-half, half), 0.0)
            pieces += (self._blades if self.form == "blades" else self._stem)(root, rng)
        vertices, faces, share = merged(pieces)
        share = share + 0.25 * noise.fractal_noise(vertices / 0.02, octaves=2, rng=rng)
        return {"plants": Part(vertices, faces, self.tones, vertex_share=np.clip(share, 0, 1))}

    def _blades(self, root: np.ndarray, rng: np.random.Generator) -> list[tuple]:
        pieces = []
        for _ in range(self.leaves):
            length = self.length_m * rng.uniform(0.55, 1.0)
            side = rng.uniform(0, 2 * np.pi)
            foot = root + 1.2 * self.width_m * np.array([np.cos(side), np.sin(side), 0])
            line, way = self._line(foot, length, side, rng, points=_POINTS)
            s = np.linspace(0, 1, _POINTS)
            width = self.width_m * np.minimum(1, 0.55 + 2 * s) * np.sqrt(np.clip((1 - s) / 0.12, 0.02, 1))
            twist = side + np.pi / 2 + rng.normal(0, 0.5) + rng.normal(0, 0.9) * s
            pieces.append((*_ribbon(line, way, width, twist), np.repeat(0.25 + 0.55 * s, _ACROSS)))
        return pieces

    def _stem(self, root: np.ndarray, rng: np.random.Generator) -> list[tuple]:
        length, side = self.length_m * rng.uniform(0.7, 1.0), rng.uniform(0, 2 * np.pi)
        line, way = self._line(root, length, side, rng, points=_POINTS)
        s = np.linspace(0, 1, _POINTS)
        radius = 0.18 * self.width_m * (1 - 0.7 * s)
        across = _perpendicular(way, np.zeros(_POINTS))
        angle = np.arange(_SIDES) * 2 * np.pi / _SIDES
        around = np.cos(angle)[:, None] * across[:, None] + np.sin(angle)[:, None] * np.cross(way, across)[:, None]
        vertices, faces = tube(line[:, None] + radius[:, None, None] * around)
        pieces = [(vertices, faces, np.full(len(vertices), 0.15))]
        turn = rng.uniform(0, 2 * np.pi)
        for number in range(self.leaves):
            at = int(np.clip((0.12 + 0.86 * number / self.leaves) * (_POINTS - 1), 0, _POINTS - 2))
            for side in (turn, turn + np.pi):
                pieces.append(self._leaf(line[at], way[at], side + rng.normal(0, 0.15), 1 - 0.55 * s[at], rng))
            turn += np.radians(90 + rng.normal(0, 8))  # pairs stand crosswise
        return pieces

    def _leaf(self, foot: np.ndarray, way: np.ndarray, side: float, size: float, rng: np.random.Generator) -> tuple:
        s = np.linspace(0, 1, _LEAF_POINTS)
        out = _perpendicular(way[None], np.array([side]))[0]
        rise = np.radians(rng.uniform(35, 60)) - 0.7 * s
        step = np.cos(rise)[:, None] * out + np.sin(rise)[:, None] * way
        length = 7 * self.width_m * size * rng.uniform(0.8, 1.1)
        line = foot + length / (_LEAF_POINTS - 1) * np.concatenate([np.zeros((1, 3)), np.cumsum(step[:-1], axis=0)])
        width = 1.6 * self.width_m * size * (np.sin(np.pi * (0.04 + 0.96 * s) ** 0.8) + 0.04)
        flat = np.cross(way, out)
        vertices, faces = _band(line, np.broadcast_to(flat, line.shape), np.cross(flat, step), width)
        return vertices, faces, np.repeat(0.3 + 0.4 * s, _ACROSS)

    def _line(
        self, foot: np.ndarray, length: float, side: float, rng: np.random.Generator, *, points: int
    ) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
        """Return points (n, 3) along a blade of a given length, and its unit direction at each of them."""
        s = np.linspace(0, 1, points)
        current, own = (np.array([np.cos(a), np.sin(a), 0]) for a in (np.radians(self.current_azimuth_deg), side))
        travel = np.radians(self.sway_phase_deg) - 2 * np.pi * (foot @ current) / self.sway_length_m
        lag = rng.normal(0, 0.5)
        sway = np.radians(self.sway_deg) * np.sin(travel + lag - 2 * np.pi * _WAVE_SHARE * s)
        with_current = np.tan(np.clip((np.radians(self.lean_deg) + sway) * s**0.7, -1.45, 1.45))
        apart = np.tan(np.radians(rng.uniform(0.2, 1.0) * _SPREAD_DEG)) * (0.4 + 0.6 * s)
        way = np.array([0, 0, 1.0]) + with_current[:, None] * current + apart[:, None] * own
        way /= np.linalg.norm(way, axis=-1, keepdims=True)
        step = length / (points - 1)
        return foot + step * np.concatenate([np.zeros((1, 3)), np.cumsum((way[1:] + way[:-1]) / 2, axis=0)]), way


def _perpendicular(way: np.ndarray, azimuth: np.ndarray) -> np.ndarray:
    """Return unit vectors (n, 3) at right angles to `way` (n, 3) that point as nearly as possible to azimuths (n,)."""
    towards = np.stack([np.cos(azimuth), np.sin(azimuth), np.zeros(len(azimuth))], axis=-1)
    across = towards - np.einsum("ni,ni->n", towards, way)[:, None] * way
    return across / np.linalg.norm(across, axis=-1, keepdims=True)


def _ribbon(line: np.ndarray, way: np.ndarray, width: np.ndarray, azimuth: np.ndarray) -> tuple:
    across = _perpendicular(way, azimuth)
    return _band(line, across, np.cross(across, way), width)


def _band(line: np.ndarray, across: np.ndarray, normal: np.ndarray, width: np.ndarray) -> tuple:
    """Return vertices and faces of a band of a given width (n,) along a line (n, 3), with a gutter in its middle."""
    share = np.linspace(-0.5, 0.5, _ACROSS)
    depth = 0.15 * (4 * share**2 - 1)
    vertices = line[:, None] + width[:, None, None] * (
        share[None, :, None] * across[:, None] + depth[None, :, None] * normal[:, None]
    )
    return vertices.reshape(-1, 3), grid_faces(len(line), _ACROSS)
