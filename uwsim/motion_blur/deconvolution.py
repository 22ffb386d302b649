"""What the deconvolvers share: check of the input, channels as components, white pixels, densities on a canvas."""

from typing import NamedTuple

import numpy as np

from uwsim.motion_blur.estimate import Estimate, grey_from_image
from uwsim.motion_blur.extension import canvas_shape
from uwsim.motion_blur.kernels import otf
from uwsim.motion_blur.whittle.known_blur import spectrum_of_blurred

# linear light of 254.5 / 255 in sRGB: from here on an 8-bit picture shows white, whatever the light was
WHITE_FROM = 0.9955
MOST_WHITE_SHARE = 0.5
# room on the canvas beyond the reach of the blur, where the picture changes over to its opposite border
SPARE_PX = 32
# a component with less spread than this share of the picture's largest value is round-off
_ROUND_OFF_SHARE = 1e-6
# texture of this share of the noise is none, and no number that a ratio could not be taken to
_LEAST_TEXTURE_SHARE = 1e-12


class Canvas(NamedTuple):
    """What is known of a picture on a canvas of `shape` (H', W'), larger than it: blur, sharp texture and noise.

    transfer, texture_psd (H', W'//2+1): in the order of `rfft2`.
    """

    shape: tuple[int, int]
    transfer: np.ndarray
    texture_psd: np.ndarray
    noise_std: float


def leaves_unchanged(image: np.ndarray, blur: Estimate, *, where: str) -> bool:
    """Return whether there is nothing to undo: length 0, or the verdict "no blur".

    Raises ValueError for an image that is no float image, that the estimators refuse as well (under 16 px, constant,
    NaN, infinite), or of which more than half is white; and for a blur longer than half the shorter side.
    """
    image = np.asarray(image)
    if not np.issubdtype(image.dtype, np.floating):
        raise ValueError(f"{where}: got {image.dtype}, allowed: a float image (linear light)")
    grey_from_image(image, where=where)
    share = float(np.mean(white_pixels(image)))
    if share > MOST_WHITE_SHARE:
        raise ValueError(f"{where}: {100 * share:.0f} % of the image is white, allowed: {100 * MOST_WHITE_SHARE:.0f} %")
    longest_px = min(image.shape[:2]) / 2
    if not (0 <= blur.length_px <= longest_px and np.isfinite(blur.angle_deg)):
        raise ValueError(
            f"{where}: got a blur of {blur.length_px:g} px at {blur.angle_deg:g} deg, allowed: 0 to {longest_px:g} px "
            "(half the shorter side)"
        )
    return nothing_to_undo(blur)


def nothing_to_undo(blur: Estimate) -> bool:
    """Return whether an estimate says length 0 or "no blur"."""
    # an estimator of a user's own may return no more than length and angle
    return blur.length_px == 0 or getattr(blur, "verdict", "blur") == "no blur"


def white_pixels(image: np.ndarray) -> np.ndarray:
    """Return where (H, W) any channel of a linear image is at white: there it tells only "at least this much"."""
    return np.any(channels_of(image) >= WHITE_FROM, axis=0)


def channels_of(image: np.ndarray) -> np.ndarray:
    """Return an image (H, W[, C]) as (C, H, W) float64, a copy."""
    image = np.asarray(image)
    return np.moveaxis(image.reshape(*image.shape[:2], -1), 2, 0).astype(np.float64)


def image_of(channels: np.ndarray, like: np.ndarray) -> np.ndarray:
    """Return channels (C, H, W) as an image of the shape and dtype of `like`, cut to [0, 1]."""
    return np.clip(np.moveaxis(channels, 0, 2), 0, 1).astype(like.dtype).reshape(like.shape)


def components_of(channels: np.ndarray) -> np.ndarray:
    """Return channels (C, H, W) as their sum / sqrt(C), and their differences.

    The transform (a cosine transform across the channels) is orthonormal: white noise stays white. Brightness and
    colours of pictures are much less correlated than red, green and blue, and each has noise and texture of its own.
    """
    from scipy.fft import dct

    return dct(channels, axis=0, norm="ortho")


