"""Is it blur at all? Only the zeros of the spectrum tell a blur from a texture that is smooth in one direction."""

from collections.abc import Iterator

import numpy as np

from uwsim.motion_blur.whittle import model
from uwsim.motion_blur.whittle.cells_fit import fit_cells
from uwsim.motion_blur.whittle.model import ELLIPSE, FILL, NOISE, RIGHT, ROLL_OFF, STATIC, TEXTURE, UP
from uwsim.motion_blur.whittle.periodogram import Frequencies, frequencies

# how much better a blur of the shortest length must explain the picture than every texture without one
_BLUR_NATS = 10.0
# e-folds of the length: the longer, the more displacements there are of which one may fit by chance
_SHORTEST_FOLD_PX = 2.0
_STEPS = 12
# a zero fill so large that sinc^2 vanishes beside it: what is left falls off without a zero
_RIDGE_FILL_LN = 7.0
_RIDGE_STATIC_LN = -3.0
# longer ones are not the work of a lens on a texture with a ridge, only of one of them
LENS_AND_RIDGE_PX = 3.0
# both sides of a square are equal to this share, as a standard deviation
_SAME_SIZE_SHARE = 0.05
# share of the evidence that squares show at right angles: a tenth and more in tags at rest, a twentieth in moving ones
_SQUARES_SHARE = 0.1
# lengths of ridges to start from, as shares of the blur's: 1 / sqrt(3) has its curvature at 0
_RIDGE_SHARES = (0.58, 1.0)


def least_nats(length_px: float) -> float:
    """Return how much better [nats] a blur of this length must explain a picture than textures without one do."""
    return _BLUR_NATS * (1 + max(0.0, float(np.log(length_px / _SHORTEST_FOLD_PX))))


def shows_in_parts(grey: np.ndarray, *, scale: float, parameters: np.ndarray, lens_std_px: float | None) -> bool:
    """Return whether two of the four quarters of a picture (H, W) show the blur, each near to `parameters`.

    What moves shows wherever there is texture, one long edge only where it is. `scale`: the unit of the parameters, the
    standard deviation of the picture.
    """
    nats = [
        blur_nats(found, power, parameters, lens_std_px=lens_std_px, whole=False)
        for found, power in _quarters(grey, scale)
    ]
    return len(nats) > 1 and sorted(nats)[-2] >= _BLUR_NATS / 2


def is_of_squares(
    grey: np.ndarray, found: Frequencies, power: np.ndarray, parameters: np.ndarray, *, nats: float, scale: float,
    lens_std_px: float | None,
) -> bool:  # fmt: skip
    """Return whether a blur that is told by `nats` is the size of squares: at right angles to it as much shows.

    The modules of tags, enlarged pixels and the blocks of a compression have zeros in both directions, a motion in one.
    Where some quarters of the picture show the one, others the other and none both, parts of it move at right angles.
    """
    across = parameters.copy()
    across[[RIGHT, UP]] = -parameters[UP], parameters[RIGHT]
    known = {"lens_std_px": lens_std_px, "known_px": _SAME_SIZE_SHARE * float(np.hypot(*parameters[[RIGHT, UP]]))}
    if blur_nats(found, power, across, **known) < max(_BLUR_NATS, _SQUARES_SHARE * nats):
        return False
    shows = [
        tuple(blur_nats(*part, one, **known) >= _BLUR_NATS / 2 for one in (parameters, across))
        for part in _quarters(grey, scale)
    ]
    return (True, True) in shows or not {(True, False), (False, True)} <= set(shows)


def _quarters(grey: np.ndarray, scale: float) -> Iterator[tuple[Frequencies, np.ndarray]]:
    """Yield frequencies and power of the quarters of a picture (H, W) that show anything."""
    height, width = (side // 2 for side in grey.shape)
    for row, column in np.ndindex(2, 2):
        part = grey[row * height : (row + 1) * height, column * width : (column + 1) * width]
        found = frequencies(*part.shape)
        power = found.power(part / scale)
        if power is not None:
            yield found, power


def blur_nats(
    found: Frequencies, power: np.ndarray, parameters: np.ndarray, *, lens_std_px: float | None, whole: bool = True,
    known_px: float | None = None,
) -> float:  # fmt: skip
    """Return how much better [nats] a blur explains the cells than textures without one do.

    Rivals: a Gaussian roll-off that is any ellipse, which every blur is below its first zero; and a ridge, the fall
    1 / (1 + (pi L s)^2) of a texture with long straight edges, with a part that does not take part in it. Where the
    cells are not those of the `whole` picture, the blur's share that does not move may be another one, too. `known_px`:
    the displacement is that of `parameters` to this standard deviation; None: it is open.
    """
    cells = found.cells
    power_of_cells = cells.mean(power[found.fitted].astype(float))
    held, loose = (model.prior(lens_std_px=lens_std_px, any_lens=free) for free in (False, True))
    for prior in (held, loose):
        prior[1][[STATIC, FILL]] = 0.0
    told = (held[0].copy(), held[1].copy())
    if known_px is not None:
        told[0][[RIGHT, UP]], told[1][[RIGHT, UP]] = parameters[[RIGHT, UP]], 1 / known_px**2
    texture = np.array([NOISE, *range(TEXTURE.start, TEXTURE.stop)])

    def loss(starts, free, prior):
        options = {"free": free, "prior": prior, "steps": _STEPS, "limit_px": np.inf}
        return float(fit_cells(cells, power_of_cells, np.atleast_2d(starts), **options)[1].min())

    moving = [RIGHT, UP] if whole else [RIGHT, UP, STATIC]
    blurred = loss(parameters, np.array([*moving, *texture]), told)
    smooth = loss(_ellipses(parameters), texture, loose)
    short = np.hypot(parameters[RIGHT], parameters[UP]) < LENS_AND_RIDGE_PX
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
