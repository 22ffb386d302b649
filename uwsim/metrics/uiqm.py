"""UIQM, a no-reference score of underwater images, in two variants. Both rank white noise high: no goal.

UIQM = 0.0282 colourfulness + 0.2953 sharpness + 3.5753 contrast. The paper leaves block size, borders and the
combination of the channels open, public code differs in all of them, and the values differ by factors: a
number without its variant means nothing.

Source: Panetta, Gao, Agaian, IEEE J. Oceanic Engineering 41(3), 2016, 541-551.
"""

import math

import numpy as np

from uwsim.metrics.image import check_image

WEIGHTS = (0.0282, 0.2953, 3.5753)
RED_WEIGHT, GREEN_WEIGHT, BLUE_WEIGHT = 0.299, 0.587, 0.114
TRIMMED_SHARE = 0.1
BLOCK_F_PX, BLOCK_M_PX = 10, 5
RESIZED_PX = 256


def uiqm_f(image: np.ndarray, *, resize: bool = True, blue_weight: float = BLUE_WEIGHT) -> float:
    """Return UIQM, variant F (the common Python variant), of an (H, W, 3) uint8 sRGB image.

    What the variant fixes: the image is first resized to 256 x 256 (antialiased bicubic, as PIL does;
    `resize=False` keeps it), blocks of 10 x 10 with the remainder cut, Sobel magnitude scaled to a maximum of
    255 and multiplied by the channel, contrast from the joint extremes of R, G and B in a block (exactly 0
    for a one-colour image). The widespread script has `blue_weight` 0.144, a slip that adds up to 0.07; the
    default is the luma weight. Not resized, both sides must be at least 10 px. Other inputs raise ValueError.

    Source: Panetta et al. 2016; block and contrast conventions of Islam, Xia, Sattar, IEEE RA-L
    5(2), 2020 (FUnIE-GAN).
    """
    check_image(image, where="uiqm_f", minimum_px=1 if resize else BLOCK_F_PX)
    if resize:
        image = resize_bicubic(image, height=RESIZED_PX, width=RESIZED_PX)
    pixels = image.astype(np.float64)
    sharpness = [block_log_ratio(_scaled_sobel(channel) * channel, BLOCK_F_PX) for channel in np.moveaxis(pixels, 2, 0)]
    high, low = block_extremes(pixels.max(axis=2), pixels.min(axis=2), BLOCK_F_PX)
    return _combine(
        _colourfulness(pixels, variance_of_all=True),
        np.dot((RED_WEIGHT, GREEN_WEIGHT, blue_weight), sharpness),
        _michelson_entropy(high, low),
    )


def uiqm_m(image: np.ndarray) -> float:
    """Return UIQM, variant M (the common MATLAB variant), of an (H, W, 3) uint8 sRGB image.

    What the variant fixes: native size, blocks of 5 x 5 with the remainder cut (the MATLAB code instead
    enlarges images whose sides are no multiples of 5), variance of the trimmed samples only, sharpness from
    |G_x + G_y| with G_x growing to the right and G_y growing upwards, not multiplied by the channel, contrast
    **summed over R, G and B** (up to 3.95 points instead of 1.32). Both sides at least 5 px, else ValueError.

    Source: Panetta et al. 2016; conventions of the MATLAB files UICM.m, UISM.m and UIConM.m in
    public use.
    """
    check_image(image, where="uiqm_m", minimum_px=BLOCK_M_PX)
    pixels = image.astype(np.float64)
    sharpness, contrast = [], 0.0
    for channel in np.moveaxis(pixels, 2, 0):
        right, down = _sobel(channel)
        sharpness.append(block_log_ratio(np.abs(right - down), BLOCK_M_PX))
        contrast += _michelson_entropy(*block_extremes(channel, channel, BLOCK_M_PX))
    return _combine(
        _colourfulness(pixels, variance_of_all=False),
        np.dot((RED_WEIGHT, GREEN_WEIGHT, BLUE_WEIGHT), sharpness),
        contrast,
    )


def _combine(colourfulness: float, sharpness: float, contrast: float) -> float:
    return float(np.dot(WEIGHTS, (colourfulness, sharpness, contrast)))


