"""Light of lamps that the bodies of a view reflect: pictures for every pair of laws on the two paths."""

from typing import NamedTuple

import numpy as np

from uwsim.formation.bands import fine
from uwsim.formation.spread import Spread
from uwsim.formation.two_paths import Law, TwoPaths


class _Light(NamedTuple):
    """Of one lamp at the bodies seen (n,): irradiance of the surface per intensity [1/m^2], and the path in water."""

    unscattered: np.ndarray
    scattered: np.ndarray | None
    path_m: np.ndarray
    spectrum: np.ndarray


class Surface:
    """The bodies of a view under its lamps.

    `scattered`: whether the lamps' fields of light scattered forwards are needed. `cosine`: whether a surface
    receives by the cosine of incidence (False: eq. 2.41 as printed). Shadows (`View.visibility`) hold for scattered
    light as for direct light.
    """

    def __init__(self, spread: Spread, *, scattered: bool, cosine: bool = True):
        self.spread, self.view = spread, spread.view
        view = self.view
        self.seen = view.has_body
        self.range_m = np.asarray(view.range_m)[self.seen]
        self.albedo = np.asarray(view.albedo, np.float32)[self.seen]
        points, normals = view.points_m[self.seen], np.asarray(view.normals)[self.seen]
        self._lights = []
        for index, lamp in enumerate(view.lamps):
            came = lamp.arriving(points)
            turned = np.maximum(np.einsum("ij,ij->i", normals, came.towards), 0) if cosine else np.ones(len(points))
            if view.visibility is not None:
                turned = turned * view.visibility[self.seen][:, index]
            wide = None
            if scattered and len(points):
                field = spread.widened(index, farthest_m=float(came.path_m.max()))
                wide = (field(points, came.path_m) * turned).astype(np.float32)
            direct = (came.irradiance_per_intensity * turned).astype(np.float32)
            self._lights.append(_Light(direct, wide, came.path_m.astype(np.float32), lamp.spectrum))

    def reflected(self, source: Law, camera: Law) -> np.ndarray:
        """Return the band radiance in the water of the lamps' light, (H, W, 3) float32; 0 where no body is seen.

        `source`: the law from lamp to body; its light is the widened field where the law is of scattered light.
        Radiance albedo E / pi (Lambertian).
        """
        total = np.zeros((len(self.range_m), 3), np.float32)
        for light in self._lights:
            geometry = light.unscattered if source == "unscattered" else light.scattered
            total += self.through(light.spectrum, geometry, light.path_m, source, camera)
        return self.picture(total)

    def through(self, spectrum: np.ndarray, geometry: np.ndarray, path_m: np.ndarray, source: Law, camera: Law):
        """Return the radiance (n, 3) of light of a spectrum (61,) that falls on the bodies seen."""
        found = np.zeros((len(self.range_m), 3), np.float32)
        if not len(self.range_m):
            return found
        view, reach = self.view, (path_m.max(), self.range_m.max())
        for index, albedo in enumerate(view.albedo_spectra):
            weighted = (fine(spectrum) * fine(albedo))[:, None] * view.weights / np.pi
            table = TwoPaths(self.spread.media, weighted, (source, camera), reach)
            found += table(path_m, self.range_m) * (geometry * self.albedo[:, index])[:, None]
        return found

    def picture(self, values: np.ndarray) -> np.ndarray:
        """Return the values (n, 3) of the bodies seen as an image (H, W, 3)."""
        image = np.zeros((*self.view.shape, 3), np.float32)
        image[self.seen] = values
        return image
