"""Stones that lie on a plane."""

from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator
from scipy.spatial.transform import Rotation

from uwsim.scene import noise
from uwsim.scene.base import NonNegative, Positive
from uwsim.scene.placed import Reflectance
from uwsim.scene.surface import Part, TwoTone, generator, icosphere, merged, scattered

_LEVEL = 5  # of subdivision: 10,242 vertices
_SUNK = 0.12  # share of a stone's height below the plane
_CUTS = 14
_SIDE_RATIOS = ((0.6, 0.95), (0.5, 0.9))  # of the second to the longest, of the third to the second


class Stones(TwoTone):
    """Stones scattered over a field about the body's origin, lying in its x-y plane and a little sunk into it.

    `diameters_m`: smallest and largest longest side of a stone, log-uniform between. Ellipsoids of unequal sides, cut
    by planes (`angularity` 0: pebbles, 1: broken rock) and displaced by fractal noise (`roughness`, relative to the
    radius). Grains and veins mix the tones `dark` and `bright`. Each stone is a closed surface.
    """

    kind: Literal["stones"]
    count: Annotated[int, Field(ge=1, le=60)] = 1
    diameters_m: tuple[Positive, Positive]
    field_m: tuple[NonNegative, NonNegative] = (0.0, 0.0)
    angularity: Annotated[float, Field(ge=0, le=1)] = 0.5
    roughness: Annotated[float, Field(ge=0, le=0.3)] = 0.08
    dark: Reflectance = "soil_wet"
    bright: Reflectance = "basalt"
    seed: Annotated[int, Field(ge=0)]

    @model_validator(mode="after")
    def _usable(self):
        if self.diameters_m[0] > self.diameters_m[1]:
            raise ValueError(f"diameters_m: got {self.diameters_m}, allowed: the smallest first")
        _ = self.places_m, self.tones
        return self

    @property
    def sizes_m(self) -> np.ndarray:
        """The longest side of each stone's bounding box before it is turned, (count,). [m]"""
        draws = generator(self.seed, "sizes").uniform(*np.log(self.diameters_m), self.count)
        return np.exp(draws)

    @property
    def places_m(self) -> np.ndarray:
        """Where each stone lies in the body's x-y plane, (count, 2). [m]"""
        rng = generator(self.seed, "places")
        return scattered(self.sizes_m / 2, field_m=self.field_m, rng=rng, where=f"body {self.name}")

    def make_parts(self) -> dict[str, Part]:
        rng = generator(self.seed, "shapes")
        pieces = []
        for size_m, place in zip(self.sizes_m, self.places_m, strict=True):
            vertices, share = _stone(rng, angularity=self.angularity, roughness=self.roughness)
            vertices = size_m * (vertices @ _lying(rng).T)
            low, high = vertices[:, 2].min(), vertices[:, 2].max()
            vertices += np.append(place, -low - _SUNK * (high - low))
            pieces.append((vertices, icosphere(_LEVEL)[1], share))
        vertices, faces, share = merged(pieces)
        return {"stones": Part(vertices, faces, self.tones, vertex_share=share)}


def _stone(rng: np.random.Generator, *, angularity: float, roughness: float) -> tuple[np.ndarray, np.ndarray]:
    """Return vertices of a stone about the origin, of longest side 1, and the shares of its bright tone."""
    directions = icosphere(_LEVEL)[0]
    normals = rng.normal(size=(_CUTS, 3))
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    offsets = 1 - angularity * rng.uniform(0.05, 0.55, _CUTS)
    reach = directions @ normals.T / offsets  # above 1: beyond the plane of a cut
    # a smooth maximum: edges are worn
    sharpness = 12 + 60 * angularity
    radius = sharpness / np.logaddexp.reduce(sharpness * np.append(reach, np.ones((len(reach), 1)), axis=1), axis=-1)
    radius *= 1 + roughness * (
        noise.fractal_noise(1.7 * directions, octaves=2, rng=rng)
        + 0.5 * noise.fractal_noise(6 * directions, octaves=4, rng=rng)
    )
    second = rng.uniform(*_SIDE_RATIOS[0])
    vertices = directions * radius[:, None] * np.array([1, second, second * rng.uniform(*_SIDE_RATIOS[1])])
    vertices -= (vertices.min(axis=0) + vertices.max(axis=0)) / 2
    vertices /= np.ptp(vertices, axis=0).max()
    return vertices, _grain(directions, rng)


def _grain(directions: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return shares of the bright tone: speckles over patches, and a vein where noise passes through 0."""
    patches = 0.55 + 0.35 * noise.fractal_noise(2.5 * directions, octaves=3, rng=rng)
    speckles = noise.contrast(noise.gradient_noise(22 * directions, rng=rng), threshold=0.22, softness=0.2)
    vein = np.abs(noise.fractal_noise(1.3 * directions, octaves=4, rng=rng)) < 0.012
    return np.clip(patches + 0.5 * speckles + 0.6 * vein, 0, 1)


def _lying(rng: np.random.Generator) -> np.ndarray:
    """Return a turn that leaves the shortest side nearly upright."""
    yaw, (tilt_x, tilt_y) = rng.uniform(0, 360), rng.normal(0, 9, 2)
    return Rotation.from_euler("zxy", [yaw, tilt_x, tilt_y], degrees=True).as_matrix()
