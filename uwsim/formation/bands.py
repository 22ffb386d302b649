"""Spectra to camera bands, and the light that is left of a spectrum after a path in the water, as a table.

The band value of a spectral radiance L is int L r / int r with the band's response r, as in the renderer's `radiance`.
Spectra are linear between the nodes of the wavelength grid; their products are integrated by Simpson's rule with the
middle of every step, exact for products of three.
"""

from typing import TYPE_CHECKING

import numpy as np

from uwsim.optics.spectrum import WAVELENGTHS_NM

if TYPE_CHECKING:
    from uwsim.formation.view import View

FINE_NM = np.linspace(WAVELENGTHS_NM[0], WAVELENGTHS_NM[-1], 2 * len(WAVELENGTHS_NM) - 1)
"""The wavelength grid with the middle of every step, (121,). [nm]"""

_NODES = 2048
_FAR = 60.0  # optical depth at which nothing is left
_FARTHEST_M = 1e4


def fine(spectra: np.ndarray) -> np.ndarray:
    """Return spectra (..., 61) on FINE_NM, linear in between, (..., 121)."""
    spectra = np.asarray(spectra, float)
    found = np.empty((*spectra.shape[:-1], len(FINE_NM)))
    found[..., ::2] = spectra
    found[..., 1::2] = (spectra[..., 1:] + spectra[..., :-1]) / 2
    return found


def band_weights(response: np.ndarray) -> np.ndarray:
    """Return weights (121, 3) of a camera's response (61, 3): band value = sum over FINE_NM of spectrum x weight.

    Raises ValueError for a response of another shape, below 0 or without any band's light.
    """
    response = np.asarray(response, float)
    if response.shape != (len(WAVELENGTHS_NM), 3) or not np.all(np.isfinite(response) & (response >= 0)):
        raise ValueError(f"view: response has shape {response.shape}, allowed: ({len(WAVELENGTHS_NM)}, 3), all >= 0")
    simpson = np.full(len(FINE_NM), 2.0)
    simpson[1::2], simpson[[0, -1]] = 4.0, 1.0
    weighted = fine(response.T).T * simpson[:, None]
    total = weighted.sum(axis=0)
    if not np.all(total > 0):
        raise ValueError("view: response: a band sees no light, allowed: a sum above 0 in each")
    return weighted / total


def band_values(view: "View", spectrum: np.ndarray) -> np.ndarray:
    """Return the band values (3,) of a spectrum (61,) or of the product of several (n, 61)."""
    return _product(spectrum) @ view.weights


def _product(spectrum: np.ndarray) -> np.ndarray:
    """Return a spectrum (61,), or the product of several (n, 61), on FINE_NM."""
    spectra = np.atleast_2d(np.asarray(spectrum, float))
    good = np.isfinite(spectra) & (spectra >= 0)
    if spectra.shape[-1] != len(WAVELENGTHS_NM) or spectra.ndim != 2 or not np.all(good):
        shape, least = np.shape(spectrum), np.min(spectra)
        raise ValueError(f"spectrum has shape {shape}, minimum {least:g}, allowed: (61,) or (n, 61), finite and >= 0")
    return np.prod(fine(spectra), axis=0)


class Decay:
    """What a view's water leaves of each wavelength at the nodes of a path: `paths_m` (n,), `left` (n, 121).

    The nodes are at squares of equal steps: dense where the light still changes colour. They reach an optical depth of
    60 in the clearest wavelength (at most 10 km); beyond, the value at the last node stands.
    """

    def __init__(self, attenuation: np.ndarray):
        c = fine(attenuation)
        least = float(c.min())
        self.reach_m = min(_FAR / least, _FARTHEST_M) if least > 0 else _FARTHEST_M
        self.paths_m = self.reach_m * np.linspace(0, 1, _NODES) ** 2
        self.left = np.exp(-self.paths_m[:, None] * c)


class PathTable:
    """Band values of a spectrum after a path in the view's water: table(path_m (...)) -> (..., 3).

    `spectrum` (61,), or (n, 61): a product of n spectra that are each linear between the nodes, as a lamp's times the
    scattering coefficient. Values have the spectrum's unit and the path's dtype (float32 or float64). Within 1e-4
    (relative) of the sum over wavelengths up to an optical depth of 60, in every water of the project (more where c
    varies a hundredfold within a band). `at_zero` (3,): the values at path 0.
    `spectral` False: the three-band form of the literature, band value x exp(-c path) with the view's
    `band_attenuation`.
    Raises ValueError for a spectrum of another shape, below 0 or not finite.
    """

    def __init__(self, view: "View", spectrum: np.ndarray, *, spectral: bool = True):
        weighted = _product(spectrum)[:, None] * view.weights
        self.at_zero = weighted.sum(axis=0)
        self.attenuation = None if spectral else view.band_attenuation
        if not spectral:
            return
        decay = view.decay
        self._scale = np.float64(_NODES - 1) / np.sqrt(decay.reach_m)
        self._reach_m = decay.reach_m
        values = np.einsum("nw,wb->nb", decay.left, weighted)
        # logarithms change nearly linearly along the path: only the spread of c within a band bends them
        values = np.log(np.maximum(values, 1e-300))
        step = np.diff(decay.paths_m)[:, None]
        slope = np.diff(values, axis=0) / step
        start = values[:-1] - slope * decay.paths_m[:-1, None]
        self._lines = {np.dtype(kind): (slope.astype(kind), start.astype(kind)) for kind in ("f4", "f8")}

    def __call__(self, path_m: np.ndarray) -> np.ndarray:
        path = np.asarray(path_m)
        if path.dtype not in (np.dtype("f4"), np.dtype("f8")):
            path = path.astype(float)
        if self.attenuation is not None:
            c = self.attenuation.astype(path.dtype)
            # 0 x infinity: water that takes nothing leaves everything
            far = np.where(np.isinf(path), path.dtype.type(1e30), path)
            return self.at_zero.astype(path.dtype) * np.exp(-far[..., None] * c)
        path = np.minimum(path, path.dtype.type(self._reach_m))
        index = np.asarray(np.sqrt(path) * path.dtype.type(self._scale)).astype(np.int32)
        index = np.minimum(index, _NODES - 2)
        slope, start = self._lines[path.dtype]
        found = np.take(slope, index, axis=0)
        found *= path[..., None]
        found += np.take(start, index, axis=0)
        return np.exp(found, out=found)
