"""Full-reference image metrics of 8-bit sRGB images, and the input check of all image metrics."""

import math

import numpy as np

from uwsim.images import check_srgb_uint8

DATA_RANGE = 255.0
SSIM_WINDOW_PX = 7


def check_image(image: np.ndarray, *, where: str, minimum_px: int = 1) -> None:
    """Raise ValueError unless `image` is (H, W, 3) uint8 with both sides at least `minimum_px`."""
    check_srgb_uint8(image, where=where)
    if min(image.shape[:2]) < minimum_px:
        raise ValueError(f"{where}: got {image.shape[:2]} px, allowed: both sides >= {minimum_px} px")


def check_pair(reference: np.ndarray, image: np.ndarray, *, where: str, minimum_px: int = 1) -> None:
    """Raise ValueError unless both are as `check_image` wants them, and of one shape."""
    check_image(reference, where=f"{where} reference", minimum_px=minimum_px)
    check_image(image, where=f"{where} image", minimum_px=minimum_px)
    if reference.shape != image.shape:
        raise ValueError(f"{where}: image is {image.shape}, allowed: the reference's shape {reference.shape}")


def mse(reference: np.ndarray, image: np.ndarray) -> float:
    """Return the mean squared error over all pixels and channels [levels^2 of 0..255].

    Both (H, W, 3) uint8 sRGB of one shape, else ValueError. No gain or offset is fitted.
    """
    check_pair(reference, image, where="mse")
    return float(np.mean((reference.astype(np.float64) - image) ** 2))


def psnr(reference: np.ndarray, image: np.ndarray) -> float:
    """Return the peak signal-to-noise ratio 10 log10(255^2 / mse) [dB]; `math.inf` for identical images.

    Variant: data range 255, one mean over all pixels and the three sRGB channels, no gain fitted.
    Both (H, W, 3) uint8 of one shape, else ValueError.

    Source: Wang and Bovik, IEEE Signal Processing Magazine 26(1), 2009.
    """
    check_pair(reference, image, where="psnr")
    error = mse(reference, image)
    return math.inf if error == 0 else 10 * math.log10(DATA_RANGE**2 / error)


def ssim(reference: np.ndarray, image: np.ndarray) -> float:
    """Return the mean structural similarity, in [-1, 1].

    Variant: data range 255, uniform 7x7 window, sample covariance, K1 = 0.01, K2 = 0.03, per sRGB channel,
    mean of the three channels (the original has an 11x11 Gaussian window of sigma 1.5 on grey). Both (H, W,
    3) uint8 of one shape, at least 7 px on each side, else ValueError.

    Source: Wang, Bovik, Sheikh, Simoncelli, IEEE Trans. Image Processing 13(4), 2004, eq. 13, as in
    `skimage.metrics.structural_similarity`.
    """
    from skimage.metrics import structural_similarity

    check_pair(reference, image, where="ssim", minimum_px=SSIM_WINDOW_PX)
    value = structural_similarity(
        reference, image, win_size=SSIM_WINDOW_PX, data_range=DATA_RANGE, channel_axis=2,
        gaussian_weights=False, use_sample_covariance=True, K1=0.01, K2=0.03,
    )  # fmt: skip
    return float(value)
