"""Light that travels two paths in the water, lamp to body and body to camera, each unscattered or scattered forwards.

Unscattered, a path leaves e^(-c d) of every wavelength, scattered by small angles e^(-G d) - e^(-c d) (eq. 2.33): with
other laws on the two paths `bands.PathTable`, of one path, is not enough.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from uwsim.formation.bands import fine
from uwsim.formation.view import View
from uwsim.optics.checks import require

Law = Literal["unscattered", "scattered", "both", "scattered_twice_dimmed", "both_twice_dimmed", "free", "saturation"]
"""What a path leaves: e^(-c d); e^(-G d) - e^(-c d); their sum e^(-G d). As printed: e^(-c d) (e^(-G d) - e^(-c d)),
e^(-c d) e^(-G d), and 1. Of a volume with constant light: (1 - e^(-c d)) / c [m]."""

_PLAIN = ("unscattered", "both", "both_twice_dimmed", "free")

_NODES = 160


@dataclass(frozen=True, eq=False)
class Medium:
    """Attenuation c and loss G that formulas use: (121,) each on `bands.FINE_NM`, or of the three bands (3,). [1/m]"""

    attenuation: np.ndarray
    loss: np.ndarray

    def left(self, law: Law, path_m: np.ndarray) -> np.ndarray:
        """Return what paths (n,) leave, (n, wavelengths or bands); over the path where a law begins with it."""
        path = np.asarray(path_m, float)[:, None]
        c, g = self.attenuation, self.loss
        if law in _PLAIN:
            loss = {"unscattered": c, "both": g, "both_twice_dimmed": c + g, "free": 0.0 * c}[law]
            return np.exp(-path * loss)
        # these begin in proportion to the path: divided by it, their logarithm is smooth
        known = np.maximum(path, 1e-9)
        if law == "saturation":
            x = np.maximum(known * c, 1e-12)
            return -np.expm1(-x) / x
        share = np.exp(-known * self.loss) * -np.expm1(-known * (self.attenuation - self.loss)) / known
        if law == "scattered_twice_dimmed":
            share = share * np.exp(-known * self.attenuation)
        return share


def medium(view: View, loss_per_m: np.ndarray, *, spectral: bool) -> Medium:
    """Return c and G of a view; loss_per_m a number or (61,). Raises ValueError unless 0 <= G <= c everywhere."""
    c = view.water.attenuation
    g = np.broadcast_to(require("loss_per_m (G)", loss_per_m, least=0), c.shape)
    if np.any(g > c * (1 + 1e-9) + 1e-12):
        worst = int(np.argmax(g - c))
        raise ValueError(f"loss_per_m (G): got {g[worst]:.6g} where c is {c[worst]:.6g} [1/m], allowed: 0 to c")
    c, g = fine(c), fine(np.minimum(g, c))
    return Medium(c, g) if spectral else Medium(c @ view.band_light, g @ view.band_light)


class TwoPaths:
    """Band values of a spectrum after two paths: table(first_m (...), second_m (...)) -> (..., 3).

    `media`: of the first and the second path. `weighted` (121, 3): spectrum x weights of the bands. The table spans
    the paths 0 to `reach_m` = (first, second); longer ones raise ValueError. Within 1e-4 of the sum over wavelengths;
    with the three-band `Medium` exact.
    """

    def __init__(
        self, media: tuple[Medium, Medium], weighted: np.ndarray, laws: tuple[Law, Law], reach_m: tuple[float, float]
    ):
        self.laws, self.media, self.reach_m = laws, media, tuple(float(max(reach, 1e-3)) for reach in reach_m)
        self.at_zero = weighted.sum(axis=0)
        self.bands = len(media[0].attenuation) == 3
        if self.bands:
            return
        first, second = (
            water.left(law, np.linspace(0, reach, _NODES))
            for water, law, reach in zip(media, laws, self.reach_m, strict=True)
        )
        values = np.einsum("iw,wb,jw->ijb", first, weighted, second, optimize=True)
        self._log = np.log(np.maximum(values, 1e-300)).astype(np.float32)

    def __call__(self, first_m: np.ndarray, second_m: np.ndarray) -> np.ndarray:
        paths = np.broadcast_arrays(np.asarray(first_m, np.float32), np.asarray(second_m, np.float32))
        for path, reach in zip(paths, self.reach_m, strict=True):
            if path.size and not (path.min() >= 0 and path.max() <= reach * 1.0001):
                raise ValueError(f"two paths: got {path.min():g} to {path.max():g} m, allowed: 0 to {reach:g}")
        found = self._in_bands(paths) if self.bands else self._interpolated(paths)
        for path, law in zip(paths, self.laws, strict=True):
            if law not in _PLAIN:
                found *= path[..., None]
        return found

    def _in_bands(self, paths: list[np.ndarray]) -> np.ndarray:
        found = np.broadcast_to(self.at_zero.astype(np.float32), (*paths[0].shape, 3)).copy()
        for path, law, water in zip(paths, self.laws, self.media, strict=True):
            found *= water.left(law, path.ravel()).reshape(found.shape).astype(np.float32)
        return found

    def _interpolated(self, paths: list[np.ndarray]) -> np.ndarray:
        """Return e^(bilinear in the logarithm): only the spread of c within a band bends it."""
        places = [path * np.float32((_NODES - 1) / reach) for path, reach in zip(paths, self.reach_m, strict=True)]
        i, j = (np.minimum(place.astype(np.int32), _NODES - 2) for place in places)
        x, y = ((place - index)[..., None] for place, index in zip(places, (i, j), strict=True))
        flat, corner = self._log.reshape(-1, 3), i * _NODES + j
        low = np.take(flat, corner, axis=0)
        low += x * (np.take(flat, corner + _NODES, axis=0) - low)
        high = np.take(flat, corner + 1, axis=0)
        high += x * (np.take(flat, corner + _NODES + 1, axis=0) - high)
        low += y * (high - low)
        return np.exp(low, out=low)