def channels_of_components(parts: np.ndarray) -> np.ndarray:
    """Return the channels (C, H, W) whose components these are."""
    from scipy.fft import idct

    return idct(parts, axis=0, norm="ortho")


def is_flat(part: np.ndarray, image: np.ndarray) -> bool:
    """Return whether a channel or component of an image (colour of a grey one, say) holds nothing but round-off."""
    return float(np.ptp(part)) <= _ROUND_OFF_SHARE * float(np.abs(image).max())


def canvases_of(parts: np.ndarray, image: np.ndarray, blur: Estimate, spectrum: object = None) -> dict[int, Canvas]:
    """Return the canvas of each component (C, H, W) of an image that is not flat, by its number.

    spectrum: noise and texture of the mean of the channels, with `noise_std` and `texture_psd(u, v)`; without, that of
    the estimate, or a fit where it has none. The colours have fits of their own.
    """
    spectrum = spectrum if spectrum is not None else getattr(blur, "spectrum", None)
    return {
        order: canvas_of(part, blur, spectrum=spectrum if order == 0 else None, scale=len(parts))
        for order, part in enumerate(parts)
        if not is_flat(part, image)
    }


def canvas_of(part: np.ndarray, blur: Estimate, *, spectrum: object = None, scale: float = 1.0) -> Canvas:
    """Return the canvas of a picture (H, W); `spectrum`, fitted without, is of the picture / sqrt(scale)."""
    if spectrum is None:
        scale, spectrum = 1.0, spectrum_of_blurred(part, length_px=blur.length_px, angle_deg=blur.angle_deg)
    angle = np.radians(blur.angle_deg)
    reach_px = (abs(blur.length_px * np.sin(angle)), abs(blur.length_px * np.cos(angle)))
    shape = canvas_shape(part.shape, reach_px=reach_px, spare_px=SPARE_PX)
    transfer = half_of(otf(shape, length_px=blur.length_px, angle_deg=blur.angle_deg))
    u, v = np.fft.fftfreq(shape[1])[None, :], np.fft.fftfreq(shape[0])[:, None]
    noise_std = float(np.sqrt(scale) * spectrum.noise_std)
    texture_psd = half_of(scale * spectrum.texture_psd(u, v))
    least = max(_LEAST_TEXTURE_SHARE * noise_std**2, np.finfo(float).tiny)
    return Canvas(shape, transfer, np.maximum(texture_psd, least), noise_std)


def half_of(full: np.ndarray) -> np.ndarray:
    """Return the half (H, W//2+1) of a real function of frequency (H, W) that `rfft2` works with.

    Where a side is even, the highest frequency and its negative share one place: it gets the mean of both.
    """
    opposite = np.roll(full[::-1, ::-1], 1, axis=(0, 1))
    return (0.5 * (full + opposite))[:, : full.shape[1] // 2 + 1]


def weights_of_half(shape: tuple[int, int]) -> np.ndarray:
    """Return (W'//2+1,) how many columns of a full spectrum each column of its half stands for: 1 or 2."""
    weights = np.full(shape[1] // 2 + 1, 2.0)
    weights[0] = 1.0
    if shape[1] % 2 == 0:
        weights[-1] = 1.0
    return weights


def wiener_filtered(extended: np.ndarray, canvas: Canvas, *, gamma: float = 1.0) -> np.ndarray:
    """Return a picture (H', W') that repeats without a seam after the Wiener filter; its mean stays."""
    from scipy.fft import irfft2, rfft2

    ratio = canvas.noise_std**2 / canvas.texture_psd
    gain = canvas.transfer / (canvas.transfer**2 + gamma * ratio)
    gain[0, 0] = 1.0
    return irfft2(gain * rfft2(extended), s=canvas.shape)


def blurred(sharp: np.ndarray, canvas: Canvas) -> np.ndarray:
    """Return a picture (H', W') that repeats, blurred."""
    from scipy.fft import irfft2, rfft2

    return irfft2(canvas.transfer * rfft2(sharp), s=canvas.shape)
