"""Light that the water scatters once, in camera bands: spectrum x b p(angle) x what the whole path leaves of it."""

from typing import TYPE_CHECKING

import numpy as np

from uwsim.formation.bands import PathTable
from uwsim.optics.phase import PhaseMixture
from uwsim.optics.phase_functions.half_angle import angle_of
from uwsim.optics.phase_functions.henyey_greenstein import HenyeyGreenstein
from uwsim.optics.phase_functions.mixture import PhaseFunction

if TYPE_CHECKING:
    from uwsim.formation.view import View

# sin^2(angle/2) of the smallest angle, 2e-6 rad: some phase functions are infinite at 0
_LEAST = 1e-12


class ScatteringTable:
    """Band values of spectrum x b p(angle) x exp(-c path): table(cos_angle (...), path_m (...)) -> (..., 3).

    `spectrum` (61,) is spectral irradiance or intensity; with [W m^-2 nm^-1] values are radiance per length
    [W m^-3 sr^-1 nm^-1]. `cos_angle`: cosine of the scattering angle, 1 forwards; clipped to -1 ... 1.
    Terms of the phase function whose shares change alike over the wavelengths have one `PathTable` together.
    `spectral` as in `PathTable`.
    """

    def __init__(self, view: "View", spectrum: np.ndarray, *, spectral: bool = True):
        factors = np.stack([spectrum, view.water.scattering])
        self._groups = [
            (PathTable(view, np.vstack([factors, share]), spectral=spectral), parts)
            for share, parts in groups(view.water.phase)
        ]

    def __call__(self, cos_angle: np.ndarray, path_m: np.ndarray) -> np.ndarray:
        half = np.clip((1 - np.asarray(cos_angle)) / 2, _LEAST, 1.0)
        total = 0.0
        for table, parts in self._groups:
            density = sum(weight * density_of(term, half) for weight, term in parts)
            found = table(path_m)
            found *= density[..., None]
            total = total + found
        return total


def groups(phase: PhaseMixture) -> list[tuple[np.ndarray, list[tuple[float, PhaseFunction]]]]:
    """Return a mixture by terms with proportional shares: (share (61,), [(weight, term), ...]) of each group.

    The phase function at a wavelength is the sum over groups of share x sum of weight x term.
    """
    found: list[tuple[np.ndarray, list[tuple[float, PhaseFunction]]]] = []
    for weights, term in zip(phase.weights, phase.terms, strict=True):
        most = float(weights.max())
        if most == 0:
            continue
        share = weights / most
        for other, parts in found:
            # records round shares to 9 digits
            if np.allclose(other, share, rtol=0, atol=2e-9 / most + 1e-12):
                parts.append((most, term))
                break
        else:
            found.append((share, [(most, term)]))
    return found


def density_of(term: PhaseFunction, half: np.ndarray) -> np.ndarray:
    """Return a phase function at sin^2(angle/2), (...) [1/sr]."""
    if isinstance(term, HenyeyGreenstein):
        root = np.sqrt((1 - term.g) ** 2 + 4 * term.g * half)
        return (1 - term.g**2) / (4 * np.pi) / (root * root * root)
    return term.density(angle_of(half))
