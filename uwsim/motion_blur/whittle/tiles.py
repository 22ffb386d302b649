"""The blur as a field over the frame: one fit per tile, for motion that differs from place to place."""

from typing import NamedTuple

import numpy as np

from uwsim.motion_blur.estimate import MINIMUM_SIDE_PX, SATURATED_SHARE, grey_from_image, is_constant, saturated_share
from uwsim.motion_blur.whittle import model
from uwsim.motion_blur.whittle.gate import blur_nats, least_nats
from uwsim.motion_blur.whittle.model import FILL, RIGHT, STATIC, UP
from uwsim.motion_blur.whittle.picture import Found, find

_SHORTEST_TILE_PX = 2 * MINIMUM_SIDE_PX
# a tile has this share of the shorter side, and at least these pixels; each is half a tile from the next
_TILE_SHARE, _LEAST_TILE_PX = 1 / 4, 128
# tiles that show a blur of their own, as a share of all, before others are taken to move with them
_MOVING_SHARE = 1 / 4
# how much worse [nats] than a texture without a blur the neighbour's may explain such a tile
_AS_WELL_NATS = 100.0
# neighbours' displacements differ by this share of them, as a standard deviation
_ALIKE_SHARE = 0.15


class Field(NamedTuple):
    """The blur of R x C tiles.

    Tiles that are constant or saturated have NaN displacement and covariance, and the verdict "no blur", unless filled.
    """

    centres_px: np.ndarray  # (R, C, 2): x right, y down, pixel centres at integer + 0.5
    displacement_px: np.ndarray  # (R, C, 2): right and **up**, over the exposure; up >= 0: the sign cannot be seen
    covariance_px2: np.ndarray  # (R, C, 2, 2) of the displacement
    verdict: np.ndarray  # (R, C) of VERDICTS


def tile_size_px(shape: tuple[int, ...]) -> int | None:
    """Return the side of the tiles that suit an image (H, W[, C]); None where it is too small for two."""
    side = min(shape[:2])
    tile_px = min(max(round(_TILE_SHARE * side), _LEAST_TILE_PX), side)
    return None if max(shape[:2]) < 1.5 * tile_px else tile_px


def field(
    image: np.ndarray, *, tile_px: int = 128, step_px: int = 64, lens_std_px: float | None = None, fill: bool = False
) -> Field:
    """Return the blur of square tiles of a linear image (H, W[, C]), each a `step_px` from the next.

    Tiles also start from what the whole frame says; the errors grow as 1 / tile_px. With `fill` and a whole frame that
    shows a blur, a tile departs from that only where its own explains it better by as much as a blur is asked for. With
    `fill`, too, a tile that shows none has that of the nearest one that does or, where these are under a quarter, the
    whole frame's, unless a texture at rest explains it better: few details are no sign of rest where the camera moves.
    ValueError for images that are constant, not finite or under 16 px, and where a tile does not fit into the image or
    is under 32 px.
    """
    grey = grey_from_image(image, where="whittle field")
    if not _SHORTEST_TILE_PX <= tile_px <= min(grey.shape):
        raise ValueError(
            f"whittle field: got tile_px {tile_px}, allowed: {_SHORTEST_TILE_PX} to the image's {min(grey.shape)}"
        )
    if step_px < 1:
        raise ValueError(f"whittle field: got step_px {step_px}, allowed: >= 1")
    image = np.asarray(image)
    tops, lefts = (np.arange(0, side - tile_px + 1, step_px) for side in grey.shape)
    whole = find(grey, lens_std_px=lens_std_px)
    hints_px = np.empty((0, 2)) if whole is None else whole.displacement_px[None]
    moves = whole is not None and whole.verdict != "no blur"
    shape = (len(tops), len(lefts))
    displacement, covariance = np.full((*shape, 2), np.nan), np.full((*shape, 2, 2), np.nan)
    verdict = np.full(shape, "no blur", dtype="<U11")
    fits: dict[tuple[int, int], tuple[Found, np.ndarray]] = {}
    for index in np.ndindex(shape):
        inside = tuple(slice(start, start + tile_px) for start in (tops[index[0]], lefts[index[1]]))
        tile = grey[inside]
        if is_constant(tile) or saturated_share(image[inside], full=image.max()) > SATURATED_SHARE:
            continue
        found = find(tile, lens_std_px=lens_std_px, hints_px=hints_px)
        if found is None:
            continue
        displacement[index], covariance[index] = found.displacement_px, found.covariance_px2
        verdict[index] = "no blur" if _is_square_of(whole, found) else found.verdict
        fits[index] = found, tile
        if fill and moves and verdict[index] != "no blur" and not _departs(found, tile, whole, lens_std_px):
            displacement[index], covariance[index] = whole.displacement_px, whole.covariance_px2
    centres = np.stack(np.meshgrid(lefts, tops), axis=-1) + tile_px / 2
    made = Field(centres, displacement, covariance, verdict)
    return _filled(made, fits, whole, lens_std_px) if fill else made


