"""Is it blur at all? Only the zeros of the spectrum tell a blur from a texture that is smooth in one direction."""

import numpy as np

from uwsim.motion_blur.whittle import model
from uwsim.motion_blur.whittle.cells_fit import fit_cells
from uwsim.motion_blur.whittle.model import ELLIPSE, FILL, NOISE, RIGHT, ROLL_OFF, STATIC, TEXTURE, UP
from uwsim.motion_blur.whittle.periodogram import Frequencies

# how much better a blur must explain the picture than every texture without one
BLUR_NATS = 10.0
_STEPS = 12
# a zero fill so large that sinc^2 vanishes beside it: what is left falls off without a zero
_RIDGE_FILL_LN = 7.0
_RIDGE_STATIC_LN = -3.0
# longer ones are not the work of a lens on a texture with a ridge, only of one of them
_LENS_AND_RIDGE_PX = 3.0
# lengths of ridges to start from, as shares of the blur's: 1 / sqrt(3) has its curvature at 0
_RIDGE_SHARES = (0.58, 1.0)


def blur_nats(
    frequencies: Frequencies, power: np.ndarray, parameters: np.ndarray, *, lens_std_px: float | None
) -> float:
    """Return how much better [nats] a blur explains the cells than textures without one do.

    Rivals: a Gaussian roll-off that is any ellipse, which every blur is below its first zero; and a ridge, the fall
    1 / (1 + (pi L s)^2) of a texture with long straight edges, with a part that does not take part in it.
    """
    cells = frequencies.cells
    power_of_cells = cells.mean(power[frequencies.fitted].astype(float))
    held, loose = (model.prior(lens_std_px=lens_std_px, any_lens=free) for free in (False, True))
    for prior in (held, loose):
        prior[1][[STATIC, FILL]] = 0.0
    texture = np.array([NOISE, *range(TEXTURE.start, TEXTURE.stop)])

    def loss(starts, free, prior):
        options = {"free": free, "prior": prior, "steps": _STEPS, "limit_px": np.inf}
        return float(fit_cells(cells, power_of_cells, np.atleast_2d(starts), **options)[1].min())

    blurred = loss(parameters, np.array([RIGHT, UP, *texture]), held)
    smooth = loss(_ellipses(parameters), texture, loose)
    short = np.hypot(parameters[RIGHT], parameters[UP]) < _LENS_AND_RIDGE_PX
    ridged = loss(_ridges(parameters), np.array([RIGHT, UP, STATIC, *texture]), loose if short else held)
    return min(smooth, ridged) - blurred


def _ellipses(parameters: np.ndarray) -> np.ndarray:
    """Return two starts without displacement: as the texture is, and with the curvature of sinc^2 at 0."""
    right, up = parameters[[RIGHT, UP]]
    bare = parameters.copy()
    bare[[RIGHT, UP]] = 0.0
    smooth = bare.copy()
    curvature = np.pi**2 / 12
    smooth[ROLL_OFF] += curvature * (right**2 + up**2) / 2
    smooth[ELLIPSE] += curvature * np.array([(right**2 - up**2) / 2, right * up])
    return np.stack([bare, smooth])


def _ridges(parameters: np.ndarray) -> np.ndarray:
    starts = np.tile(parameters, (len(_RIDGE_SHARES), 1))
    starts[:, [RIGHT, UP]] *= np.array(_RIDGE_SHARES)[:, None]
    starts[:, FILL] = _RIDGE_FILL_LN
    starts[:, TEXTURE.start] -= _RIDGE_FILL_LN
    starts[:, STATIC] = np.minimum(starts[:, STATIC], _RIDGE_STATIC_LN)
    return starts
