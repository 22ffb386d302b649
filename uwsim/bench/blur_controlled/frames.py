"""Frames in motion of exactly known blur, made when asked for: each from named random streams, so also each alone."""

import hashlib
import json
import math
from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np

from uwsim import seeds
from uwsim.bench.blur_controlled import textures
from uwsim.bench.blur_controlled.protocol import Protocol, Texture
from uwsim.motion_blur.kernels import otf

QUANTISATION_STD = 1 / 255 / math.sqrt(12)
SUB_FRAMES_PER_PX = 4
LEAST_SUB_FRAMES = 8
_MARGIN_PX = 2


@dataclass(frozen=True)
class Shot:
    """Which frame: texture, blur and noise; at length 0 it is sharp."""

    texture: str
    blurred_by: str
    length_px: float
    angle_deg: float
    noise_percent: float
    place: int = 0

    @property
    def name(self) -> str:
        motion = f"{self.blurred_by}/{self.length_px:g}px/{self.angle_deg:g}deg" if self.length_px else "sharp"
        place = f"/place{self.place}" if self.place else ""
        return f"{self.texture}/{motion}/{self.noise_percent:g}%{place}"


@dataclass(frozen=True)
class Made:
    """A frame: `image` (side, side, 3) float32 linear of 256 levels, all bands alike; `sharp` (side, side) float64.

    `noise_std`: of the image, with what rounding to 8 bits adds.
    """

    shot: Shot
    image: np.ndarray
    sharp: np.ndarray
    noise_std: float


@dataclass(frozen=True)
class Frames:
    """The frames of a protocol; it stands for a dataset: `name`, `seed`, `sha256`."""

    protocol: Protocol
    quick: bool

    name = "made while it runs"

    @property
    def seed(self) -> int:
        return self.protocol.seed

    @cached_property
    def sha256(self) -> str:
        """Hash of the protocol and of the pictures that its textures are made of."""
        found = hashlib.sha256(json.dumps(self.protocol.model_dump(mode="json"), sort_keys=True).encode())
        for name in sorted({one.picture for one in self.protocol.textures.values() if one.picture}):
            found.update(textures.picture(name).tobytes())
        return found.hexdigest()

    @cached_property
    def shots(self) -> dict[str, Shot]:
        """Name -> shot, in the order of the protocol."""
        protocol, found = self.protocol, {}
        for part in protocol.quick_parts if self.quick else protocol.parts:
            names = part.textures or tuple(protocol.textures)
            grid = product(names, part.lengths_px, part.angles_deg, part.noise_percent, range(part.places))
            for texture, length_px, angle_deg, noise_percent, place in grid:
                shot = Shot(texture, part.blurred_by, length_px, angle_deg, noise_percent, place)
                found[shot.name] = shot
        return found

    def texture(self, name: str) -> Texture:
        return self.protocol.textures[name]

    def frame(self, name: str) -> Made:
        """Return a frame by its name; ValueError for unknown ones."""
        if name not in self.shots:
            raise ValueError(f"frame: got {name!r}, allowed: one of the {len(self.shots)} of the benchmark")
        shot, seed = self.shots[name], self.seed
        source = self._source(shot)
        sharp = _middle(source, self.protocol.side_px)
        blurred = _middle(blurred_source(source, shot), self.protocol.side_px)
        noise = seeds.generator(seed, 0, f"{name} noise").standard_normal(blurred.shape)
        levels = np.rint(255 * np.clip(blurred + shot.noise_percent / 100 * noise, 0, 1)).astype(np.float32)
        noise_std = math.hypot(shot.noise_percent / 100, QUANTISATION_STD)
        return Made(shot, np.repeat(levels[..., None] / np.float32(255), 3, axis=-1), sharp, noise_std)

    def _source(self, shot: Shot) -> np.ndarray:
        texture, side = self.texture(shot.texture), self.protocol.side_px
        if texture.picture is None:
            rng = seeds.generator(self.seed, 0, f"{shot.name} texture")
            return textures.drawn_field(texture, rng=rng)
        margin = math.ceil(shot.length_px / 2) + _MARGIN_PX if shot.length_px else 0
        return textures.crop(texture, place=shot.place, side_px=side, margin_px=margin)


def blurred_source(source: np.ndarray, shot: Shot) -> np.ndarray:
    """Return a crop (H, W) blurred as the shot says, exactly where the motion brings nothing in from outside.

    The crop goes on as its own mirror image, so that no edge at its border rings into the frame.
    """
    if shot.length_px == 0:
        return source
    height, width = source.shape
    mirrored = np.pad(source, ((0, height), (0, width)), mode="symmetric")
    spectrum = np.fft.fft2(mirrored) * transfer(mirrored.shape, shot)
    return np.fft.ifft2(spectrum).real[:height, :width]


def transfer(shape: tuple[int, int], shot: Shot) -> np.ndarray:
    """Return the transfer function of a shot: exact, or the mean of sub-frames moved by whole phases.

    Sub-frames lie in the middle of equal parts of the exposure. Those that include both of its ends make a blur of
    n / (n - 1) times the length: `sub_frames_with_ends`, to show that.
    """
    if shot.blurred_by == "otf":
        return otf(shape, length_px=shot.length_px, angle_deg=shot.angle_deg)
    count = sub_frames(shot.length_px)
    if shot.blurred_by == "sub_frames":
        moments = (np.arange(count) + 0.5) / count - 0.5
    else:
        moments = np.linspace(-0.5, 0.5, count)
    angle = math.radians(shot.angle_deg)
    right, down = shot.length_px * math.cos(angle), -shot.length_px * math.sin(angle)
    u, v = np.fft.fftfreq(shape[1]), np.fft.fftfreq(shape[0])
    columns = np.exp(-2j * np.pi * right * np.outer(moments, u))
    rows = np.exp(-2j * np.pi * down * np.outer(moments, v))
    return rows.T @ columns / count


def sub_frames(length_px: float) -> int:
    """Return how many sub-frames an exposure is made of: four per pixel of the motion, at least 8."""
    return max(LEAST_SUB_FRAMES, math.ceil(SUB_FRAMES_PER_PX * length_px))


def _middle(image: np.ndarray, side_px: int) -> np.ndarray:
    top, left = ((side - side_px) // 2 for side in image.shape)
    return image[top : top + side_px, left : left + side_px]
