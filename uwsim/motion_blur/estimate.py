"""What a blur estimator returns, and the check of what it is given."""

from typing import NamedTuple

import numpy as np

from uwsim.motion_blur.spectrum import Spectrum

MINIMUM_SIDE_PX = 16
LONGEST_BLUR_PX = 40.0
VERDICTS = ("blur", "no blur", "not uniform")
# spread below which an image counts as constant, as a share of its largest value: float32 round-off
_CONSTANT_SHARE = 1e-6
# more pixels at the largest value cannot be the picture's own; a tenth shortens the blur found by a few percent
SATURATED_SHARE = 0.1


class Estimate(NamedTuple):
    """Uniform straight motion during the exposure: length and direction (x right, **y up**, in [0, 180)).

    `covariance` (2, 2) of (length_px, angle_deg) in px^2, px deg, deg^2, or None where the method has none.
    `verdict`, one of VERDICTS: "no blur" means that none can be told from a sharp picture, "not uniform" that no
    single straight motion explains the picture; length and angle are the best fit all the same.
    `spectrum`: the picture's noise and texture where the method finds them, else None.
    """

    length_px: float
    angle_deg: float
    covariance: np.ndarray | None = None
    verdict: str = "blur"
    spectrum: Spectrum | None = None


def grey_from_image(image: np.ndarray, *, where: str) -> np.ndarray:
    """Return the mean of the channels as (H, W) float64 after checking the image.

    `image` (H, W) or (H, W, C), linear. Raises ValueError if a side is under 16 px, if it holds NaN or
    infinity, or if it is constant (nothing to see the blur by).
    """
    image = np.asarray(image)
    if image.ndim not in (2, 3) or min(image.shape[:2]) < MINIMUM_SIDE_PX:
        raise ValueError(f"{where}: image has shape {image.shape}, allowed: (H, W[, C]), H and W >= {MINIMUM_SIDE_PX}")
    grey = image.astype(np.float64)
    if image.ndim == 3:
        grey = grey.mean(axis=2)
    if not np.all(np.isfinite(grey)):
        raise ValueError(f"{where}: image holds {np.sum(~np.isfinite(grey))} NaN or infinite pixels, allowed: none")
    if np.ptp(grey) <= _CONSTANT_SHARE * np.abs(grey).max():
        raise ValueError(f"{where}: image is constant, allowed: an image with texture")
    return grey


def refuse_saturated(image: np.ndarray, *, where: str) -> None:
    """Raise ValueError if more than a tenth of the pixels stand at the largest value in some channel."""
    image = np.asarray(image)
    full = image >= image.max()
    share = float((full.any(axis=2) if image.ndim == 3 else full).mean())
    if share > SATURATED_SHARE:
        raise ValueError(
            f"{where}: image stands at its largest value in {100 * share:.1f} % of the pixels (saturated: not linear), "
            f"allowed: {100 * SATURATED_SHARE:.0f} %"
        )


def longest_length_px(shape: tuple[int, ...]) -> float:
    """Return the longest blur searched for in an image [px]: 40 px, in small images less than half a side."""
    return min(LONGEST_BLUR_PX, min(shape[:2]) / 2 - 2)


def estimate_from_vector(right_px: float, up_px: float) -> Estimate:
    """Return length and direction of a displacement given in pixels to the right and up."""
    angle_deg = float(np.degrees(np.arctan2(up_px, right_px))) % 180.0
    # the remainder of a tiny negative angle rounds to 180 itself
    return Estimate(float(np.hypot(right_px, up_px)), 0.0 if angle_deg >= 180.0 else angle_deg)
