"""Call an algorithm with what it may see, time the call, and check what comes back."""

import importlib
import time
from collections.abc import Callable, Mapping
from types import ModuleType

import numpy as np

from uwsim.discovery import missing_packages
from uwsim.images import linear_from_srgb_uint8, srgb_uint8_from_linear

KINDS = ("srgb_uint8", "linear_float32")
Makers = Mapping[str, Callable[[], object]]


class NotInFrame(ValueError):
    """A frame does not have an input that benchmarks can give: the text, one line, says which and why."""


def needs(module: ModuleType, name: str, known: tuple[str, ...]) -> tuple[str, ...]:
    """Return the NEEDS of an algorithm file; ValueError unless each is a known input of the benchmark."""
    wanted = getattr(module, "NEEDS", ())
    if not isinstance(wanted, tuple | list) or not all(isinstance(item, str) for item in wanted):
        raise ValueError(f"{name}: NEEDS is {wanted!r}, allowed: a tuple of names out of {', '.join(known)}")
    unknown = [item for item in wanted if item not in known]
    if unknown:
        raise ValueError(f"{name}: NEEDS has {', '.join(unknown)}, allowed: {', '.join(known)}")
    return tuple(wanted)


def input_kind(module: ModuleType, name: str) -> str:
    """Return the INPUT of an image method ("srgb_uint8" where it states none)."""
    kind = getattr(module, "INPUT", "srgb_uint8")
    if kind not in KINDS:
        raise ValueError(f"{name}: INPUT is {kind!r}, allowed: {', '.join(KINDS)}")
    return kind


def entry(module: ModuleType, name: str, function: str) -> Callable:
    """Return the function that the file must define; ValueError if it does not."""
    found = getattr(module, function, None)
    if not callable(found):
        raise ValueError(f"{name}: the file defines no function {function}(), which this benchmark calls")
    return found


def prepare(module: ModuleType) -> list[str]:
    """Import the optional packages of an algorithm (not to be timed); return those that are not installed."""
    missing = missing_packages(module)
    for package in set(getattr(module, "REQUIRES", ())) - set(missing):
        importlib.import_module(package)
    return missing


def permitted(wanted: tuple[str, ...], makers: Makers) -> dict[str, object]:
    """Return the inputs that were asked for in NEEDS, made anew, and no others; NotInFrame where one is not there."""
    return {name: own(makers[name]()) for name in wanted}


def own(value: object) -> object:
    """Return a copy whose arrays share no memory with the truth (not even by way of `.base`)."""
    if isinstance(value, np.ndarray):
        return np.array(value, order="C", copy=True)
    if isinstance(value, dict):
        return {key: own(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        items = [own(item) for item in value]
        return value._make(items) if hasattr(value, "_make") else type(value)(items)
    return value


def timed(function: Callable, *arguments, where: str, **inputs) -> tuple[object, float]:
    """Return (what the function returns, milliseconds of the call alone).

    Raises ValueError in one line, beginning with `where`, whatever the function raises.
    """
    try:
        start = time.perf_counter()
        output = function(*arguments, **inputs)
        elapsed_ms = 1e3 * (time.perf_counter() - start)
    except (Exception, SystemExit) as error:
        text = " ".join(str(error).split())
        raise ValueError(f"{where}: {type(error).__name__}: {text}") from error
    return output, elapsed_ms


def image_call(
    module: ModuleType, name: str, function: str, *, image: np.ndarray, wanted: tuple[str, ...],
    makers: Makers, where: str,
) -> tuple[object, float]:  # fmt: skip
    """Call an image method on the picture (H, W, 3), converted to its INPUT: stored as uint8 sRGB, or float32 linear.

    Returns (output, milliseconds). Raises ValueError if the method raises or writes into its input, NotInFrame for an
    input that is not there.
    """
    kind = input_kind(module, name)
    converted = _converted(image, kind)
    before = converted.copy()
    inputs = permitted(wanted, makers)
    output, elapsed_ms = timed(entry(module, name, function), converted, where=where, **inputs)
    if not np.array_equal(converted, before):
        raise ValueError(f"{where}: the input image was modified; a method returns a new image")
    return output, elapsed_ms


def _converted(image: np.ndarray, kind: str) -> np.ndarray:
    """Return a copy of a picture, uint8 sRGB or float32 linear, as the kind that is wanted."""
    if (image.dtype == np.uint8) == (kind == "srgb_uint8"):
        return own(image)
    return srgb_uint8_from_linear(image) if kind == "srgb_uint8" else linear_from_srgb_uint8(image)


def checked_linear(output: object, *, kind: str, shape: tuple[int, ...], where: str) -> np.ndarray:
    """Return a restored picture as float32 linear; ValueError unless kind, shape and range are the input's."""
    checked_picture(output, kind=kind, shape=shape, where=where)
    return _converted(output, "linear_float32")


def checked_picture(output: object, *, kind: str, shape: tuple[int, ...], where: str) -> np.ndarray:
    """Return a restored picture as 8-bit sRGB; ValueError unless kind, shape and range are the input's."""
    dtype = np.dtype("uint8" if kind == "srgb_uint8" else "float32")
    if not isinstance(output, np.ndarray):
        raise ValueError(f"{where}: returned {type(output).__name__}, allowed: an array {shape} of {dtype}")
    if output.dtype != dtype or output.shape != shape:
        raise ValueError(f"{where}: returned {output.shape} of {output.dtype}, allowed: {shape} of {dtype}")
    if kind == "srgb_uint8":
        return output
    if not np.all(np.isfinite(output)):
        raise ValueError(f"{where}: returned {np.sum(~np.isfinite(output))} non-finite values, allowed: finite")
    low, high = float(output.min()), float(output.max())
    if low < 0 or high > 1:
        raise ValueError(f"{where}: returned values {low:.4g} to {high:.4g}, allowed: 0 to 1")
    return srgb_uint8_from_linear(output)
