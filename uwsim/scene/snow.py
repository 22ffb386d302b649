"""Marine snow: many small bodies that drift in the water, large enough to be seen one by one."""

from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator
from scipy.spatial.transform import Rotation

from uwsim.camera import pose
from uwsim.scene.base import Positive, Strict, Vector3
from uwsim.scene.placed import BodyMotion, Name, Reflectance, reflectance_on_grid

MOST_PARTICLES = 200_000
OCTAHEDRON = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], float)
FACES = np.array([[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]])
CORNER_PER_RADIUS = float(np.sqrt(np.pi / np.sqrt(3.0)))
"""Distance of an octahedron's corners from its middle over the radius of the sphere of the same surface, 1.347."""


class MarineSnow(Strict):
    """Particles in the box from `low_m` to `high_m`: `count` of them, or as many as `number_per_m3` makes.

    Places are uniform in the box and diameters log-uniform between the two of `diameters_m`. Particles that come
    within `clear_m` of the camera's or a lamp's opening during the exposure are left out; the others stay as they are.

    Each is an octahedron of random orientation with the surface of the sphere of its diameter, diffuse. By Cauchy's
    theorem its silhouette, averaged over orientations, is the sphere's; as its faces look everywhere equally often and
    do not shade each other, so is what it scatters at every angle. A single one is seen with its corners.

    Particles are no scene: they have no instance number, are missing in the water-free twin and in range, normal and
    albedo, and count as particles in the layers. `motion` moves the cloud, about the middle of its box.
    Source: Cauchy 1841: mean silhouette of a convex body = a quarter of its surface.
    """

    name: Name
    kind: Literal["marine_snow"]
    low_m: Vector3
    high_m: Vector3
    count: Annotated[int, Field(ge=1, le=MOST_PARTICLES)] | None = None
    number_per_m3: Positive | None = None
    diameters_m: tuple[Positive, Positive]
    reflectance: Reflectance
    seed: Annotated[int, Field(ge=0)]
    clear_m: Positive = 0.02
    motion: BodyMotion | None = None

    @model_validator(mode="after")
    def _usable(self):
        if not all(low < high for low, high in zip(self.low_m, self.high_m, strict=True)):
            raise ValueError(
                f"low_m, high_m: got {self.low_m} and {self.high_m}, allowed: low_m below high_m in x, y, z"
            )
        if (self.count is None) == (self.number_per_m3 is None):
            raise ValueError("give either count or number_per_m3")
        if not 1 <= self.number <= MOST_PARTICLES:
            raise ValueError(f"number_per_m3: got {self.number} particles in the box, allowed: 1 to {MOST_PARTICLES}")
        if self.diameters_m[0] > self.diameters_m[1]:
            raise ValueError(f"diameters_m: got {self.diameters_m}, allowed: the smallest first")
        _ = self.spectrum
        return self

    @property
    def number(self) -> int:
        """How many particles are drawn."""
        volume_m3 = float(np.prod(np.subtract(self.high_m, self.low_m)))
        return self.count if self.count is not None else round(self.number_per_m3 * volume_m3)

    @property
    def spectrum(self) -> np.ndarray:
        return reflectance_on_grid(self.reflectance, where=f"marine snow {self.name}: reflectance")

    @property
    def world_from_body(self) -> np.ndarray:
        """Pose (4, 4) of the cloud, its origin in the middle of the box, in the middle of the exposure. [m]"""
        return pose.from_parts(np.eye(3), np.add(self.low_m, self.high_m) / 2)

    @property
    def moves(self) -> bool:
        return self.motion is not None and self.motion.moves

    def poses_at(self, times_s: np.ndarray) -> np.ndarray:
        """Return the pose of the cloud (n, 4, 4) at times (n,) relative to the middle of the exposure."""
        return (self.motion or BodyMotion()).poses(self.world_from_body, times_s)

    def particles(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return middles (n, 3) in the cloud's frame, radii (n,) of the spheres [m] and turns (n, 3, 3) of all."""
        rng = np.random.default_rng([self.seed])
        half = np.subtract(self.high_m, self.low_m) / 2
        middles = rng.uniform(-half, half, (self.number, 3))
        radii = 0.5 * np.exp(rng.uniform(*np.log(self.diameters_m), self.number))
        return middles, radii, Rotation.random(self.number, random_state=rng).as_matrix().reshape(-1, 3, 3)


def octahedra(middles: np.ndarray, radii: np.ndarray, turns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return vertices (6 n, 3) and outward faces (8 n, 3) of octahedra with the surface of spheres of `radii` (n,)."""
    corners = np.einsum("nij,kj->nki", turns, OCTAHEDRON) * (CORNER_PER_RADIUS * radii)[:, None, None]
    first = 6 * np.arange(len(middles))[:, None, None]
    return (corners + middles[:, None]).reshape(-1, 3), (FACES[None] + first).reshape(-1, 3)
