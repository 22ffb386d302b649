"""Motion blur: transfer function, raster kernel, blurring with a uniform straight one; the kernel of any path.

Angles: x right, **y up**, degrees; the kernel is centred and even, so the direction has no sign.
"""

import numpy as np


def otf(shape: tuple[int, int], *, length_px: float, angle_deg: float) -> np.ndarray:
    """Return the exact transfer function, (H, W) float64, in the frequency order of `numpy.fft.fft2`.

    sinc(L (u cos theta - v sin theta)), sinc(x) = sin(pi x) / (pi x), u and v in cycles per pixel along
    columns and rows (rows go down, hence the minus). Raises ValueError on a negative or non-finite length.

    Source: Fourier transform of a uniform line density; Banham and Katsaggelos, IEEE Signal Processing
    Magazine 14(2), 1997, section on blur models.
    """
    _check(length_px, angle_deg)
    angle = np.radians(angle_deg)
    u, v = np.fft.fftfreq(shape[1])[None, :], np.fft.fftfreq(shape[0])[:, None]
    return np.sinc(length_px * (u * np.cos(angle) - v * np.sin(angle)))


def blur(image: np.ndarray, *, length_px: float, angle_deg: float) -> np.ndarray:
    """Return an (H, W) or (H, W, C) float image blurred with the exact transfer function.

    **Periodic**: what leaves on one side enters on the other; crop the borders where that matters. The dtype
    is kept; sharp edges can overshoot slightly because the line is not widened to whole pixels.
    """
    image = np.asarray(image)
    if not np.issubdtype(image.dtype, np.floating):
        raise ValueError(f"blur: got {image.dtype}, allowed: a float image (linear light)")
    transfer = otf(image.shape[:2], length_px=length_px, angle_deg=angle_deg)
    if image.ndim == 3:
        transfer = transfer[..., None]
    return np.fft.ifft2(np.fft.fft2(image, axes=(0, 1)) * transfer, axes=(0, 1)).real.astype(image.dtype)


def kernel(size_px: int, *, length_px: float, angle_deg: float) -> np.ndarray:
    """Return the blur as a picture, (size, size) float64: the share of the line inside each pixel; sum 1.

    The line is centred in the middle pixel, so `size_px` is odd; ValueError if it is even or the line does
    not fit. A length of 0 gives a single 1.
    """
    _check(length_px, angle_deg)
    # a line of no thickness but positive length keeps the shares defined
    length = max(length_px, 1e-9)
    right = np.cos(np.radians(angle_deg)) * length / 2
    down = -np.sin(np.radians(angle_deg)) * length / 2
    if size_px < 1 or size_px % 2 == 0 or max(abs(right), abs(down)) > size_px / 2 + 1e-9:
        raise ValueError(f"kernel: got size {size_px} px for a line of {length_px} px, allowed: odd and large enough")
    centres = np.arange(size_px) - size_px // 2
    # the line is (right, down) s with s in [-1, 1]; each pixel cuts an interval of s per axis
    column_start, column_end = _inside(centres, right)
    row_start, row_end = _inside(centres, down)
    start = np.maximum(column_start[None, :], row_start[:, None])
    end = np.minimum(column_end[None, :], row_end[:, None])
    shares = np.clip(end - start, 0.0, None)
    return shares / shares.sum()


def kernel_of_path(size_px: int, offsets_px: np.ndarray) -> np.ndarray:
    """Return the kernel of a path as a picture, (size, size) float64: the share of the time inside each pixel; sum 1.

    `offsets_px` (n, 2), n >= 2: displacements (x right, y **down**) at equal steps of the exposure, joined by straight
    pieces; (0, 0), the place in the sharp picture, is the middle of the middle pixel. Convolving the sharp picture with
    it blurs. Raises ValueError if `size_px` is even or the path does not fit.
    """
    offsets = np.asarray(offsets_px, float)
    if offsets.ndim != 2 or offsets.shape[1] != 2 or len(offsets) < 2 or not np.all(np.isfinite(offsets)):
        raise ValueError(f"kernel_of_path: got offsets of shape {offsets.shape}, allowed: finite (n, 2), n >= 2")
    reach = float(np.abs(offsets).max())
    if size_px < 1 or size_px % 2 == 0 or reach > size_px / 2 + 1e-9:
        raise ValueError(f"kernel_of_path: got size {size_px} px, allowed: odd and at least {2 * reach:.4g} px")
    centres = np.arange(size_px) - size_px // 2
    result = np.zeros((size_px, size_px))
    for start, end in zip(offsets[:-1], offsets[1:], strict=True):
        (left, right), (top, bottom) = (_crossing(centres, one, other) for one, other in zip(start, end, strict=True))
        inside = np.minimum(right[None, :], bottom[:, None]) - np.maximum(left[None, :], top[:, None])
        result += np.clip(inside, 0.0, None)
    return result / result.sum()


def _crossing(centres: np.ndarray, start: float, end: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the interval of s in [0, 1] for which start + (end - start) s lies in each pixel of one axis."""
    if abs(end - start) < 1e-12:
        inside = centres == np.clip(np.floor(start + 0.5), centres[0], centres[-1])
        return np.where(inside, 0.0, 1.0), np.where(inside, 1.0, 0.0)
    bounds = (np.stack([centres - 0.5, centres + 0.5]) - start) / (end - start)
    return np.clip(bounds.min(axis=0), 0, 1), np.clip(bounds.max(axis=0), 0, 1)


def _inside(centres: np.ndarray, half_extent: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the interval of s in [-1, 1] for which half_extent * s lies in each pixel of one axis."""
    if abs(half_extent) < 1e-12:
        inside = centres == 0
        return np.where(inside, -1.0, 1.0), np.where(inside, 1.0, -1.0)
    bounds = np.stack([centres - 0.5, centres + 0.5]) / half_extent
    return np.clip(bounds.min(axis=0), -1, 1), np.clip(bounds.max(axis=0), -1, 1)


def _check(length_px: float, angle_deg: float) -> None:
    if not (np.isfinite(length_px) and length_px >= 0 and np.isfinite(angle_deg)):
        raise ValueError(f"motion blur: got length {length_px} px, angle {angle_deg} deg, allowed: finite, length >= 0")