def _colourfulness(pixels: np.ndarray, *, variance_of_all: bool) -> float:
    """Return UICM from the trimmed mean and the variance about it of R - G and (R + G) / 2 - B."""
    red, green, blue = (pixels[..., channel].ravel() for channel in range(3))
    means, variances = [], []
    for opponent in (red - green, (red + green) / 2 - blue):
        count = opponent.size
        below, above = math.ceil(TRIMMED_SHARE * count), math.floor(TRIMMED_SHARE * count)
        kept = np.partition(opponent, sorted({below, count - above - 1}))[below : count - above]
        means.append(kept.mean())
        variances.append(np.mean(((opponent if variance_of_all else kept) - means[-1]) ** 2))
    return -0.0268 * math.hypot(*means) + 0.1586 * math.sqrt(sum(variances))


def _sobel(channel: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the Sobel derivatives to the right and downwards (unnormalised, edge pixels repeated)."""
    from scipy import ndimage

    return ndimage.sobel(channel, axis=1, mode="nearest"), ndimage.sobel(channel, axis=0, mode="nearest")


def _scaled_sobel(channel: np.ndarray) -> np.ndarray:
    magnitude = np.hypot(*_sobel(channel))
    peak = magnitude.max()
    return magnitude * (255 / peak) if peak > 0 else magnitude


def block_extremes(upper: np.ndarray, lower: np.ndarray, block_px: int) -> tuple[np.ndarray, np.ndarray]:
    """Return per block the maximum of `upper` and the minimum of `lower`, (H, W); the remainder is cut."""
    rows, columns = (side // block_px for side in upper.shape)

    def blocks(values: np.ndarray) -> np.ndarray:
        return values[: rows * block_px, : columns * block_px].reshape(rows, block_px, columns, block_px)

    return blocks(upper).max(axis=(1, 3)), blocks(lower).min(axis=(1, 3))


def block_log_ratio(values: np.ndarray, block_px: int) -> float:
    """Return EME, twice the mean over blocks of log(maximum / minimum); blocks with a zero count as 0."""
    high, low = block_extremes(values, values, block_px)
    usable = low > 0
    return 2 * float(np.log(high[usable] / low[usable]).sum()) / high.size


def _michelson_entropy(high: np.ndarray, low: np.ndarray) -> float:
    """Return the mean over blocks of -m log m, m = (high - low) / (high + low); flat blocks count as 0."""
    varied = high > low
    contrast = (high[varied] - low[varied]) / (high[varied] + low[varied])
    return -float((contrast * np.log(contrast)).sum()) / high.size


def resize_bicubic(image: np.ndarray, *, height: int, width: int) -> np.ndarray:
    """Return an (H, W, C) uint8 image resized by an antialiased bicubic filter (a = -0.5), rounded to uint8.

    Across first, then down, rounding after each: equal to PIL within one level (Pillow 13 goes down first
    where the height shrinks and the width grows).

    Source: Keys, IEEE Trans. ASSP 29(6), 1981, eq. 15 (kernel), stretched by the factor of reduction.
    """

    def rounded(values: np.ndarray) -> np.ndarray:
        return np.clip(np.floor(values + 0.5), 0, 255)

    across = rounded(np.einsum("wx,hxc->hwc", _bicubic_weights(image.shape[1], width), image, optimize=True))
    return rounded(np.einsum("hy,ywc->hwc", _bicubic_weights(image.shape[0], height), across, optimize=True)).astype(
        np.uint8
    )


def _bicubic_weights(source_px: int, target_px: int) -> np.ndarray:
    """Return the (target, source) resampling matrix; its rows sum to 1."""
    scale = source_px / target_px
    stretch = max(scale, 1.0)
    centres = (np.arange(target_px)[:, None] + 0.5) * scale
    t = np.abs((np.arange(source_px)[None, :] + 0.5 - centres) / stretch)
    near = (1.5 * t - 2.5) * t * t + 1
    far = ((-0.5 * t + 2.5) * t - 4) * t + 2
    weights = np.where(t < 1, near, np.where(t < 2, far, 0.0))
    return weights / weights.sum(axis=1, keepdims=True)
