"""Maximum likelihood: the spectrum of a blurred power-law texture with noise, fitted to that of the picture.

The power spectrum is that of the sharp texture (a power law with curvature, roll-off and anisotropy) times sinc^2 of
the frequency along the motion, plus white noise; a static share and a fill of the zeros take up what is not quite one
uniform motion. All are found together, from several starts, by Fisher scoring of Whittle's likelihood.

Source: Whittle, Arkiv foer Matematik 2, 1953; Dahlhaus and Kuensch, Biometrika 74(4), 1987 (tapers).
Valid: linear light, noise that is white; lengths from about 1.5 px, where a lens and a blur begin to differ; pictures
whose blur differs by less than about a tenth over the frame (`field` for others).
"""

import numpy as np

from uwsim.motion_blur.estimate import Estimate, grey_from_image, refuse_saturated
from uwsim.motion_blur.whittle import tiles
from uwsim.motion_blur.whittle.picture import find

INPUT = "linear_float32"
NEEDS = ()


def estimate(image: np.ndarray, *, lens_std_px: float | None = None) -> Estimate:
    """Return the blur of a linear image (H, W, 3) with covariance, verdict and the picture's spectrum.

    Searches lengths up to 40 px (less than half a side of small images). `lens_std_px`: standard deviation of the
    lens's spot, where it is known. "no blur": shorter than 1.5 px, or explained as well by another lens or by a texture
    that is smoother in one direction; length and angle are the best fit all the same.
    ValueError for images that are constant, not finite, under 16 px, or saturated in more than a tenth of their pixels.
    """
    if lens_std_px is not None and not (np.isfinite(lens_std_px) and lens_std_px >= 0):
        raise ValueError(f"whittle: got lens_std_px {lens_std_px}, allowed: finite, >= 0")
    grey = grey_from_image(image, where="whittle")
    refuse_saturated(image, where="whittle")
    found = find(grey, lens_std_px=lens_std_px)
    return Estimate(0.0, 0.0, verdict="no blur") if found is None else found.estimate()


def field(image: np.ndarray, *, lens_std_px: float | None = None) -> dict[str, np.ndarray]:
    """Return the blur over a linear image (H, W, 3): `centres_px`, `displacement_px` (n, 2), `verdict` (n,).

    Of one tile, the whole, where the verdict is "blur" or the image is too small for two; else of tiles of a quarter of
    the shorter side, at least 128 px, from `uwsim.motion_blur.whittle.tiles.field`, filled. ValueError as `estimate`.
    """
    whole = estimate(image, lens_std_px=lens_std_px)
    tile_px = tiles.tile_size_px(image.shape)
    if whole.verdict == "blur" or tile_px is None:
        angle = np.radians(whole.angle_deg)
        displacement_px = whole.length_px * np.array([[np.cos(angle), np.sin(angle)]])
        middle_px = np.array([[image.shape[1], image.shape[0]]]) / 2
        return {"centres_px": middle_px, "displacement_px": displacement_px, "verdict": np.array([whole.verdict])}
    found = tiles.field(image, tile_px=tile_px, step_px=tile_px // 2, lens_std_px=lens_std_px, fill=True)
    return {
        "centres_px": found.centres_px.reshape(-1, 2), "displacement_px": found.displacement_px.reshape(-1, 2),
        "verdict": found.verdict.ravel(),
    }  # fmt: skip
