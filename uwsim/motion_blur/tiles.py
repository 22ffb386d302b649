"""Undo a blur that varies over the picture: tile by tile, each with its own blur, joined by smooth windows."""

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from uwsim.motion_blur.deconvolution import MOST_WHITE_SHARE, is_flat, white_pixels
from uwsim.motion_blur.estimate import MINIMUM_SIDE_PX, estimate_from_vector

# pixels that a tile sees beyond its window and the reach of its blur: the border is known worst
_MARGIN_PX = 16


class BlurField(NamedTuple):
    """Blur at the centres of tiles that form a grid, in any order: displacements during the exposure.

    centres_px (n, 2): x right, y down, pixel centres at integer + 0.5; displacements_px (n, 2): right, **up**.
    """

    centres_px: np.ndarray
    displacements_px: np.ndarray


class _Span(NamedTuple):
    """Along one axis: pixels that a tile is solved on, and weight (H,) of its result in the picture."""

    first: int
    end: int
    weight: np.ndarray


def deblur_tiles(
    image: np.ndarray, *, field: BlurField, deblur: Callable[..., np.ndarray], **options: object
) -> np.ndarray:
    """Return an image (H, W[, C]) sharpened by `deblur(tile, blur=..., **options)` of a deconvolver, tile by tile.

    Between the centres of neighbouring tiles their results are cross-faded (cos^2; the weights sum to 1), beyond the
    outermost the last goes on. Tiles without texture, or more than half white, stay as they are. Raises ValueError
    unless the centres form a grid, and the tiles are at least 16 px.

    Source: Nagy and O'Leary, SIAM J. Scientific Computing 19(4), 1998 (piecewise constant blur, interpolated).
    Valid: blur that changes little across a tile.
    """
    image = np.asarray(image)
    total = np.zeros(image.shape)
    for (right_px, up_px), rows, columns in _tiles(image.shape[:2], field):
        part = image[rows.first : rows.end, columns.first : columns.end]
        if not is_flat(part.reshape(*part.shape[:2], -1).mean(axis=2), part) and _mostly_below_white(part):
            part = deblur(part, blur=estimate_from_vector(right_px, up_px), **options)
        weight = rows.weight[rows.first : rows.end, None] * columns.weight[None, columns.first : columns.end]
        weight = weight.reshape(weight.shape + (1,) * (image.ndim - 2))
        total[rows.first : rows.end, columns.first : columns.end] += weight * part
    return total.astype(image.dtype)


def _mostly_below_white(part: np.ndarray) -> bool:
    return float(white_pixels(part).mean()) <= MOST_WHITE_SHARE


def _tiles(shape: tuple[int, int], field: BlurField) -> Iterator[tuple[np.ndarray, _Span, _Span]]:
    """Yield (displacement, rows, columns) of each tile; ValueError if the field is no grid."""
    centres, displacements = (np.asarray(values, float) for values in field)
    if centres.ndim != 2 or centres.shape[1:] != (2,) or centres.shape != displacements.shape or len(centres) == 0:
        raise ValueError(
            f"blur field: got centres {centres.shape} and displacements {displacements.shape}, allowed: (n, 2) each"
        )
    if not (np.all(np.isfinite(centres)) and np.all(np.isfinite(displacements))):
        raise ValueError("blur field: got NaN or infinity, allowed: finite centres and displacements")
    x_px, y_px = np.unique(centres[:, 0]), np.unique(centres[:, 1])
    if len(np.unique(centres, axis=0)) != len(centres) or len(centres) != len(x_px) * len(y_px):
        raise ValueError(
            f"blur field: got {len(centres)} centres at {len(x_px)} columns and {len(y_px)} rows, allowed: a grid, "
            "each place once"
        )
    for (x, y), displacement in zip(centres, displacements, strict=True):
        reach = int(np.ceil(np.hypot(*displacement))) + _MARGIN_PX
        yield displacement, _span(y_px, y, shape[0], reach), _span(x_px, x, shape[1], reach)


def _span(centres: np.ndarray, centre: float, side: int, reach: int) -> _Span:
    """Return what of an axis with `side` pixels belongs to one of the sorted centres."""
    place = np.arange(side) + 0.5
    index = int(np.searchsorted(centres, centre))
    weight = np.ones(side)
    if index > 0:
        weight *= _fade((place - centres[index - 1]) / (centre - centres[index - 1]))
    if index < len(centres) - 1:
        weight *= _fade((centres[index + 1] - place) / (centres[index + 1] - centre))
    inside = np.flatnonzero(weight > 0)
    if inside.size == 0:
        raise ValueError(f"blur field: got a centre at {centre:g} px, allowed: tiles that meet the image of {side} px")
    first, end = max(inside[0] - reach, 0), min(inside[-1] + 1 + reach, side)
    if end - first < MINIMUM_SIDE_PX:
        raise ValueError(f"blur field: got a tile of {end - first} px, allowed: {MINIMUM_SIDE_PX} px and more")
    return _Span(int(first), int(end), weight)


def _fade(share: np.ndarray) -> np.ndarray:
    """Return 0 for shares up to 0, 1 from 1 on, sin^2 between: two neighbours' fades sum to 1."""
    return np.sin(np.pi / 2 * np.clip(share, 0, 1)) ** 2
