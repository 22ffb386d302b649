"""One frame on disk: image.png, frame.exr (the truth as float images), frame.json (the truth as numbers).

And raw16.png, the output of the ADC, where the scene asks for it.
"""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from uwsim import images
from uwsim.dataset import exr
from uwsim.dataset.info import FrameInfo
from uwsim.files import read_json, write_json
from uwsim.validation import validated

FORMAT_VERSION = 1
FILES = ("image.png", "frame.exr", "frame.json")
RAW = "raw16.png"

# name -> (channels, EXR sample type); FORMAT.md says what each holds
BUFFERS = {
    "radiance": (3, "float"),
    "direct": (3, "float"),
    "forward_scatter": (3, "float"),
    "backscatter": (3, "float"),
    "water_free": (3, "float"),
    "transmission": (3, "float"),
    "standard_error": (3, "float"),
    "range": (1, "float"),
    "z_depth": (1, "float"),
    "normal": (3, "half"),
    "albedo": (3, "half"),
    "instance": (1, "uint"),
    "sharp": (3, "float"),
    "flow_start": (2, "half"),
    "flow_end": (2, "half"),
    "direct_unscattered": (3, "float"),
    "backscatter_single": (3, "float"),
}
MOTION = ("sharp", "flow_start", "flow_end")
ORDERS = ("direct_unscattered", "backscatter_single")
REQUIRED = tuple(name for name in BUFFERS if name not in (*MOTION, *ORDERS))


@dataclass(frozen=True)
class Frame:
    """A frame that lies in `folder`; pictures are read when asked for."""

    folder: Path
    info: FrameInfo

    @property
    def name(self) -> str:
        return self.info.name

    @cached_property
    def image(self) -> np.ndarray:
        """What the camera stores, (H, W, 3) uint8 sRGB."""
        return images.read_srgb(self.folder / "image.png")

    @cached_property
    def raw(self) -> np.ndarray:
        """The output of the ADC, uint16 [DN]: (H, W) with a mosaic, (H, W, 3) without; ValueError if it has none."""
        if not self.info.sensor.raw:
            raise ValueError(f"{self.folder}: no {RAW}; a scene asks for it with sensor.raw = true")
        return images.read_uint16(self.folder / RAW)

    @cached_property
    def _buffers(self) -> dict[str, np.ndarray]:
        return exr.read(self.folder / "frame.exr")

    @property
    def buffer_names(self) -> tuple[str, ...]:
        return tuple(self._buffers)

    def buffer(self, name: str) -> np.ndarray:
        """Return one truth image, (H, W) or (H, W, C) float32 (`instance`: uint32).

        Raises ValueError naming the buffers that the frame has.
        """
        if name not in self._buffers:
            raise ValueError(f"{self.folder}: no buffer {name!r}; it has {', '.join(self._buffers)}")
        return self._buffers[name]

    @property
    def K(self) -> np.ndarray:
        """Camera matrix (3, 3) [px], pixel centres at integer + 0.5."""
        return np.array(self.info.camera.K)

    @property
    def world_from_camera(self) -> np.ndarray:
        """Pose at mid-exposure (4, 4) [m]."""
        return np.array(self.info.camera.world_from_camera)


def read_info(path: Path) -> FrameInfo:
    """Read and validate a frame.json; ValueError in one line."""
    return validated(FrameInfo, read_json(path), where=path)


def read_frame(folder: Path) -> Frame:
    """Open the frame in `folder`; ValueError in one line if its description is missing or broken."""
    return Frame(folder=Path(folder), info=read_info(Path(folder) / "frame.json"))


def write_frame(
    folder: Path, *, image: np.ndarray, buffers: dict[str, np.ndarray], info: FrameInfo, raw: np.ndarray | None = None
) -> None:
    """Write a frame to `<folder>.<unique>.partial`, then rename: `folder` is complete or absent.

    `image` (H, W, 3) uint8; `buffers` by name as in BUFFERS, (H, W) or (H, W, C); `raw` uint16, (H, W) or (H, W, 3),
    if and only if `info.sensor.raw`.
    Raises ValueError on an unknown, missing, misshapen or non-finite buffer, FileExistsError if `folder` is there.
    """
    import shutil
    import uuid

    check_buffers(buffers, height=info.camera.height_px, width=info.camera.width_px)
    check_options(buffers, info)
    if (raw is not None) != info.sensor.raw:
        raise ValueError(f"{folder}: raw picture {'not ' if raw is None else ''}given, sensor.raw = {info.sensor.raw}")
    folder = Path(folder)
    partial = folder.with_name(f"{folder.name}.{uuid.uuid4().hex}.partial")  # two writers never share one
    partial.mkdir(parents=True)
    try:
        images.write_png(partial / "image.png", image)
        if raw is not None:
            images.write_png(partial / RAW, raw)
        stored = {name: (buffers[name], BUFFERS[name][1]) for name in BUFFERS if name in buffers}
        exr.write(partial / "frame.exr", stored)
        write_json(partial / "frame.json", info.model_dump(mode="json"))
        if folder.is_dir():
            raise FileExistsError(f"{folder}: exists already, allowed: a new folder")
        partial.rename(folder)
    finally:
        shutil.rmtree(partial, ignore_errors=True)


def check_buffers(buffers: dict[str, np.ndarray], *, height: int, width: int, where: str = "frame") -> None:
    """Raise ValueError unless the buffers are those of the format, in shape and finite.

    `range` and `z_depth` are infinite where no body is seen; everything else is finite.
    """
    unknown = set(buffers) - set(BUFFERS)
    missing = set(REQUIRED) - set(buffers)
    for together in (set(MOTION), set(ORDERS)):
        if together & set(buffers):
            missing |= together - set(buffers)
    if unknown or missing:
        raise ValueError(f"{where}: buffers unknown {sorted(unknown)}, missing {sorted(missing)}")
    for name, values in buffers.items():
        channels = BUFFERS[name][0]
        shape = (height, width) if channels == 1 else (height, width, channels)
        if values.shape != shape:
            raise ValueError(f"{where}: {name} has shape {values.shape}, allowed: {shape}")
        allowed = np.isfinite(values) | (np.isposinf(values) if name in ("range", "z_depth") else False)
        if not np.all(allowed):
            raise ValueError(f"{where}: {name} holds {np.sum(~allowed)} non-finite values")


def check_options(buffers: dict[str, np.ndarray], info: FrameInfo, where: str = "frame") -> None:
    """Raise ValueError unless the frame has what its `options` say."""
    if ("backscatter_single" in buffers) != info.options.orders:
        got = "there" if "backscatter_single" in buffers else "missing"
        raise ValueError(
            f"{where}: backscatter_single is {got}, frame.json says options.orders = {info.options.orders}"
        )
