"""Which channels of a picture the water has emptied: what is left there is noise, or another channel again."""

import numpy as np

# a channel whose mean is below this share of the brightest channel's is dim: it must show a picture of its own
DIM_SHARE = 0.15
# so wide must the range of its levels be, less what the brightest channel tells as well
OWN_RANGE = 20 / 255
# pixels of the working copy in which noise is averaged before
_AVERAGED_PX = 4
_DETAIL_PX = 7


def held_channels(planes: list[np.ndarray]) -> tuple[int, ...]:
    """Return the channels in which the water has left a picture; of a black picture all.

    A channel whose mean is at least DIM_SHARE of the brightest one's is held, a dimmer one if its `own_range` is at
    least OWN_RANGE: bodies near the camera keep their red where the rest of the picture has none.
    Chosen on real photographs: the red of a turtle in blue water comes to 26 of 255. In the video of a green tank the
    red, empty, comes to 0, and the blue, the green's detail again with less of it, to 9 to 16; held, it lowers the
    number of tags that are found. Noise of up to 16 levels comes to at most 8.
    """
    means = np.array([plane.mean() for plane in planes])
    held, brightest = means >= DIM_SHARE * means.max(), planes[int(means.argmax())]
    for channel in np.flatnonzero(~held):
        held[channel] = own_range(planes[channel], brightest) >= OWN_RANGE
    return tuple(np.flatnonzero(held).tolist())


def own_range(plane: np.ndarray, other: np.ndarray) -> float:
    """Return the range (5 to 95 %) of a channel (H, W) less what another one tells: times sqrt(1 - r^2).

    A range below OWN_RANGE is returned as it is.
    r: correlation of the details of the two; both are averaged over blocks before, in which noise goes.
    """
    coarse = _averaged(plane)
    low, high = np.quantile(coarse, (0.05, 0.95))
    if high - low < OWN_RANGE:  # what is left of it cannot be more
        return float(high - low)
    mine, theirs = _details(coarse), _details(_averaged(other))
    power = float((mine**2).sum() * (theirs**2).sum())
    told = float((mine * theirs).sum()) ** 2 / power if power > 0 else 0.0
    return float(high - low) * np.sqrt(max(0.0, 1 - told))


def _averaged(plane: np.ndarray) -> np.ndarray:
    import cv2

    height, width = (max(1, round(side / _AVERAGED_PX)) for side in plane.shape)
    return cv2.resize(plane, (width, height), interpolation=cv2.INTER_AREA)


def _details(image: np.ndarray) -> np.ndarray:
    import cv2

    fine = image - cv2.blur(image, (_DETAIL_PX, _DETAIL_PX))
    # writing in the picture and the rim of a frame are brighter than anything seen: 3 standard deviations, robustly
    limit = 3 * 1.4826 * np.median(np.abs(fine))
    return np.clip(fine, -limit, limit)
