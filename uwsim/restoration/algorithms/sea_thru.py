"""Backscatter and range-dependent attenuation fitted to the picture, given the range map. In linear light.

The darkest pixels of every range show the backscatter; what is left, averaged over neighbours of like range, shows how
fast the light falls with the range. Both are fitted by the paper's forms and undone.

Source: Akkaynak, Treibitz, "Sea-thru: a method for removing water from underwater images", CVPR 2019:
backscatter from the darkest 1 % of 10 ranges, two exponentials for the attenuation, local light with f = 2.
Valid: light that does not change along the range, that is daylight; of a lamp beside the camera the 1/r^2 is taken
for attenuation and its pattern stays. A likeness: neighbours of like range are averaged by a guided filter with the
range as guide instead of by iteration.
"""

import numpy as np

from uwsim.restoration import colour_constancy, guided_filter

INPUT = "linear_float32"
NEEDS = ("range_m",)

RANGES = 10
DARKEST_SHARE = 0.01
LIGHT_FACTOR = 2.0
MOST_PER_M = 5.0
WHITE_PERCENT = 99.0
# more would be noise; the paper has no such limit, nor pictures of 8 bit
LARGEST_GAIN = 50.0
_MOST_POINTS = 300


def restore(image: np.ndarray, *, range_m: np.ndarray) -> np.ndarray:
    """Return the linear image (H, W, 3) float32 in [0, 1] without the water; 0 where no body is seen.

    `range_m` (H, W), +inf where no body is seen. Channel means are made equal and the brightest percent white.
    Raises ValueError for another shape, and for ranges that are NaN, not above 0, or of no body at all.
    """
    if np.shape(range_m) != image.shape[:2]:
        raise ValueError(f"sea_thru: range_m has shape {np.shape(range_m)}, allowed: {image.shape[:2]}")
    seen = np.isfinite(range_m)
    if not seen.any() or not np.all(np.asarray(range_m) > 0):
        raise ValueError(
            "sea_thru: range_m is NaN, not above 0 or infinite everywhere, allowed: > 0, +inf without a body"
        )
    path = np.where(seen, range_m, np.max(range_m[seen])).astype(np.float32)
    found = np.zeros_like(image)
    light = np.empty_like(image)
    for channel in range(3):
        back = backscatter_fit(image, path, seen, channel)
        found[..., channel] = np.maximum(image[..., channel] - backscatter(path, back), 0)
        light[..., channel] = _local_light(found[..., channel], path)
    for channel in range(3):
        decay = attenuation_fit(light[..., channel][seen], path[seen])
        gain = np.exp(np.minimum(attenuation(path, decay) * path, np.log(LARGEST_GAIN)))
        found[..., channel] *= gain.astype(np.float32)
    found[~seen] = 0
    found = colour_constancy.gray_world(found)
    white = np.percentile(found[seen].max(axis=1), WHITE_PERCENT)
    return np.clip(found / np.float32(white if white > 0 else 1), 0, 1)


def backscatter(path_m: np.ndarray, fit: np.ndarray) -> np.ndarray:
    """Return B_inf (1 - e^(-b z)) of a fit (B_inf, b, ...); what objects leave of it is not backscatter."""
    return fit[0] * (1 - np.exp(-fit[1] * path_m))


def backscatter_fit(image: np.ndarray, path_m: np.ndarray, seen: np.ndarray, channel: int) -> np.ndarray:
    """Return (B_inf, b, J', b') of B_inf (1 - e^(-b z)) + J' e^(-b' z), fitted to a channel of the darkest pixels."""
    from scipy.optimize import least_squares

    places = _darkest(image, path_m, seen)
    z, values = path_m.ravel()[places].astype(float), image[..., channel].ravel()[places].astype(float)

    def residual(fit: np.ndarray) -> np.ndarray:
        return backscatter(z, fit) + fit[2] * np.exp(-fit[3] * z) - values

    most = [1.0, MOST_PER_M, 1.0, MOST_PER_M]
    start = [min(max(float(values.max()), 1e-3), 0.99), 1.0, 1e-3, 1.0]
    return least_squares(residual, start, bounds=([0.0] * 4, most), x_scale=[0.1, 1, 0.1, 1], xtol=1e-10).x


def _darkest(image: np.ndarray, path_m: np.ndarray, seen: np.ndarray) -> np.ndarray:
    """Return the numbers of the darkest 1 % of the pixels in each of ten equal parts of the range."""
    number = np.nonzero(seen.ravel())[0]
    z, dark = path_m.ravel()[number], image.reshape(-1, 3).sum(axis=1)[number]
    edges = np.linspace(z.min(), z.max(), RANGES + 1)
    part = np.clip(np.searchsorted(edges, z, side="right") - 1, 0, RANGES - 1)
    found = []
    for index in range(RANGES):
        own = number[part == index]
        count = min(int(np.ceil(DARKEST_SHARE * len(own))), _MOST_POINTS)
        found.append(own[np.argsort(dark[part == index], kind="stable")[:count]])
    return np.concatenate(found)


def _local_light(channel: np.ndarray, path_m: np.ndarray) -> np.ndarray:
    """Return twice the mean of the neighbours of like range, (H, W)."""
    radius_px = max(2, channel.shape[1] // 20)
    near = (0.02 * float(np.median(path_m))) ** 2
    smooth = guided_filter.guided(path_m, np.ascontiguousarray(channel), radius_px=radius_px, epsilon=near, subsample=2)
    return LIGHT_FACTOR * smooth


def attenuation(path_m: np.ndarray, fit: np.ndarray) -> np.ndarray:
    """Return a e^(-b z) + c e^(-d z) of a fit (a, b, c, d). [1/m]"""
    return fit[0] * np.exp(-fit[1] * path_m) + fit[2] * np.exp(-fit[3] * path_m)


def attenuation_fit(light: np.ndarray, path_m: np.ndarray) -> np.ndarray:
    """Return (a, b, c, d) so that -log E / (a e^(-b z) + c e^(-d z)) comes near z, of light (n,) at ranges (n,)."""
    from scipy.optimize import least_squares

    order = np.argsort(path_m, kind="stable")
    parts = np.array_split(order, min(40, len(order)))
    z = np.array([np.median(path_m[part]) for part in parts], float)
    # light of 1 and more is no attenuation; less than a thousandth is noise
    depth = -np.log(np.clip([np.median(light[part]) for part in parts], 1e-3, 0.999))

    def residual(fit: np.ndarray) -> np.ndarray:
        return (depth / np.maximum(attenuation(z, fit), 1e-6) - z) / z

    start = max(float(np.median(depth / z)), 1e-3)
    most = [np.inf, MOST_PER_M, np.inf, MOST_PER_M]
    return least_squares(residual, [start / 2, 0.1, start / 2, 0.01], bounds=([0.0] * 4, most), loss="soft_l1").x