def _filled(
    made: Field, fits: dict[tuple[int, int], tuple[Found, np.ndarray]], whole: Found | None, lens_std_px: float | None
) -> Field:
    from scipy.spatial import cKDTree

    moving = made.verdict != "no blur"
    several = moving.sum() >= _MOVING_SHARE * moving.size
    if not several and (whole is None or whole.verdict == "no blur"):
        return made
    if several:
        known = np.argwhere(moving)
        nearest = known[cKDTree(made.centres_px[moving]).query(made.centres_px)[1]]
    displacement, covariance, verdict = (part.copy() for part in made[1:])
    for index in map(tuple, np.argwhere(~moving)):
        if several:
            source = tuple(nearest[index])
            told = made.displacement_px[source], made.covariance_px2[source], made.verdict[source]
        else:
            told = whole.displacement_px, whole.covariance_px2, whole.verdict
        if index in fits and _at_rest(*fits[index], told[0], lens_std_px):
            continue
        displacement[index], covariance[index], verdict[index] = told
    return Field(made.centres_px, displacement, covariance, verdict)


def _is_square_of(whole: Found | None, found: Found) -> bool:
    """Return whether a tile's blur has the length of the squares that the whole frame is made of."""
    if whole is None or not whole.is_of_squares:
        return False
    return abs(found.length_px - whole.length_px) <= 2 * _ALIKE_SHARE * whole.length_px


def _departs(found: Found, tile: np.ndarray, whole: Found, lens_std_px: float | None) -> bool:
    """Return whether a tile shows that it moves otherwise than the whole frame."""
    apart = min(np.linalg.norm(sign * found.displacement_px - whole.displacement_px) for sign in (1, -1))
    if apart <= 2 * _ALIKE_SHARE * whole.length_px:
        return True
    power = found.frequencies.power(tile / found.scale)
    own = blur_nats(found.frequencies, power, found.fit.parameters, lens_std_px=lens_std_px)
    return own - _nats_of(found, tile, whole.displacement_px, lens_std_px) >= least_nats(found.length_px)


def _at_rest(found: Found, tile: np.ndarray, displacement_px: np.ndarray, lens_std_px: float | None) -> bool:
    """Return whether a texture without a blur explains a tile better than this displacement (2,)."""
    return _nats_of(found, tile, displacement_px, lens_std_px) < -_AS_WELL_NATS


def _nats_of(found: Found, tile: np.ndarray, displacement_px: np.ndarray, lens_std_px: float | None) -> float:
    """Return how much better [nats] about this displacement (2,) explains a tile than textures at rest."""
    parameters = found.fit.parameters.copy()
    parameters[[RIGHT, UP]] = displacement_px
    parameters[[STATIC, FILL]] = model.prior()[0][[STATIC, FILL]]
    power = found.frequencies.power(tile / found.scale)
    known_px = _ALIKE_SHARE * float(np.linalg.norm(displacement_px))
    return blur_nats(found.frequencies, power, parameters, lens_std_px=lens_std_px, known_px=known_px)
