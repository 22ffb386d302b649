"""The most likely sharp picture where only a part of the blurred one was seen: nothing is assumed about the rest.

With a sharp picture f that is Gaussian of density S_f, and g = M (H f + n) seen, n white noise of variance sigma^2, the
mean of f given g solves (H' M H + sigma^2 / S_f) f = H' M g, on a canvas that is larger than the picture and
repeats. M leaves out what lies beyond the border, and pixels at white.

Source: mean of a Gaussian given linear data: Kay, Fundamentals of Statistical Signal Processing I, 1993, section 10.6;
unknown boundary: Calvetti and Somersalo, Inverse Problems 21, 2005; preconditioned conjugate gradients: Golub and Van
Loan, Matrix Computations, section 11.5.
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
    weights_of_half,
    white_pixels,
    wiener_filtered,
)  # fmt: skip
from uwsim.motion_blur.estimate import Estimate
from uwsim.motion_blur.extension import harmonic_extension

# the solver's error is at most TOLERANCE of the standard deviation that the data leave open; noise below a thousandth of
# the contrast counts as that. Very smooth pictures without noise need thousands of steps for nothing that can be seen:
# after MOST_ITERATIONS an error of up to ACCEPTED is taken
TOLERANCE = 1e-3
MOST_ITERATIONS = 500
ACCEPTED = 0.03
_LEAST_NOISE_SHARE = 1e-3
# rounds of deciding which white pixels the result would darken
_ROUNDS = 4


class Solution(NamedTuple):
    """`sharp` (H', W') on the canvas; `residual`: root mean square of the preconditioned residual per seen pixel.

    The residual is in standard deviations of the sharp picture given the data.
    """

    sharp: np.ndarray
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
        height, width = self.known.shape
        result = harmonic_extension(self.parts, shape)
        for order, solution in self.solutions.items():
            result[order] = blurred(solution.sharp, self.canvases[order])
            result[order, :height, :width] = np.where(self.known, self.parts[order], result[order, :height, :width])
        return result


def sharp_image(image: np.ndarray, *, blur: Estimate, spectrum: object = None) -> SharpImage:
    """Return the most likely sharp picture of a linear image (H, W[, C]), on canvases.

    White pixels count as unseen, but they tell a lower bound: where the result would make one darker than it was seen,
    it counts as seen. spectrum: as in `deconvolution.canvases_of`.
    """
    channels = channels_of(image)
    parts = components_of(channels)
    canvases = canvases_of(parts, image, blur, spectrum)
    starts = {
        order: wiener_filtered(harmonic_extension(parts[order], canvas.shape), canvas)
        for order, canvas in canvases.items()
    }
    white = white_pixels(image)
    known = ~white
    for _ in range(_ROUNDS if white.any() else 1):
        solutions = {order: _solution(parts[order], known, canvas, starts[order]) for order, canvas in canvases.items()}
        starts = {order: solution.sharp for order, solution in solutions.items()}
        again = ~white | _darkened(channels, parts, canvases, starts)
        if np.array_equal(known, again):
            break
        known = again
    return SharpImage(parts, known, canvases, solutions)


def _darkened(channels, parts, canvases, sharp) -> np.ndarray:
    """Return where (H, W) each channel at white would be darker in the blurred result than it was seen."""
    height, width = channels.shape[1:]
    result = parts.copy()
    for order, canvas in canvases.items():
        result[order] = blurred(sharp[order], canvas)[:height, :width]
    return np.all((channels_of_components(result) < channels) | (channels < WHITE_FROM), axis=0)


def _solution(part: np.ndarray, known: np.ndarray, canvas: Canvas, start: np.ndarray) -> Solution:
    """Return the mean sharp picture of a component (H, W), its mean level that of the known pixels."""
    height, width = part.shape
    seen, mask = np.zeros(canvas.shape), np.zeros(canvas.shape, bool)
    level = part[known].mean()
    seen[:height, :width] = part - level
    mask[:height, :width] = known
    solution = posterior_mean(seen, mask, canvas, start=start - level)
    return solution._replace(sharp=solution.sharp + level)


def posterior_mean(
    seen: np.ndarray, known: np.ndarray, canvas: Canvas, *, start: np.ndarray, tolerance: float = TOLERANCE
) -> Solution:
    """Return the mean sharp picture (H', W') given the known pixels of a blurred one of mean 0, all on the canvas.

    Conjugate gradients in the frequency domain, preconditioned by the same system with all pixels known. `seen` may
    hold anything where `known` is false. start: first guess. Raises ValueError if 500 iterations come nowhere near.
    """
    from scipy.fft import irfft2, rfft2

    transfer, ridge = canvas.transfer, canvas.noise_std**2 / canvas.texture_psd
    preconditioner = 1 / (transfer**2 + ridge)
    weights = weights_of_half(canvas.shape) / seen.size

    def dot(one, other):
        return float(np.sum(weights * (one.real * other.real + one.imag * other.imag)))

    def system(spectrum):
        masked = np.where(known, irfft2(transfer * spectrum, s=canvas.shape), 0.0)
        return transfer * rfft2(masked) + ridge * spectrum

    spectrum = rfft2(start)
    residual = transfer * rfft2(np.where(known, seen, 0.0)) - system(spectrum)
    change = preconditioner * residual
    direction, size = change, dot(residual, change)
    noise = max(canvas.noise_std, _LEAST_NOISE_SHARE * float(seen[known].std()))
    scale, iterations = noise**2 * np.count_nonzero(known), 0
    while size > tolerance**2 * scale and iterations < MOST_ITERATIONS:
        image = system(direction)
        step = size / dot(direction, image)
        spectrum = spectrum + step * direction
        residual = residual - step * image
        change = preconditioner * residual
        previous, size = size, dot(residual, change)
        direction = change + size / previous * direction
        iterations += 1
    error = float(np.sqrt(size / scale))
    if error > max(ACCEPTED, tolerance):
        raise ValueError(
            f"unknown boundary: {iterations} iterations leave a residual of {error:.2g}, allowed: {ACCEPTED:g}; noise of "
            f"{canvas.noise_std:.3g} may be too little for this picture"
        )
    return Solution(irfft2(spectrum, s=canvas.shape), iterations, error)
