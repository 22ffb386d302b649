"""Phase functions as tables, from which the renderer evaluates and draws without knowing their formulas.

A table is piecewise linear in s = sin^2(angle / 2), in which solid angle is even (4 pi ds). Its bins are even in
2 ln tan(angle / 2) = ln(s / (1 - s)): narrow in proportion to the angle towards 0, and likewise towards pi. Each bin
holds exactly the share of the light that the CDF of the phase function has there, so that moments are kept where the
density has kinks, and the peak at angle 0 may be as sharp as it likes: what lies below SMALLEST_RAD (also where the
density diverges, integrably) is spread evenly over that cone. Single-precision directions cannot tell such angles from
0, and over 100 m they are a tenth of a millimetre.
"""

import numpy as np

from uwsim.optics.phase import PhaseMixture
from uwsim.optics.phase_functions.mixture import PhaseFunction
from uwsim.optics.spectrum import WAVELENGTHS_NM
from uwsim.render.shapes import tensor

SMALLEST_RAD = 1e-6
LARGEST_RAD = np.pi - 1e-2
BINS = 2048

FIRST = 2 * np.log(np.tan(SMALLEST_RAD / 2))
STEP = (2 * np.log(np.tan(LARGEST_RAD / 2)) - FIRST) / (BINS - 2)


def edges() -> tuple[np.ndarray, np.ndarray]:
    """Return s and 1 - s at the edges of the bins, from angle 0 to pi, (BINS + 1,) each with all its digits."""
    ratio = np.exp(FIRST + STEP * np.arange(BINS - 1))
    s, rest = ratio / (1 + ratio), 1 / (1 + ratio)
    return np.concatenate([[0.0], s, [1.0]]), np.concatenate([[1.0], rest, [0.0]])


def widths() -> np.ndarray:
    """Return the widths of the bins in s, (BINS,)."""
    s, rest = edges()
    return np.where(s[1:] < 0.5, np.diff(s), -np.diff(rest))


def tabulate(term: PhaseFunction) -> tuple[np.ndarray, np.ndarray]:
    """Return the density at the left and at the right edge of each bin, from within, (BINS,) each. [1/sr]

    Raises ValueError for a phase function that is negative somewhere or whose CDF does not end at 1.
    Valid: 1e-3 at every angle for backward lobes down to 0.1 rad (Henyey-Greenstein's with g from -0.9 on); forward
    ones may be as sharp as they like.
    """
    s, rest = edges()
    angle = 2 * np.arctan2(np.sqrt(s), np.sqrt(rest))
    cdf, at_edges = term.cdf(angle), term.density(angle[1:])
    if not (np.all(np.diff(cdf) >= 0) and np.all(at_edges >= 0) and abs(cdf[-1] - cdf[0] - 1) < 1e-6):
        raise ValueError(f"phase function {type(term).__name__}: CDF or density, allowed: >= 0, with integral 1")
    mean = np.diff(cdf) / (4 * np.pi * widths())
    # no density at angle 0, where it may diverge: the first bin has its mean
    left, right = np.concatenate([[0.0], at_edges[:-1]]), np.concatenate([[0.0], at_edges[1:]])
    linear = (left + right) / 2
    scale = np.divide(mean, linear, out=np.zeros(BINS), where=linear > 0)
    return np.where(linear > 0, left * scale, mean), np.where(linear > 0, right * scale, mean)


def tabulate_mixture(phase: PhaseMixture) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return densities `left`, `right` (k, BINS) [1/sr] and `weights` (k, 61) of a phase function.

    Terms whose shares are in one proportion at all wavelengths become one, terms without any share are left out; the
    one with the largest share comes last.
    """
    groups: list[tuple[np.ndarray, list]] = []
    for term, weights in zip(phase.terms, phase.weights, strict=True):
        share = weights.mean()
        if share == 0:
            continue
        for spectrum, members in groups:
            if np.allclose(weights / share, spectrum, rtol=1e-9, atol=0):
                members.append((share, term))
                break
        else:
            groups.append((weights / share, [(share, term)]))
    groups.sort(key=lambda group: sum(share for share, _ in group[1]))
    left, right, weights = [], [], []
    for spectrum, members in groups:
        total = sum(share for share, _ in members)
        tables = [(share / total, *tabulate(term)) for share, term in members]
        left.append(sum(share * table for share, table, _ in tables))
        right.append(sum(share * table for share, _, table in tables))
        weights.append(total * spectrum)
    return np.array(left), np.array(right), np.array(weights)


def alias_table(mass: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return for bins of probability `mass` (n,) the share of each column that is its own, and whose the rest is.

    A bin is drawn in one step: column i of n in equal shares, its own bin with `own[i]`, else bin `other[i]`.
    Source: Vose 1991, IEEE Trans. Softw. Eng. 17:972.
    """
    own, other = mass / mass.sum() * len(mass), np.arange(len(mass))
    small, large = list(np.flatnonzero(own < 1)), list(np.flatnonzero(own >= 1))
    while small and large:
        poor, rich = small.pop(), large[-1]
        other[poor] = rich
        own[rich] -= 1 - own[poor]
        if own[rich] < 1:
            small.append(large.pop())
    own[small + large] = 1.0  # left over by round-off
    return own, other


def phase_description(mi, phase: PhaseMixture) -> dict:
    """Return the Mitsuba description of a phase function: `hg_mixture` where it is one, else `tabulated_mixture`."""
    low, high = float(WAVELENGTHS_NM[0]), float(WAVELENGTHS_NM[-1])
    on_wavelengths = {"wavelength_min": low, "wavelength_max": high}
    g = phase.henyey_greenstein_g
    if g is not None:
        return {"type": "hg_mixture", "g": tensor(mi, g), "weights": tensor(mi, phase.weights)} | on_wavelengths
    left, right, weights = tabulate_mixture(phase)
    return {
        "type": "tabulated_mixture",
        "left": tensor(mi, left),
        "right": tensor(mi, right),
        "weights": tensor(mi, weights),
    } | on_wavelengths
