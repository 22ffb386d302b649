"""Continue a picture beyond its border so that it repeats without a seam, as a Fourier transform takes it to do."""

import numpy as np


def canvas_shape(shape: tuple[int, int], *, reach_px: tuple[float, float], spare_px: int) -> tuple[int, int]:
    """Return (rows, columns) of a canvas with room for blur and change-over beyond the picture, good for FFTs.

    reach_px: extent of the blur along (rows, columns); spare_px: further pixels along each.
    """
    from scipy.fft import next_fast_len

    return tuple(
        next_fast_len(side + int(np.ceil(reach)) + spare_px, real=True)
        for side, reach in zip(shape, reach_px, strict=True)
    )


def harmonic_extension(pictures: np.ndarray, canvas: tuple[int, int]) -> np.ndarray:
    """Return pictures (..., H, W) continued to canvases (..., H', W') that repeat smoothly, the picture top left.

    The new pixels solve Laplace's equation (each the mean of its four neighbours) between opposite borders of the
    picture, which meet as the canvas repeats; no flux leaves the bands beside the picture sideways, so that fine detail
    of the border fades away from it. Raises ValueError if the canvas is smaller than the picture.

    Source: after Liu and Jia, ICIP 2008 (deconvolution on a tile that repeats smoothly); separation of variables here.
    """
    height, width = pictures.shape[-2:]
    rows, columns = canvas[0] - height, canvas[1] - width
    if rows < 0 or columns < 0:
        raise ValueError(f"harmonic_extension: got canvas {canvas}, allowed: {(height, width)} at least")
    below = _between(pictures[..., -1, :], pictures[..., 0, :], rows, free_sides=True)
    beside = _between(pictures[..., :, -1], pictures[..., :, 0], columns, free_sides=True)
    corner = _between(beside[..., -1], beside[..., 0], rows, free_sides=False)
    corner = corner + np.swapaxes(_between(below[..., -1], below[..., 0], columns, free_sides=False), -1, -2)
    beside = np.swapaxes(beside, -1, -2)
    return np.concatenate([np.concatenate([pictures, beside], -1), np.concatenate([below, corner], -1)], -2)


def _between(first: np.ndarray, last: np.ndarray, count: int, *, free_sides: bool) -> np.ndarray:
    """Return the `count` rows (..., count, n) of a harmonic function between two given rows (..., n).

    At the sides either nothing flows (`free_sides`) or the function is 0.
    """
    from scipy.fft import dct, dst, idct, idst

    forward, backward, kind = (dct, idct, 2) if free_sides else (dst, idst, 1)
    size = first.shape[-1]
    if size == 0 or count == 0:
        return np.zeros((*first.shape[:-1], count, size))
    order = np.arange(size) if free_sides else np.arange(1, size + 1) * size / (size + 1)
    # row by row each mode obeys a[j - 1] - 2 cosh(k) a[j] + a[j + 1] = 0
    decay = np.arccosh(2 - np.cos(np.pi * order / size))
    step = np.arange(1, count + 1)[:, None]
    if free_sides:
        decay[0] = 1.0  # mode 0 is not exponential but a straight line: set below
    weight = np.exp(-step * decay) * np.expm1(-2 * (count + 1 - step) * decay) / np.expm1(-2 * (count + 1) * decay)
    if free_sides:
        weight[:, 0] = 1 - step[:, 0] / (count + 1)
    modes = weight * forward(first, kind)[..., None, :] + weight[::-1] * forward(last, kind)[..., None, :]
    return backward(modes, kind)
