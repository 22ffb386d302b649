"""A deconvolver on a stored picture, in the way that the estimate of its blur calls for."""

from types import ModuleType, SimpleNamespace

import numpy as np

from uwsim.bench import runner
from uwsim.images import linear_from_srgb_uint8
from uwsim.motion_blur import undo
from uwsim.motion_blur.undo import Way

ESTIMATOR, DECONVOLVER = "whittle", "mmse"
"""Whose word on the blur counts, and who undoes it, where none is named."""


def way_of(module: ModuleType, name: str, *, image: np.ndarray, blur: object, blur_from: str) -> Way:
    """Return how a deconvolver undoes the blur of an 8-bit picture: by tiles only if `whittle` says so."""
    if blur_from == ESTIMATOR and runner.input_kind(module, name) == "linear_float32":
        return undo.by_verdict(linear_from_srgb_uint8(image), blur)
    return undo.one_blur(blur)


def undone(
    module: ModuleType, name: str, given: tuple[str, ...], *, image: np.ndarray, way: Way, where: str
) -> tuple[np.ndarray, float]:
    """Return (the picture (H, W, 3) uint8 after the deconvolver, milliseconds of the call; 0 where it is left alone).

    given: ("blur",), or () for a method that asks for no blur; it sees every picture as a whole.
    """
    if given and way.how == undo.LEFT_ALONE:
        return np.array(image), 0.0
    kind, call = runner.input_kind(module, name), module
    if given and way.field is not None:
        call = SimpleNamespace(INPUT=kind, deblur=lambda image, *, blur: way.apply(image, module.deblur))
    output, elapsed_ms = runner.image_call(
        call, name, "deblur", image=image, wanted=given, makers={"blur": lambda: way.blur}, where=where
    )
    return runner.checked_picture(output, kind=kind, shape=image.shape, where=where), elapsed_ms
