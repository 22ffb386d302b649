"""The most likely sharp picture given the pixels that were seen, with no assumption about those that were not.

Beyond the border, and where the picture is white, the light is unknown: the prior, the texture's spectrum, bridges it.
The reference among the linear deconvolvers.

Source: least mean squared error with an unknown boundary, see `unknown_boundary`.
Valid: one blur for the whole picture; texture much the same all over it.
"""

import numpy as np

from uwsim.motion_blur.deconvolution import channels_of_components, image_of, leaves_unchanged
from uwsim.motion_blur.estimate import Estimate
from uwsim.motion_blur.unknown_boundary import sharp_image

INPUT = "linear_float32"
NEEDS = ("blur",)


def deblur(image: np.ndarray, *, blur: Estimate, spectrum: object = None) -> np.ndarray:
    """Return a linear image (H, W[, C]) in [0, 1] sharpened; unchanged where the blur is none.

    spectrum: noise and texture, as in `deconvolution.canvases_of`. ValueError for images without texture, of NaN, under
    16 px, mostly white.
    """
    if leaves_unchanged(image, blur, where="mmse"):
        return np.array(image)
    solved = sharp_image(image, blur=blur, spectrum=spectrum)
    parts = solved.parts.copy()
    for order, solution in solved.solutions.items():
        parts[order] = solution.sharp[: parts.shape[1], : parts.shape[2]]
    return image_of(channels_of_components(parts), image)
