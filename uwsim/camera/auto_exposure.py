"""Auto-exposure: the time or the gain at which a statistic of the picture meets its target.

Metered is the mean of the three bands of the noise-free linear picture, white balance and vignetting included, clipped
at 1 (white).
"""

import numpy as np

_STEPS = 60  # halvings of the interval: below the round-off of a float64


def metered(linear: np.ndarray, *, percentile: float | None) -> float:
    """Return the percentile (None: the mean) of a linear picture (H, W, 3), 0 to 1."""
    brightness = np.minimum(np.mean(linear, axis=-1, dtype=float), 1.0)
    return float(np.mean(brightness) if percentile is None else np.percentile(brightness, percentile))


def brightness_factor(linear: np.ndarray, *, target: float, percentile: float | None) -> float:
    """Return the factor on the light at which `metered` is `target`; inf if the picture cannot reach it.

    `linear` (H, W, 3): the picture at factor 1, not clipped. Raises ValueError on a target outside (0, 1).
    """
    if not 0 < target < 1:
        raise ValueError(f"auto-exposure: target = {target}, allowed: above 0 and below 1")
    brightness = np.mean(linear, axis=-1, dtype=float)
    if percentile is not None:
        level = float(np.percentile(brightness, percentile))
        return target / level if level > 0 else np.inf
    if np.mean(brightness > 0) <= target:
        return np.inf  # even if all that has light were white

    def too_dark(factor: float) -> bool:
        return np.mean(np.minimum(factor * brightness, 1.0)) < target

    low = target / float(np.mean(brightness))  # clipping only takes away
    high = 2 * low
    while too_dark(high):
        low, high = high, 2 * high
    for _ in range(_STEPS):
        middle = (low + high) / 2
        low, high = (middle, high) if too_dark(middle) else (low, middle)
    return high


def time_for(factor: float, *, time_s: float, dark_e: float, saturation_e: float) -> float:
    """Return the exposure time that makes the picture `factor` times brighter than `time_s` does. [s]

    `dark_e`: dark electrons in `time_s`. They take from the room up to white, so that the picture brightens a little
    faster than the time: linear ~ t / (saturation_e - dark_e t / time_s).
    """
    if np.isinf(factor):
        return np.inf
    share = factor / (saturation_e - dark_e)
    return time_s * share * saturation_e / (1 + share * dark_e)


def gain_for(factor: float, *, full_well_e: float, dark_e: float, saturation_e: float) -> float:
    """Return the gain that makes the picture `factor` times brighter than the one that saturates at `saturation_e`."""
    wanted_e = dark_e + (saturation_e - dark_e) / factor
    return full_well_e / wanted_e if wanted_e > 0 else np.inf
