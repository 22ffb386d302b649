"""Colour difference on the even patches of a chart, which are found without knowing the chart."""

import numpy as np

from uwsim.images import linear_from_srgb_uint8, srgb_encode
from uwsim.metrics.image import check_pair

MARGIN_PX = 2
SMALLEST_PX = 9
# of its bounding box: a patch in perspective fills most of it, the frame between the patches little
_FULLNESS = 0.5
_SMALLEST_SHARE = 0.25
_EVEN_SHARE, _EVEN = 0.02, 0.001


def patches(albedo: np.ndarray, inside: np.ndarray) -> np.ndarray:
    """Return the patches of a chart: (H, W) int, 1 to n in connected regions of even albedo, 0 elsewhere.

    `albedo` (H, W, 3); `inside` (H, W) bool, where the chart is seen. A pixel belongs to a patch if all within 2 px of
    it are of the chart and of one albedo (to 2 %): so patches that touch come apart, and edges stay out. Regions
    that fill less than half of their bounding box (the frame between patches), and those below 9 px or a quarter of the
    largest, are left out.
    """
    from scipy import ndimage

    size = 2 * MARGIN_PX + 1
    high, low = (
        operation(albedo, size=(size, size, 1)) for operation in (ndimage.maximum_filter, ndimage.minimum_filter)
    )
    even = np.all(high - low <= _EVEN_SHARE * high + _EVEN, axis=-1)
    labels, _ = ndimage.label(even & ndimage.minimum_filter(inside, size=size, mode="constant"))
    sizes = np.bincount(labels.ravel())
    boxes = [np.prod([side.stop - side.start for side in box]) for box in ndimage.find_objects(labels)]
    full = np.flatnonzero(sizes >= _FULLNESS * np.array([np.inf, *boxes]))
    kept = full[sizes[full] >= max(SMALLEST_PX, _SMALLEST_SHARE * sizes[full].max(initial=0))]
    renumbered = np.zeros(len(sizes), int)
    renumbered[kept] = np.arange(1, len(kept) + 1)
    return renumbered[labels]


def colour_difference(reference: np.ndarray, image: np.ndarray, labels: np.ndarray) -> float:
    """Return the mean colour difference CIEDE2000 over the patches of a chart; NaN if there is no patch.

    `reference`, `image` (H, W, 3) uint8 sRGB, `labels` (H, W) as of `patches`, else ValueError. A patch has the mean
    of its pixels in linear light; CIELab of it for D65 and the 2 degree observer. 1 is about what an eye can tell.

    Source: CIE 142-2001, as in `skimage.color.deltaE_ciede2000` (k_L = k_C = k_H = 1).
    Valid: noise of the pixels averages out, save where it is clipped at black or white.
    """
    from skimage.color import deltaE_ciede2000, rgb2lab

    check_pair(reference, image, where="colour_difference")
    if labels.shape != image.shape[:2]:
        raise ValueError(f"colour_difference: labels are {labels.shape}, allowed: the picture's {image.shape[:2]}")
    if not labels.any():
        return float("nan")
    true, found = (rgb2lab(srgb_encode(_means(one, labels))) for one in (reference, image))
    return float(np.mean(deltaE_ciede2000(true, found)))


def _means(image: np.ndarray, labels: np.ndarray) -> np.ndarray:
    """Return the mean of an 8-bit picture in linear light over each patch, (n, 3)."""
    here = labels > 0
    linear, numbers = linear_from_srgb_uint8(image[here]).astype(float), labels[here]
    sums = [np.bincount(numbers, weights=linear[:, band])[1:] for band in range(3)]
    return np.stack(sums, axis=-1) / np.bincount(numbers)[1:, None]
