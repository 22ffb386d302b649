"""Where to start: many starts are fitted to averaged frequencies at once, and the worse half is dropped repeatedly.

The likelihood has a valley for every stripe of the spectrum that could be the first zero; a fit only finds the bottom
of the valley that it starts in.
"""

from dataclasses import dataclass

import numpy as np

from uwsim.motion_blur.whittle import model
from uwsim.motion_blur.whittle.cells_fit import fit_cells
from uwsim.motion_blur.whittle.model import FILL, NOISE, RIGHT, STATIC, TEXTURE, UP
from uwsim.motion_blur.whittle.periodogram import Frequencies

START_ANGLES_DEG = np.arange(0, 180, 30.0)
CEPSTRUM_STARTS = 6
# starts whose displacements end nearer than this are one
APART_PX = 0.5
# averaged frequencies rank valleys well enough that one this much worse is not the best on all of them
MARGIN_NATS = 500.0
_SHORTEST_START_PX = 1.5
_UNIFORM_STATIC_LN, _UNIFORM_FILL_LN = -12.0, np.log(0.005)
# the lowest quarter of exponential numbers of mean 1 ends here
_QUARTILE_OF_EXPONENTIAL = 0.2877
_NOISE_BEYOND = 0.6  # cycles per pixel: the corners, where textures are weakest
_TEXTURE_BELOW = 0.1  # cycles per pixel: where textures stand above noise; small pictures have few frequencies there
_TINY = 1e-12


@dataclass(frozen=True)
class Plan:
    """Which starts, how many steps of them, and what may move."""

    ring_px: tuple[float, ...]
    rounds: tuple[tuple[int, int], ...]  # (one in how many starts is kept, steps)
    free: np.ndarray
    uniform: bool


UNIFORM = Plan(
    ring_px=(2.2, 3.6, 6.0), rounds=((1, 4), (2, 4), (4, 4)), uniform=True,
    free=np.setdiff1d(range(model.PARAMETERS), [STATIC, FILL]),
)  # fmt: skip
LOOSE = Plan(ring_px=(3.6,), rounds=((1, 5), (3, 6)), free=np.arange(model.PARAMETERS), uniform=False)


@dataclass(frozen=True)
class Candidates:
    """Parameters (n, 19) whose displacements differ, best first; the best one's loss and informative frequencies."""

    parameters: np.ndarray
    loss: float
    informative: float


def candidates(
    frequencies: Frequencies, power: np.ndarray, plan: Plan, *, limit_px: float, prior, count: int, hints_px: np.ndarray
) -> Candidates:
    """Return up to `count` candidates for a periodogram (H, W // 2 + 1).

    `hints_px` (m, 2): displacements to try besides those of the ring and the cepstrum.
    """
    power_of_cells = frequencies.cells.mean(power[frequencies.fitted].astype(float))
    displacements = np.concatenate([_on_rings(plan.ring_px), _from_cepstrum(frequencies, power, limit_px), hints_px])
    parameters = first_guess(frequencies, power, power_of_cells, displacements, prior)
    prior = tuple(values.copy() for values in prior)
    if plan.uniform:
        parameters[:, STATIC], parameters[:, FILL] = _UNIFORM_STATIC_LN, _UNIFORM_FILL_LN
        prior[0][[STATIC, FILL]] = _UNIFORM_STATIC_LN, _UNIFORM_FILL_LN
    total = len(parameters)
    for share, steps in plan.rounds:
        parameters, losses, informative = fit_cells(
            frequencies.cells, power_of_cells, parameters[: max(total // share, 1)], free=plan.free, steps=steps,
            limit_px=limit_px, prior=prior,
        )  # fmt: skip
        order = np.argsort(losses)
        parameters, losses, informative = parameters[order], losses[order], informative[order]
    kept = []
    for row in parameters[losses < losses[0] + MARGIN_NATS]:
        here = row[[RIGHT, UP]]
        if all(min(np.hypot(*(here - sign * other[[RIGHT, UP]])) for sign in (1, -1)) > APART_PX for other in kept):
            kept.append(row)
    return Candidates(np.array(kept[:count]), float(losses[0]), float(informative[0]))


def _on_rings(lengths_px: tuple[float, ...]) -> np.ndarray:
    angles = np.radians(START_ANGLES_DEG)
    return np.concatenate([length * np.stack([np.cos(angles), np.sin(angles)], axis=1) for length in lengths_px])


def _from_cepstrum(frequencies: Frequencies, power: np.ndarray, limit_px: float) -> np.ndarray:
    """Return the displacements (n, 2), n <= 6, of the deepest local minima of the cepstrum."""
    from scipy import fft
    from scipy.ndimage import minimum_filter

    height, width = frequencies.taper.shape
    logarithm = np.log(power + _TINY * power.mean())
    cepstrum = fft.irfft2(logarithm, s=(height, width))
    reach = int(limit_px)
    rows, columns = np.arange(-reach, 1), np.arange(-reach, reach + 1)
    near = cepstrum[np.ix_(rows % height, columns % width)]
    distance = np.hypot(rows[:, None], columns[None, :])
    searched = (
        (distance >= _SHORTEST_START_PX) & (distance <= limit_px) & ((rows[:, None] < 0) | (columns[None, :] > 0))
    )
    searched &= near == minimum_filter(near, 3)
    row, column = np.nonzero(searched)
    deepest = np.argsort(near[row, column])[:CEPSTRUM_STARTS]
    return np.stack([columns[column[deepest]], -rows[row[deepest]]], axis=1).astype(float)


def first_guess(
    frequencies: Frequencies, power: np.ndarray, power_of_cells: np.ndarray, displacements: np.ndarray, prior
) -> np.ndarray:
    """Return (S, 19): the prior's texture, its amplitude from the lower frequencies, noise from the highest."""
    mean, _ = prior
    cells = frequencies.cells
    parameters = np.tile(mean, (len(displacements), 1))
    parameters[:, [RIGHT, UP]] = displacements
    high = power[frequencies.fitted & (np.hypot(frequencies.u, frequencies.v) > _NOISE_BEYOND)]
    parameters[:, NOISE] = np.log(max(np.quantile(high, 0.25) / _QUARTILE_OF_EXPONENTIAL, _TINY))
    r = np.hypot(cells.u, cells.v)
    low = r <= max(_TEXTURE_BELOW, np.quantile(r, 0.1))
    along = displacements[:, :1] * cells.u[low] - displacements[:, 1:] * cells.v[low]
    moving, _, _ = model.transfer(along, np.exp(_UNIFORM_FILL_LN))
    expected = moving * np.exp(cells.terms[low] @ mean[TEXTURE])
    ratio = np.median(power_of_cells[low] / expected, axis=1)
    parameters[:, TEXTURE.start] = np.log(np.maximum(ratio, _TINY))
    return parameters
