"""Wiener filter whose noise and smoothness are drawn from the picture by a Gibbs sampler: scikit-image's.

scikit-image takes the picture to repeat and to have no mean, and wants a kernel: it is given the picture with the mean
taken off, continued by what is likely beyond its border and where it is white (see `unknown_boundary`), and the exact
transfer function. Its prior is the Laplacian's: texture that falls as 1 / r^4.

Source: Orieux, Giovannelli and Rodet, J. Optical Society of America A 27, 2010; scikit-image `unsupervised_wiener`.
Valid: one blur for the whole picture.
"""

import numpy as np

from uwsim.motion_blur.deconvolution import channels_of_components, image_of, leaves_unchanged
from uwsim.motion_blur.estimate import Estimate
from uwsim.motion_blur.unknown_boundary import sharp_image

INPUT = "linear_float32"
NEEDS = ("blur",)


def deblur(image: np.ndarray, *, blur: Estimate, seed: int = 0, spectrum: object = None) -> np.ndarray:
    """Return a linear image (H, W[, C]) in [0, 1] sharpened; unchanged where the blur is none.

    seed: of the sampler. spectrum: for the continuation only, as in `deconvolution.canvases_of`. ValueError for images
    without texture, of NaN, under 16 px, mostly white.
    """
    from skimage.restoration import unsupervised_wiener

    if leaves_unchanged(image, blur, where="unsupervised_wiener"):
        return np.array(image)
    rng = np.random.default_rng(seed)
    solved = sharp_image(image, blur=blur, spectrum=spectrum)
    continued, parts = solved.continued(), solved.parts.copy()
    for order, canvas in solved.canvases.items():
        mean = continued[order].mean()
        sharp, _ = unsupervised_wiener(continued[order] - mean, canvas.transfer, clip=False, rng=rng)
        parts[order] = sharp[: parts.shape[1], : parts.shape[2]] + mean
    return image_of(channels_of_components(parts), image)
