"""Multi-part EXR: one named part per truth image, ZIP compressed."""

import contextlib
import io
from pathlib import Path

import numpy as np

from uwsim.files import no_stderr, write_atomically

_TYPES = {"half": np.float16, "float": np.float32, "uint": np.uint32}
_CHANNELS = {1: ("Y",), 2: ("X", "Y"), 3: ("R", "G", "B")}
_HALF_MAX = 65504.0


def write(path: Path, parts: dict[str, tuple[np.ndarray, str]]) -> None:
    """Write `{name: (image (H, W) or (H, W, C), "half" | "float" | "uint")}` as one EXR, atomically.

    Raises ValueError if a value does not fit the half range.
    """
    import OpenEXR

    made = []
    for name, (image, kind) in parts.items():
        layers = np.atleast_3d(image)
        finite = layers[np.isfinite(layers)] if kind == "half" else ()
        if len(finite) and np.abs(finite).max() > _HALF_MAX:
            raise ValueError(f"EXR {path}: {name} exceeds the half-float range ({np.abs(finite).max():.3g})")
        channels = {
            channel: np.ascontiguousarray(layers[..., index].astype(_TYPES[kind]))
            for index, channel in enumerate(_CHANNELS[layers.shape[2]])
        }
        header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
        made.append(OpenEXR.Part(header, channels, name))
    write_atomically(path, lambda temporary: OpenEXR.File(made).write(str(temporary)))


def read(path: Path) -> dict[str, np.ndarray]:
    """Read all parts of an EXR: (H, W) or (H, W, C), float32 (uint stays uint32).

    Raises ValueError in one line if the file is missing, truncated or no EXR.
    """
    import OpenEXR

    path = Path(path)
    if not path.is_file():
        raise ValueError(f"{path}: no such EXR file")
    try:
        with no_stderr(), contextlib.redirect_stdout(io.StringIO()) as said:
            parts = OpenEXR.File(str(path), separate_channels=True).parts
        if said.getvalue():  # the library warns of parts that it cannot read and leaves them out
            raise ValueError(said.getvalue().splitlines()[0])
        return {part.name(): _image(part) for part in parts}
    except (RuntimeError, TypeError, KeyError, ValueError) as error:
        text = " ".join(str(error).split()) or type(error).__name__
        raise ValueError(f"{path}: not a readable EXR (truncated?): {text}") from None


def _image(part) -> np.ndarray:
    planes = {name: channel.pixels for name, channel in part.channels.items()}
    if any(plane is None for plane in planes.values()):
        raise ValueError(f"part {part.name()!r} has no pixels")
    order = _CHANNELS[len(planes)]
    image = np.stack([planes[name] for name in order], axis=-1)
    image = image[..., 0] if len(order) == 1 else image
    return image if image.dtype == np.uint32 else image.astype(np.float32)
