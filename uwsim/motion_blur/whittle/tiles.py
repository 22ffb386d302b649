"""The blur as a field over the frame: one fit per tile, for motion that differs from place to place."""

from typing import NamedTuple

import numpy as np

from uwsim.motion_blur.estimate import MINIMUM_SIDE_PX, SATURATED_SHARE, grey_from_image, is_constant, saturated_share
from uwsim.motion_blur.whittle.picture import find

_SHORTEST_TILE_PX = 2 * MINIMUM_SIDE_PX


class Field(NamedTuple):
    """The blur of R x C tiles.

    Tiles that are constant or saturated have NaN displacement and covariance, and the verdict "no blur".
    """

    centres_px: np.ndarray  # (R, C, 2): x right, y down, pixel centres at integer + 0.5
    displacement_px: np.ndarray  # (R, C, 2): right and **up**, over the exposure; up >= 0: the sign cannot be seen
    covariance_px2: np.ndarray  # (R, C, 2, 2) of the displacement
    verdict: np.ndarray  # (R, C) of VERDICTS


def field(image: np.ndarray, *, tile_px: int = 128, step_px: int = 64, lens_std_px: float | None = None) -> Field:
    """Return the blur of square tiles of a linear image (H, W[, C]), each a `step_px` from the next.

    Tiles also start from what the whole frame says; the errors grow as 1 / tile_px. ValueError as `estimate` for the
    image, and where a tile does not fit into it or is under 32 px.
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
    shape = (len(tops), len(lefts))
    displacement, covariance = np.full((*shape, 2), np.nan), np.full((*shape, 2, 2), np.nan)
    verdict = np.full(shape, "no blur", dtype="<U11")
    for index in np.ndindex(shape):
        inside = tuple(slice(start, start + tile_px) for start in (tops[index[0]], lefts[index[1]]))
        tile = grey[inside]
        if is_constant(tile) or saturated_share(image[inside], full=image.max()) > SATURATED_SHARE:
            continue
        found = find(tile, lens_std_px=lens_std_px, hints_px=hints_px)
        if found is not None:
            displacement[index], covariance[index] = found.displacement_px, found.covariance_px2
            verdict[index] = found.verdict
    centres = np.stack(np.meshgrid(lefts, tops), axis=-1) + tile_px / 2
    return Field(centres, displacement, covariance, verdict)
