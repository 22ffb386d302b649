"""Total variation as the prior, by way of scikit-image's denoiser: edges stay sharp, texture is flattened a little.

Minimises |M (H f - g)|^2 / 2 + sigma^2 TV(f) / m by splitting off H f and f: a Fourier filter, a step pixel by pixel
that knows which pixels were seen, and the denoiser take turns. m, the mean gradient, is that of the `mmse` result,
scaled up to the root mean square gradient that the fitted texture has: nothing is left to tune. White pixels are masked
as in `mmse`.

Source: Venkatakrishnan, Bouman and Wohlberg, GlobalSIP 2013 (denoiser as prior); Almeida and Figueiredo, IEEE Trans.
Image Processing 22(8), 2013 (unknown boundary by splitting); Chambolle, J. Mathematical Imaging and Vision 20, 2004
(denoiser). The weight: greatest likelihood of the scale m of exp(-TV / m).
Valid: one blur for the whole picture.
"""

import numpy as np

from uwsim.motion_blur.deconvolution import (
    Canvas,
    blurred,
    channels_of_components,
    image_of,
    leaves_unchanged,
    weights_of_half,
)  # fmt: skip
from uwsim.motion_blur.estimate import Estimate
from uwsim.motion_blur.unknown_boundary import sharp_image

INPUT = "linear_float32"
NEEDS = ("blur",)

# of the two splittings: how hard H f and its copy pull at each other, and the mean gradients that the denoiser removes
_DATA_PULL = 0.3
_DENOISER_STEP = 1.0
_DENOISER_ITERATIONS = 10
# rounds until the change per pixel is below this share of the mean gradient, or this many
_LEAST_CHANGE = 2e-3
_MOST_ROUNDS = 40


def deblur(image: np.ndarray, *, blur: Estimate, spectrum: object = None) -> np.ndarray:
    """Return a linear image (H, W[, C]) in [0, 1] sharpened; unchanged where the blur is none.

    spectrum: noise and texture, as in `deconvolution.canvases_of`. ValueError for images without texture, of NaN, under
    16 px, mostly white.
    """
    if leaves_unchanged(image, blur, where="plug_and_play_tv"):
        return np.array(image)
    solved = sharp_image(image, blur=blur, spectrum=spectrum)
    parts = solved.parts.copy()
    for order, canvas in solved.canvases.items():
        parts[order] = _refined(parts[order], solved.known, canvas, solved.solutions[order].sharp)
    return image_of(channels_of_components(parts), image)


def _refined(part: np.ndarray, known: np.ndarray, canvas: Canvas, start: np.ndarray) -> np.ndarray:
    """Return a component (H, W) sharpened, from the Gaussian prior's result on its canvas (H', W')."""
    from scipy.fft import irfft2, rfft2
    from skimage.restoration import denoise_tv_chambolle

    height, width = part.shape
    mask, seen = (np.zeros(canvas.shape) for _ in range(2))
    mask[:height, :width], seen[:height, :width] = known, np.where(known, part, 0.0)
    gradient = _mean_gradient(start[:height, :width], canvas)
    pull = canvas.noise_std**2 / (gradient * _DENOISER_STEP * gradient)
    inverse = 1 / (_DATA_PULL * canvas.transfer**2 + pull)
    clean, smeared = start, blurred(start, canvas)
    blur_gap, clean_gap = np.zeros(canvas.shape), np.zeros(canvas.shape)
    for _ in range(_MOST_ROUNDS):
        right = _DATA_PULL * canvas.transfer * rfft2(smeared - blur_gap) + pull * rfft2(clean - clean_gap)
        spectrum = inverse * right
        picture, again = irfft2(spectrum, s=canvas.shape), irfft2(canvas.transfer * spectrum, s=canvas.shape)
        smeared = (seen + _DATA_PULL * (again + blur_gap)) / (mask + _DATA_PULL)
        before, clean = clean, denoise_tv_chambolle(
            picture + clean_gap, weight=_DENOISER_STEP * gradient, eps=1e-5, max_num_iter=_DENOISER_ITERATIONS
        )  # fmt: skip
        blur_gap = blur_gap + again - smeared
        clean_gap = clean_gap + picture - clean
        if np.sqrt(np.mean((clean - before)[:height, :width] ** 2)) < _LEAST_CHANGE * gradient:
            break
    return clean[:height, :width]


def _mean_gradient(picture: np.ndarray, canvas: Canvas) -> float:
    """Return the mean length of the sharp texture's gradient: rms of its density, times a picture's mean over rms."""
    down, right = np.diff(picture, axis=0)[:, :-1], np.diff(picture, axis=1)[:-1]
    squared = down**2 + right**2
    u, v = np.fft.rfftfreq(canvas.shape[1])[None, :], np.fft.fftfreq(canvas.shape[0])[:, None]
    density = canvas.texture_psd * (4 - 2 * np.cos(2 * np.pi * u) - 2 * np.cos(2 * np.pi * v))
    variance = float(np.sum(weights_of_half(canvas.shape) * density)) / np.prod(canvas.shape)
    return float(np.sqrt(squared).mean() / np.sqrt(squared.mean()) * np.sqrt(variance))
