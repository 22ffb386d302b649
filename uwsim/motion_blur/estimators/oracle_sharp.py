"""The blur between the frame and its sharp twin: an oracle, the score that an estimator could reach.

Least squares fit of (length, angle) with a free gain and offset, blurred twin against frame: first on a grid
over the low frequencies, where the exact transfer function is real and the fit has a closed form, then by
Gauss-Newton steps on the pixels that the border cannot reach.

Source: maximum likelihood of the model g = gain h * f + offset + white noise with known f; Kay, Fundamentals
of Statistical Signal Processing I, 1993, section 8.9.
"""

import numpy as np

from uwsim.motion_blur.estimate import Estimate, estimate_from_vector, grey_from_image, longest_length_px

INPUT = "linear_float32"
NEEDS = ("sharp",)

GRID_ANGLE_DEG = 5.0
_GRID_LENGTHS_PER_PX = 1
_GRID_FREQUENCIES = 3000
_TINY = np.finfo(float).tiny


def estimate(image: np.ndarray, *, sharp: np.ndarray) -> Estimate:
    """Return the blur that turns `sharp` (H, W, 3) into `image` (H, W, 3), both linear, in any units.

    Lengths up to 40 px (less than half a side of small images). ValueError for images that are constant, not
    finite, under 16 px, or of different size.
    """
    frame = grey_from_image(image, where="oracle_sharp image")
    twin = grey_from_image(sharp, where="oracle_sharp sharp")
    if frame.shape != twin.shape:
        raise ValueError(f"oracle_sharp: sharp is {twin.shape}, allowed: the size of the image, {frame.shape}")
    right_px, up_px = _refine(frame, twin, *_best_on_grid(frame, twin))
    return estimate_from_vector(right_px, up_px)


def _best_on_grid(frame: np.ndarray, twin: np.ndarray) -> tuple[float, float]:
    """Return the (right, up) displacement [px] of the best grid point, from windowed spectra."""
    window = np.hanning(frame.shape[0])[:, None] * np.hanning(frame.shape[1])[None, :]
    frame_spectrum, twin_spectrum = (
        np.fft.fft2(window * (grey - (window * grey).sum() / window.sum())) for grey in (frame, twin)
    )
    u, v = np.meshgrid(np.fft.fftfreq(frame.shape[1]), np.fft.fftfreq(frame.shape[0]))
    half = ((v > 0) | ((v == 0) & (u > 0))).ravel()
    strongest = np.argsort(np.where(half, np.abs(twin_spectrum).ravel() ** 2, -1.0))[-_GRID_FREQUENCIES:]
    strongest = strongest[half[strongest]]
    cross = (np.conj(twin_spectrum) * frame_spectrum).real.ravel()[strongest]
    power = np.abs(twin_spectrum).ravel()[strongest] ** 2
    u, v = u.ravel()[strongest], v.ravel()[strongest]

    lengths = np.arange(0, longest_length_px(frame.shape) + 1e-9, 1 / _GRID_LENGTHS_PER_PX)
    best, best_gain = (0.0, 0.0), -np.inf
    for angle in np.radians(np.arange(0, 180, GRID_ANGLE_DEG)):
        transfer = np.sinc(lengths[:, None] * (u * np.cos(angle) - v * np.sin(angle)))
        # what the best positive gain removes from the sum of squares
        explained = np.maximum(transfer @ cross, 0) ** 2 / np.maximum(transfer**2 @ power, _TINY)
        index = int(np.argmax(explained))
        if explained[index] > best_gain:
            best_gain = explained[index]
            best = lengths[index] * np.cos(angle), lengths[index] * np.sin(angle)
    return best


def _refine(frame: np.ndarray, twin: np.ndarray, right_px: float, up_px: float) -> tuple[float, float]:
    """Return the displacement after least squares on the inner pixels, starting at (right, up) [px]."""
    from scipy.optimize import least_squares

    limit_px = longest_length_px(frame.shape)
    margin = int(np.ceil(limit_px / 2)) + 1
    inner = (slice(margin, -margin), slice(margin, -margin))
    spectrum = np.fft.fft2(twin - twin.mean())
    u, v = np.fft.fftfreq(frame.shape[1])[None, :], np.fft.fftfreq(frame.shape[0])[:, None]
    observed = frame[inner] - frame[inner].mean()

    def blurred(transfer: np.ndarray) -> np.ndarray:
        picture = np.fft.ifft2(spectrum * transfer).real[inner]
        return picture - picture.mean()

    def residuals(parameters: np.ndarray) -> np.ndarray:
        model = blurred(np.sinc(parameters[0] * u - parameters[1] * v))
        return (parameters[2] * model - observed).ravel()

    def derivatives(parameters: np.ndarray) -> np.ndarray:
        along = parameters[0] * u - parameters[1] * v
        slope = _sinc_slope(along)
        columns = (
            parameters[2] * blurred(slope * u),
            -parameters[2] * blurred(slope * v),
            blurred(np.sinc(along)),
        )
        return np.stack([column.ravel() for column in columns], axis=1)

    # at length 0 the slope vanishes in every direction: start beside it
    if np.hypot(right_px, up_px) < 0.5:
        right_px, up_px = 0.5, 0.25
    start = blurred(np.sinc(right_px * u - up_px * v))
    energy = float((start**2).sum())
    if energy <= _TINY or float((observed**2).sum()) <= _TINY:
        # no texture inside: the grid, which saw the borders too, has the last word
        return right_px, up_px
    gain = float((start * observed).sum()) / energy
    fit = least_squares(residuals, (right_px, up_px, gain), jac=derivatives, x_scale="jac", max_nfev=30)
    length_px = np.hypot(*fit.x[:2])
    shrink = min(1.0, limit_px / length_px) if length_px > 0 else 1.0
    return fit.x[0] * shrink, fit.x[1] * shrink


def _sinc_slope(x: np.ndarray) -> np.ndarray:
    """Return the derivative of sin(pi x) / (pi x)."""
    small = np.abs(x) < 1e-4
    safe = np.where(small, 1.0, x)
    return np.where(small, -(np.pi**2) * x / 3, (np.cos(np.pi * safe) - np.sinc(safe)) / safe)
