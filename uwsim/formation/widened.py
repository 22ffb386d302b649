"""A lamp's field of light scattered forwards on its way: the beam widened by the small-angle rule of eq. 2.33.

What a camera sees of a point through turbid water and what a point receives of a lamp are the same problem run
backwards, so that the rule of 2.33 holds in the angle at the lamp: after a path d in the water the beam, as intensity
over directions, is spread with the modulation e^(-B d omega), and the share e^(-G d) - e^(-c d) of it arrives.
"""

from functools import cache

import numpy as np
from scipy import ndimage

from uwsim.formation.light import Lamp
from uwsim.optics.window import DomeWindow, FlatWindow

_DEGREE = 127  # of the Legendre series: details of 1.4 degrees
_AZIMUTHS = 16
_ORDERS = _AZIMUTHS // 2
_POLAR = 361


@cache
def _legendre(places: str) -> np.ndarray:
    """Return P_lm, normalised to 1 over the cosine, (m, l, nodes), at Gauss's nodes or at equal polar angles."""
    cosine = _nodes()[0] if places == "gauss" else np.cos(np.linspace(0, np.pi, _POLAR))
    sine = np.sqrt(np.maximum(1 - cosine**2, 0))
    found = np.zeros((_ORDERS + 1, _DEGREE + 1, len(cosine)))
    start = np.full(len(cosine), np.sqrt(0.5))
    for m in range(_ORDERS + 1):
        if m > 0:
            start = start * sine * np.sqrt((2 * m + 1) / (2 * m))
        found[m, m] = start
        found[m, m + 1] = np.sqrt(2 * m + 3) * cosine * start
        for l in range(m + 2, _DEGREE + 1):
            a = np.sqrt((4 * l * l - 1) / (l * l - m * m))
            b = np.sqrt(((l - 1) ** 2 - m * m) / (4 * (l - 1) ** 2 - 1))
            found[m, l] = a * (cosine * found[m, l - 1] - b * found[m, l - 2])
    return found


@cache
def _nodes() -> tuple[np.ndarray, np.ndarray]:
    return np.polynomial.legendre.leggauss(_DEGREE + 1)


def widen(intensity: np.ndarray, *, width_rad: float) -> np.ndarray:
    """Return a beam spread over the sphere by e^(-width l), l the degree of its harmonics; its flux stays.

    intensity (128, 16): at the cosines of `nodes` and at equal azimuths from 0; returned (361, 16): at equal polar
    angles from 0 to pi. At small angles l is omega and the rule that of eq. 2.33; on the whole sphere its
    point-spread function is that of Henyey and Greenstein with g = e^(-width).
    """
    orders = np.fft.rfft(intensity, axis=1)
    _, weights = _nodes()
    series = np.einsum("mln,n,nm->ml", _legendre("gauss"), weights, orders[:, : _ORDERS + 1])
    series = series * np.exp(-width_rad * np.arange(_DEGREE + 1))
    spread = np.einsum("mln,ml->nm", _legendre("equal"), series)
    return np.fft.irfft(spread, n=_AZIMUTHS, axis=1)


def nodes() -> tuple[np.ndarray, np.ndarray]:
    """Return the polar cosines (128,) at which `widen` takes a beam, and their weights over the cosine (128,)."""
    return _nodes()


class WidenedLamp:
    """Geometry of a lamp's light scattered forwards: widened(points_m (..., 3), path_m (...)) -> (...) [1/m^2].

    Irradiance normal to the ray per intensity on the lamp's axis, without attenuation; times the share
    e^(-G d) - e^(-c d) of the path it is what arrives. Directions are taken as those of the unscattered light.
    `paths_m` (n,) increasing, above 0; `widths_rad` (n,) = B d there; linear in the logarithm of the path in between.
    The field is sampled on spheres about the place where the lamp seems to be, each spread by itself: its flux through
    each stays the same (to 1e-3: the series of 127 degrees cuts edges of beams).
    """

    def __init__(self, lamp: Lamp, *, paths_m: np.ndarray, widths_rad: np.ndarray):
        self.lamp, self._log_paths = lamp, np.log(np.asarray(paths_m, float))
        turn = np.linalg.svd(lamp.axis[None])[2]
        self._axes = np.stack([turn[1], np.cross(lamp.axis, turn[1]), lamp.axis])
        cosine, _ = _nodes()
        azimuth = 2 * np.pi * np.arange(_AZIMUTHS) / _AZIMUTHS
        sine = np.sqrt(1 - cosine**2)[:, None]
        local = np.stack(np.broadcast_arrays(sine * np.cos(azimuth), sine * np.sin(azimuth), cosine[:, None]), -1)
        table = []
        for path, width in zip(np.asarray(paths_m, float), np.asarray(widths_rad, float), strict=True):
            radius = path + self._offset_m
            came = lamp.arriving(lamp.apparent_m + radius * (local @ self._axes))
            table.append(widen(came.irradiance_per_intensity * radius**2, width_rad=float(width)))
        table = np.maximum(np.stack(table), 0.0)
        self.table = np.concatenate([table, table[:, :, :1]], axis=2).astype(np.float32)

    @property
    def _offset_m(self) -> float:
        """Distance from where the lamp seems to be to where its light enters the water."""
        match self.lamp.window:
            case FlatWindow():
                return self.lamp.window.virtual_distance_m
            case DomeWindow():
                return self.lamp.window.outer_radius_m
        return 0.0

    def __call__(self, points_m: np.ndarray, path_m: np.ndarray) -> np.ndarray:
        offset = np.asarray(points_m, float) - self.lamp.apparent_m
        distance = np.maximum(np.sqrt(np.einsum("...i,...i->...", offset, offset)), 1e-9)
        x, y, z = np.moveaxis(offset @ self._axes.T, -1, 0)
        polar = np.arccos(np.clip(z / distance, -1, 1)) * ((_POLAR - 1) / np.pi)
        azimuth = (np.arctan2(y, x) / (2 * np.pi) % 1.0) * _AZIMUTHS
        place = np.interp(np.log(np.maximum(path_m, 1e-9)), self._log_paths, np.arange(len(self._log_paths)))
        found = ndimage.map_coordinates(self.table, np.stack([place, polar, azimuth]), order=1, mode="nearest")
        return found / distance**2
