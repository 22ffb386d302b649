"""The most likely sharp picture where only a part of the blurred one was seen: nothing is assumed about the rest.

With a sharp picture f that is Gaussian of density S_f, and g = M (H f + n) seen, n white noise of variance sigma^2, the
mean of f given g solves (H' M H + sigma^2 / S_f) f = H' M g, on a canvas that is larger than the picture and
repeats. M leaves out what lies beyond the border, and pixels at white.

If all of g were known, f would be the Wiener filter of it. So only the unseen pixels of g are unknown: with the filter
W = H^2 / (H^2 + sigma^2 / S_f), which smooths a picture to the likely H f, they have to be what W makes of the whole:
(1 - W) g = 0 there. That is the same system with the seen pixels eliminated, solved by conjugate gradients.

Source: mean of a Gaussian given linear data: Kay, Fundamentals of Statistical Signal Processing I, 1993, section 10.6;
unknown boundary: Calvetti and Somersalo, Inverse Problems 21, 2005; conjugate gradients, and correction of a solution
found in single precision: Golub and Van Loan, Matrix Computations, sections 11.3 and 3.5.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from uwsim.motion_blur.deconvolution import (
    WHITE_FROM,
    Canvas,
    blurred,
    canvases_of,
    channels_of,
    channels_of_components,
    components_of,
    white_pixels,
)  # fmt: skip
from uwsim.motion_blur.estimate import Estimate
from uwsim.motion_blur.extension import harmonic_extension

# the largest residual. Very smooth pictures without noise need thousands of steps for nothing that can be seen: after
# MOST_ITERATIONS up to ACCEPTED is taken
TOLERANCE = 1e-3
MOST_ITERATIONS = 500
ACCEPTED = 0.03
# noise below this share of the contrast counts as that: pictures of 8 bits have more, and less takes ever more steps
LEAST_NOISE_SHARE = 1e-3
# rounds of deciding which white pixels the result would darken
_ROUNDS = 4


class Solution(NamedTuple):
    """`sharp` (H', W') on the canvas; `filled` (H', W'): the blurred picture as seen, and what is likely elsewhere.

    `residual`: what the filter W changes in the unseen pixels of `filled`, root of the sum of squares per seen pixel,
    in standard deviations of the noise.
    """

    sharp: np.ndarray
    filled: np.ndarray
    iterations: int
    residual: float


@dataclass(frozen=True)
class SharpImage:
    """The sharp picture of an image: its components as seen (C, H, W), `known` (H, W): pixels that count, and by number
    of the component its canvas and its solution; flat components have none.
    """

    parts: np.ndarray
    known: np.ndarray
    canvases: dict[int, Canvas]
    solutions: dict[int, Solution]

    def continued(self) -> np.ndarray:
        """Return the components on the canvas (C, H', W'): as seen, and what is likely where nothing was seen."""
        if not self.canvases:
            return self.parts.copy()
        shape = next(iter(self.canvases.values())).shape
        result = harmonic_extension(self.parts, shape)
        for order, solution in self.solutions.items():
            result[order] = solution.filled
        return result


def sharp_image(image: np.ndarray, *, blur: Estimate, spectrum: object = None) -> SharpImage:
    """Return the most likely sharp picture of a linear image (H, W[, C]), on canvases.

    White pixels count as unseen, but they tell a lower bound: where the result would make one darker than it was seen,
    it counts as seen. spectrum: as in `deconvolution.canvases_of`.
    """
    channels = channels_of(image)
    parts = components_of(channels)
    canvases = canvases_of(parts, image, blur, spectrum)
    filled = {order: harmonic_extension(parts[order], canvas.shape) for order, canvas in canvases.items()}
    white = white_pixels(image)
    known = ~white
    for _ in range(_ROUNDS if white.any() else 1):
        solutions = {order: _solution(parts[order], known, canvas, filled[order]) for order, canvas in canvases.items()}
        filled = {order: solution.filled for order, solution in solutions.items()}
        again = ~white | _darkened(channels, parts, canvases, solutions)
        if np.array_equal(known, again):
            break
        known = again
    return SharpImage(parts, known, canvases, solutions)


def _darkened(channels, parts, canvases, solutions) -> np.ndarray:
    """Return where (H, W) each channel at white would be darker in the blurred result than it was seen."""
    height, width = channels.shape[1:]
    result = parts.copy()
    for order, canvas in canvases.items():
        result[order] = blurred(solutions[order].sharp, canvas)[:height, :width]
    return np.all((channels_of_components(result) < channels) | (channels < WHITE_FROM), axis=0)


def _solution(part: np.ndarray, known: np.ndarray, canvas: Canvas, filled: np.ndarray) -> Solution:
    """Return the mean sharp picture of a component (H, W), its mean level that of the known pixels.

    filled (H', W'): first guess of the component on the canvas, where it is not known.
    """
    height, width = part.shape
    everywhere, mask = filled.copy(), np.zeros(canvas.shape, bool)
    mask[:height, :width] = known
    everywhere[:height, :width][known] = part[known]
    level = part[known].mean()
    noise_std = max(canvas.noise_std, LEAST_NOISE_SHARE * float(part[known].std()))
    solution = posterior_mean(everywhere - level, mask, canvas._replace(noise_std=noise_std))
    return solution._replace(sharp=solution.sharp + level, filled=solution.filled + level)


def posterior_mean(filled: np.ndarray, known: np.ndarray, canvas: Canvas, *, tolerance: float = TOLERANCE) -> Solution:
    """Return the mean sharp picture (H', W') given the known pixels of a blurred one of mean 0, all on the canvas.

    `filled` holds a first guess where `known` is false. Transforms in single precision, the residual of what they find
    in double. Raises ValueError if 500 iterations come nowhere near.
    """
    from scipy.fft import irfft2, rfft2

    power, ridge = canvas.transfer**2, canvas.noise_std**2 / canvas.texture_psd
    roughness = ridge / (power + ridge)  # 1 - W
    filled, unseen = filled.copy(), np.flatnonzero(~known)
    scale = canvas.noise_std**2 * np.count_nonzero(known)
    iterations = 0
    while True:
        spectrum = rfft2(filled)
        residual = -irfft2(roughness * spectrum, s=canvas.shape).ravel()[unseen]
        error = float(np.sqrt(np.sum(residual**2) / scale))
        if error <= tolerance or iterations >= MOST_ITERATIONS:
            break
        # single precision gains three digits at a time for sure
        target = max(tolerance / error, 1e-3)
        correction, steps = _correction(residual, roughness, unseen, canvas.shape, target, MOST_ITERATIONS - iterations)
        filled.ravel()[unseen] += correction
        iterations += steps
    if error > max(ACCEPTED, tolerance):
        raise ValueError(
            f"unknown boundary: {iterations} iterations leave a residual of {error:.2g}, allowed: {ACCEPTED:g}; noise "
            f"of {canvas.noise_std:.3g} may be too little for this picture"
        )
    sharp = irfft2(canvas.transfer / (power + ridge) * spectrum, s=canvas.shape)
    return Solution(sharp, filled, iterations, error)


def _correction(
    residual: np.ndarray, roughness: np.ndarray, unseen: np.ndarray, shape: tuple[int, int], target: float, most: int
) -> tuple[np.ndarray, int]:
    """Return what to add to the unseen pixels (n,) so that `target` of their residual is left, and the iterations."""
    from scipy.fft import irfft2, rfft2

    # residuals may be as small as the square of what single precision holds: scaled to 1
    unit = float(np.sqrt(np.mean(residual**2)))
    roughness, residual = roughness.astype(np.float32), (residual / unit).astype(np.float32)
    picture, found, direction = np.zeros(shape, np.float32), np.zeros_like(residual), residual.copy()
    size = _dot(residual, residual)
    enough, iterations = target**2 * size, 0
    while size > enough and iterations < most:
        np.put(picture, unseen, direction)
        spectrum = rfft2(picture)
        spectrum *= roughness
        image = np.take(irfft2(spectrum, s=shape, overwrite_x=True), unseen)
        step = np.float32(size / _dot(direction, image))
        found += step * direction
        image *= step
        residual -= image
        previous, size = size, _dot(residual, residual)
        direction *= np.float32(size / previous)
        direction += residual
        iterations += 1
    return unit * found.astype(float), iterations


def _dot(one: np.ndarray, other: np.ndarray) -> float:
    return float(np.sum(one * other, dtype=float))
