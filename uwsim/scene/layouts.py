"""Marker layouts of spheres for pose estimation."""

from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from uwsim.optics import sources
from uwsim.optics.spectrum import WAVELENGTHS_NM
from uwsim.scene.base import NonNegative, Positive, Table
from uwsim.scene.placed import Reflectance
from uwsim.scene.surface import Generated, Part, generator, icosphere, merged, tube

_LEVEL = 4  # of a sphere: 2,562 vertices, 0.1 % of its radius from round
_ROD_SIDES = 12
Layout = Literal["random_10", "bipyramid_6", "pyramid_5", "stereo_4", "planar_4"]


class MarkerLayout(Generated):
    """Bright spheres at the points of a layout about the body's origin; their centres are in the truth, in order.

    `bipyramid_6`: four corners of a square of side `edge_m` in the x-y plane and an apex on either side, every edge
    `edge_m` long (an octahedron), the origin in its middle. `pyramid_5`: the square and the apex at +z, the origin in
    the middle of the base. `stereo_4`: two neighbouring corners of the square and both apices. `planar_4`: the square.
    `random_10`: ten points drawn by `seed` in the box of sides `box_m` about the origin, at least a sphere's diameter
    apart. Thin rods (`rod_m` in diameter, 0: none; dark) join the spheres to the origin.
    Lit spheres have a `radiance_w_per_m2_sr` over 400-700 nm, the same in all directions, of the `spectrum` of a lamp
    (a name or a table), on top of what they reflect.

    Source: the dissertation, chapter 5: ten points from +-500 x +-500 x 1000 mm, layouts with 25 to 500 mm spacing.
    Errata: two opposite corners of the base and both apices lie in a plane; the stereo layout takes neighbouring ones.
    """

    kind: Literal["marker_layout"]
    layout: Layout
    edge_m: Positive = 0.1
    sphere_radius_m: Positive = 0.008
    rod_m: NonNegative = 0.0
    box_m: tuple[Positive, Positive, Positive] = (1.0, 1.0, 1.0)
    reflectance: Reflectance = 0.90
    radiance_w_per_m2_sr: NonNegative = 0.0
    spectrum: str | Table = "LED-B3"
    rod_reflectance: Reflectance = 0.03
    seed: Annotated[int, Field(ge=0)] | None = None

    @model_validator(mode="after")
    def _usable(self):
        if (self.layout == "random_10") != (self.seed is not None):
            raise ValueError(f"seed: got {self.seed} for layout {self.layout}, allowed: with random_10, and only there")
        if self.rod_m >= self.sphere_radius_m:
            raise ValueError(f"rod_m: got {self.rod_m:g} m, allowed: below sphere_radius_m, {self.sphere_radius_m:g} m")
        points = self.points_m
        apart = np.linalg.norm(points[:, None] - points[None], axis=-1)[np.triu_indices(len(points), 1)].min()
        if apart <= 2 * self.sphere_radius_m:
            raise ValueError(f"sphere_radius_m: got {self.sphere_radius_m:g} m, allowed: below half the distance of "
                             f"the nearest two points, {apart / 2:g} m")  # fmt: skip
        _ = self.tone("reflectance"), self.tone("rod_reflectance"), self.glow
        return self

    @property
    def glow(self) -> dict[str, np.ndarray]:
        """Spectral radiance (61,) of the parts that shine by themselves, by name. [W m^-2 sr^-1 nm^-1]"""
        if isinstance(self.spectrum, str):
            spectrum = sources.illuminant(self.spectrum)
        else:
            spectrum = self.spectrum.on_grid(where=f"body {self.name}: spectrum")
            power = np.trapezoid(spectrum, WAVELENGTHS_NM)
            if power <= 0:
                raise ValueError(f"body {self.name}: the spectrum has no power within 400-700 nm")
            spectrum = spectrum / power
        return {} if self.radiance_w_per_m2_sr == 0 else {"spheres": self.radiance_w_per_m2_sr * spectrum}

    @property
    def points_m(self) -> np.ndarray:
        """Centres of the spheres in the body's frame, (n, 3). [m]"""
        if self.layout == "random_10":
            return self._random()
        half, apex = self.edge_m / 2, self.edge_m / np.sqrt(2)
        square = np.array([[half, half, 0], [-half, half, 0], [-half, -half, 0], [half, -half, 0]])
        apices = np.array([[0, 0, apex], [0, 0, -apex]])
        match self.layout:
            case "bipyramid_6":
                return np.concatenate([square, apices])
            case "pyramid_5":
                return np.concatenate([square, apices[:1]])
            case "stereo_4":
                return np.concatenate([square[:2], apices])
        return square

    def _random(self) -> np.ndarray:
        rng, half = generator(self.seed, "layout"), np.array(self.box_m) / 2
        points: list[np.ndarray] = []
        for tried in rng.uniform(-half, half, (2000, 3)):
            if all(np.linalg.norm(tried - point) > 2.5 * self.sphere_radius_m for point in points):
                points.append(tried)
            if len(points) == 10:
                return np.array(points)
        raise ValueError(f"box_m: ten spheres of radius {self.sphere_radius_m:g} m do not fit into {self.box_m}")

    def make_parts(self) -> dict[str, Part]:
        unit, faces = icosphere(_LEVEL)
        # the radius at which the polyhedron has the sphere's volume
        a, b, c = np.moveaxis(unit[faces], 1, 0)
        volume = np.einsum("ni,ni->", a, np.cross(b, c)) / 6
        radius_m = self.sphere_radius_m * (4 / 3 * np.pi / volume) ** (1 / 3)
        spheres = merged([(point + radius_m * unit, faces) for point in self.points_m])
        parts = {"spheres": Part(*spheres, (self.tone("reflectance"),))}
        if self.rod_m > 0:
            rods = [_rod(point, self.rod_m / 2) for point in self.points_m if np.linalg.norm(point) > 0]
            parts["rods"] = Part(*merged(rods), (self.tone("rod_reflectance"),))
        return parts


def _rod(end: np.ndarray, radius_m: float) -> tuple[np.ndarray, np.ndarray]:
    way = end / np.linalg.norm(end)
    across = np.cross(way, np.eye(3)[np.argmin(np.abs(way))])
    across /= np.linalg.norm(across)
    angle = np.arange(_ROD_SIDES) * 2 * np.pi / _ROD_SIDES
    ring = radius_m * (np.cos(angle)[:, None] * across + np.sin(angle)[:, None] * np.cross(way, across))
    return tube(np.stack([ring, ring + end]))
