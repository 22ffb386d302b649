"""The Wiener filter: the best linear estimate of the sharp picture where the blur is the same everywhere.

Noise and texture come from the blur's estimate, or from a fit to the picture. The cheapest of the deconvolvers, and the
one that the picture's border hurts most: long blurs without noise ring from there, see `mmse`.

Source: dissertation eq. (4.4); Wiener, Extrapolation, Interpolation and Smoothing of Stationary Time Series, 1949.
Valid: no saturated pixels: they are not masked, and ring.
Errata: (4.4) is introduced as the estimate of the kernel; it estimates the picture, given the kernel. H is the transfer
function of the kernel, S_n and S_f are densities that have to be known, gamma other than 1 is not the least error, and
the Fourier transform takes the picture to repeat: it is continued here so that it does.
"""

import numpy as np

from uwsim.motion_blur.deconvolution import (
    canvases_of,
    channels_of,
    channels_of_components,
    components_of,
    image_of,
    leaves_unchanged,
    wiener_filtered,
)  # fmt: skip
from uwsim.motion_blur.estimate import Estimate
from uwsim.motion_blur.extension import harmonic_extension

INPUT = "linear_float32"
NEEDS = ("blur",)


def deblur(image: np.ndarray, *, blur: Estimate, gamma: float = 1.0, spectrum: object = None) -> np.ndarray:
    """Return a linear image (H, W[, C]) in [0, 1] sharpened; unchanged where the blur is none.

    gamma: weight of the noise, 1 for the least squared error, more for smoother pictures. spectrum: noise and texture,
    as in `deconvolution.canvases_of`. ValueError for images without texture, of NaN, under 16 px, mostly white.
    """
    if not (np.isfinite(gamma) and gamma > 0):
        raise ValueError(f"wiener: got gamma {gamma}, allowed: above 0")
    if leaves_unchanged(image, blur, where="wiener"):
        return np.array(image)
    parts = components_of(channels_of(image))
    height, width = parts.shape[1:]
    for order, canvas in canvases_of(parts, image, blur, spectrum).items():
        extended = harmonic_extension(parts[order], canvas.shape)
        parts[order] = wiener_filtered(extended, canvas, gamma=gamma)[:height, :width]
    return image_of(channels_of_components(parts), image)
