"""What to do about a picture whose blur was estimated: undo one blur, undo it tile by tile, or leave it as it is."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from uwsim.motion_blur.deconvolution import nothing_to_undo
from uwsim.motion_blur.estimate import Estimate
from uwsim.motion_blur.tiles import BlurField, deblur_tiles
from uwsim.motion_blur.whittle import tiles as whittle_tiles

LEFT_ALONE, UNIFORM = "left alone", "uniform"


@dataclass(frozen=True)
class Way:
    """`how` in words: "left alone", "uniform", or how many of the tiles are deblurred; `field`: blur of the tiles."""

    how: str
    blur: Estimate
    field: BlurField | None = None

    def apply(self, image: np.ndarray, deblur: Callable[..., np.ndarray]) -> np.ndarray:
        """Return an image (H, W[, C]) after `deblur(image, blur=...)` of a deconvolver, or a copy."""
        if self.how == LEFT_ALONE:
            return np.array(image)
        if self.field is None:
            return deblur(image, blur=self.blur)
        return deblur_tiles(image, field=self.field, deblur=deblur)


def one_blur(blur: Estimate) -> Way:
    """Return the way to undo a blur that is the same everywhere."""
    return Way(LEFT_ALONE if nothing_to_undo(blur) else UNIFORM, blur)


def by_verdict(image: np.ndarray, blur: Estimate) -> Way:
    """Return the way to undo what `whittle` found of a linear image (H, W[, C]).

    "no blur": none. "not uniform": tiles with blurs of their own (`whittle.tiles`), those at rest left alone; in
    pictures too small for two tiles the one best blur.
    """
    if nothing_to_undo(blur) or getattr(blur, "verdict", "blur") != "not uniform":
        return one_blur(blur)
    tile_px = whittle_tiles.tile_size_px(image.shape)
    if tile_px is None:
        return one_blur(blur)
    found = whittle_tiles.field(image, tile_px=tile_px, step_px=tile_px // 2, fill=True)
    displacements = np.where((found.verdict == "no blur")[..., None], 0.0, found.displacement_px).reshape(-1, 2)
    moved = int(np.count_nonzero(displacements.any(axis=1)))
    how = f"{moved} of {len(displacements)} tiles" if moved else LEFT_ALONE
    return Way(how, blur, BlurField(found.centres_px.reshape(-1, 2).astype(float), displacements))
