"""Shape of the cepstrum: the ellipse of its bright ridge, the window around it, the brightest region in the window.

All maps are centred cepstra (2 reach + 1 squared, quefrency 0 in the middle), all lengths quefrencies in pixels.

Source: the dissertation, chapter 4, steps 3 and 4, lines 6-16 of its pseudo-code.
Errata: the half-long axis stands for the length only where the threshold happens to cut the ridge, which falls as
1 / |q|, near q = L; measured, it does not. It serves as the gate of the search and as nothing else.
"""

from typing import NamedTuple

import numpy as np

from uwsim.motion_blur.cepstrum import SHORTEST_PX, deepest, distance_px, upper_half

# Free in the source ("based on the overall gray value", "rectangular", no numbers). The share of failures stays within
# 3 points between the 90th and the 98th percentile, with the mean or Otsu's threshold, and with an opening of 3.
ZOOM = 4
RIDGE_PERCENTILE = 90.0
STRETCH_PERCENTILES = (1.0, 99.0)
OPENING_SIDE = 5
PEAKS = 6
# edges of the window: twice the ellipse's full axes
WINDOW_PER_AXIS = 2.0


class Ellipse(NamedTuple):
    """Half axes [px] and the direction of the long one [deg], x right, y up, in [0, 180)."""

    half_long_px: float
    half_short_px: float
    angle_deg: float


def ellipse_of_ridge(values: np.ndarray) -> Ellipse | None:
    """Return the least-squares ellipse of the bright region in the middle; None if opening leaves nothing of it.

    Zoom, grey stretch, threshold, opening with a square, outer contour, ellipse. Of several contours the one around
    the middle counts, else the largest.
    """
    import cv2

    zoomed = cv2.resize(values.astype(np.float32), None, fx=ZOOM, fy=ZOOM, interpolation=cv2.INTER_CUBIC)
    low, high = np.percentile(zoomed, STRETCH_PERCENTILES)
    if high <= low:
        return None
    stretched = np.clip((zoomed - low) / (high - low), 0, 1)
    bright = (stretched > np.percentile(stretched, RIDGE_PERCENTILE)).astype(np.uint8)
    opened = cv2.morphologyEx(bright, cv2.MORPH_OPEN, np.ones((OPENING_SIDE, OPENING_SIDE), np.uint8))
    contours, _ = cv2.findContours(opened, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    if not contours:
        return None
    middle = (zoomed.shape[0] - 1) / 2
    around = [contour for contour in contours if cv2.pointPolygonTest(contour, (middle, middle), False) >= 0]
    _, (first, second), turn_deg = cv2.fitEllipse(max(around or contours, key=cv2.contourArea))
    # OpenCV turns clockwise on the screen and measures to the first axis
    angle_deg = -turn_deg if first >= second else -turn_deg - 90
    return Ellipse(max(first, second) / (2 * ZOOM), min(first, second) / (2 * ZOOM), angle_deg % 180)


def negative_peaks(values: np.ndarray, mask: np.ndarray) -> list[tuple[int, int]]:
    """Return (row, column) of the six deepest negative local minima where the mask is set, deepest first."""
    from scipy.ndimage import minimum_filter

    found = np.flatnonzero(mask & (values < 0) & (values == minimum_filter(values, 3)))
    order = found[np.argsort(values.ravel()[found], kind="stable")][:PEAKS]
    return [(int(index) // values.shape[1], int(index) % values.shape[1]) for index in order]


def window_of(ellipse: Ellipse, reach: int) -> np.ndarray:
    """Return the mask of the rectangle along the ellipse's axes, with twice the full axes as edges."""
    down, right = np.mgrid[-reach : reach + 1, -reach : reach + 1]
    angle = np.radians(ellipse.angle_deg)
    along = np.abs(right * np.cos(angle) - down * np.sin(angle))
    across = np.abs(right * np.sin(angle) + down * np.cos(angle))
    return (along <= WINDOW_PER_AXIS * ellipse.half_long_px) & (across <= WINDOW_PER_AXIS * ellipse.half_short_px)


def brightest_region(values: np.ndarray, window: np.ndarray, *, by: str) -> np.ndarray:
    """Return the mask of the brightest connected region of the negative part in the window, and of its mirror image.

    The negative part is made binary by Otsu's threshold. "Brightest" is not explained in the source: `by="sum"` takes
    the region of the greatest total depth, `by="peak"` the one with the deepest point. Empty if nothing is negative.
    """
    import cv2
    from scipy import ndimage

    depth = np.where(window & (distance_px(values.shape[0] // 2) >= SHORTEST_PX), np.maximum(-values, 0), 0)
    if depth.max() <= 0:
        return np.zeros(values.shape, bool)
    levels = np.rint(255 * depth / depth.max()).astype(np.uint8)
    threshold, _ = cv2.threshold(levels[window], 0, 255, cv2.THRESH_BINARY + cv2.THRESH_OTSU)
    labels, count = ndimage.label(levels > threshold, structure=np.ones((3, 3)))
    if count == 0:
        return np.zeros(values.shape, bool)
    measure = {"sum": ndimage.sum, "peak": ndimage.maximum}[by]
    region = labels == 1 + int(np.argmax(measure(depth, labels, np.arange(1, count + 1))))
    return region | region[::-1, ::-1]


def chosen_peak(
    values: np.ndarray, mask: np.ndarray, ellipse: Ellipse | None, *, both_of_a_pair: bool, by: str
) -> tuple[int, int]:
    """Return (row, column) of the deepest of six peaks that lies in the brightest region of the ellipse's window.

    `mask`: where blurs are searched for. `both_of_a_pair`: count q and -q as two of the six, as the source does, which
    leaves three. Where none of them passes, or there is no ellipse, the deepest peak; where there is no peak, the
    deepest point.
    """
    reach = values.shape[0] // 2
    half = upper_half(reach)
    peaks = negative_peaks(values, mask if both_of_a_pair else mask & half)
    if not peaks:
        return deepest(values, mask & half)
    if ellipse is not None:
        region = brightest_region(values, window_of(ellipse, reach), by=by)
        peaks = [peak for peak in peaks if region[peak]] + peaks
    return peaks[0]
