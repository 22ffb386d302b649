"""A bed of rippled sand."""

from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from uwsim.scene import noise
from uwsim.scene.base import NonNegative, Positive
from uwsim.scene.placed import Reflectance
from uwsim.scene.surface import Part, TwoTone, check_vertices, generator, grid_faces

_DARK_GRAINS, _PALE_GRAINS = 0.03, 0.02  # shares
_STEEP = 0.35  # how much nearer the crest is to the lee side, relative to a quarter of a wavelength


class Sand(TwoTone):
    """Sand over the body's x-y plane: ripples, mounds, and grain in height and tone.

    Ripples have a gentle and a steep side, crests that wander and fork, and run along y when `ripple_azimuth_deg` is
    0 (the angle from x towards y in which they travel). `ripple_height_m` is from trough to crest. `spacing_m`: of the
    surface's points; grain finer than that does not show. Height 0 is the mean plane.
    Source: a height of 0.1 to 0.2 of the length is that of vortex ripples (Nielsen 1981, J. Geophys. Res. 86:6467).
    """

    kind: Literal["sand"]
    width_m: Positive
    height_m: Positive
    ripple_length_m: Positive = 0.09
    ripple_height_m: NonNegative = 0.010
    ripple_azimuth_deg: float = 0.0
    mound_m: NonNegative = 0.01
    grain_m: NonNegative = 0.0004
    spacing_m: Positive = 0.004
    dark: Reflectance = "soil_wet"
    bright: Reflectance = "soil_dry"
    seed: Annotated[int, Field(ge=0)]

    @model_validator(mode="after")
    def _usable(self):
        check_vertices(int(np.prod(self.shape)), where=f"body {self.name}: spacing_m {self.spacing_m:g} m")
        if self.ripple_length_m < 4 * self.spacing_m:
            raise ValueError(f"ripple_length_m: got {self.ripple_length_m:g} m, allowed: at least 4 spacing_m, "
                             f"{4 * self.spacing_m:g} m")  # fmt: skip
        if self.ripple_height_m > 0.3 * self.ripple_length_m:
            raise ValueError(f"ripple_height_m: got {self.ripple_height_m:g} m, allowed: up to 0.3 ripple_length_m, "
                             f"{0.3 * self.ripple_length_m:g} m (steeper sand slides)")  # fmt: skip
        _ = self.tones
        return self

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of points."""
        return tuple(1 + max(1, round(side / self.spacing_m)) for side in (self.height_m, self.width_m))

    def make_parts(self) -> dict[str, Part]:
        rows, columns = self.shape
        x, y = np.meshgrid(np.linspace(-0.5, 0.5, columns) * self.width_m, np.linspace(0.5, -0.5, rows) * self.height_m)
        flat = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=-1)
        height, share = self._relief(flat)
        vertices = flat + height[:, None] * np.array([0, 0, 1.0])
        return {"sand": Part(vertices, grid_faces(rows, columns), self.tones, vertex_share=share)}

    def _relief(self, flat: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return heights (n,) [m] and shares of the bright tone at points (n, 3) of the plane."""
        rng = generator(self.seed, "sand")
        azimuth = np.radians(self.ripple_azimuth_deg)
        along = flat @ np.array([np.cos(azimuth), np.sin(azimuth), 0])
        in_lengths = flat / self.ripple_length_m
        bends = 2.6 * noise.fractal_noise(0.16 * in_lengths, octaves=3, rng=rng)
        phase = 2 * np.pi * along / self.ripple_length_m + bends
        wave = np.cos(phase + _STEEP * np.sin(phase))
        strength = np.clip(0.8 + 0.5 * noise.fractal_noise(0.3 * in_lengths, octaves=2, rng=rng), 0.15, 1.0)
        mounds = noise.fractal_noise(flat / 0.5, octaves=3, rng=rng)
        grain = rng.normal(size=len(flat))
        height = 0.5 * self.ripple_height_m * strength * wave + self.mound_m * mounds
        # troughs collect the darker, coarser grains
        share = 0.70 + 0.10 * strength * wave + 0.10 * mounds + 0.13 * grain
        # grains of dark minerals, and pale ones of shell
        kind = rng.uniform(size=len(flat))
        share += np.where(kind < _DARK_GRAINS, -0.6, np.where(kind > 1 - _PALE_GRAINS, 0.4, 0.0))
        return height - height.mean() + self.grain_m * np.clip(grain, -2, 2) / 2, np.clip(share, 0, 1)
