"""One frame on disk: image.png, frame.exr (the truth as float images), frame.json (the truth as numbers).

And raw16.png, the output of the ADC, where the scene asks for it.
"""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

from uwsim import images
from uwsim.dataset import exr
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
}
REQUIRED = tuple(name for name in BUFFERS if name not in ("sharp", "flow_start", "flow_end"))
MOTION = ("sharp", "flow_start", "flow_end")


class _Strict(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


Vector3 = tuple[float, float, float]
Vector2 = tuple[float, float]
Row4 = tuple[float, float, float, float]
Matrix4 = tuple[Row4, Row4, Row4, Row4]
Matrix3 = tuple[Vector3, Vector3, Vector3]
Spectrum = tuple[float, ...]


class Housing(_Strict):
    """Black cylinder from the front face backwards."""

    radius_m: float
    length_m: float


class FlatPort(_Strict):
    """See `uwsim.camera.flat_port`."""

    kind: Literal["flat"]
    gap_m: float
    thickness_m: float
    normal: Vector3
    n_air: float
    n_glass: float
    n_water: float
    glass_absorption_per_m: float


class DomePort(_Strict):
    """See `uwsim.camera.dome_port`."""

    kind: Literal["dome"]
    inner_radius_m: float
    thickness_m: float
    decentring_m: Vector3
    n_air: float
    n_glass: float
    n_water: float
    glass_absorption_per_m: float


class Camera(_Strict):
    """With a port, `K` and `distortion` are those of the lens in air; `uwsim.camera.lens` makes rays of them."""

    width_px: Annotated[int, Field(ge=1)]
    height_px: Annotated[int, Field(ge=1)]
    K: Matrix3
    response: str
    world_from_camera: Matrix4
    times_s: tuple[float, ...]
    world_from_camera_through_exposure: tuple[Matrix4, ...]
    readout_s: float = 0.0
    distortion: tuple[float, ...] = ()
    port: Annotated[FlatPort | DomePort, Field(discriminator="kind")] | None = None
    housing: Housing | None = None


class Vignetting(_Strict):
    """See `uwsim.camera.vignetting`."""

    cos4: bool
    polynomial: tuple[float, ...]


class AutoExposure(_Strict):
    """What auto-exposure was asked for, and the brightness that it reached."""

    adjust: Literal["time", "gain"]
    target: float
    percentile: float | None
    reached: float


class Sensor(_Strict):
    """What turns `radiance` into `raw16.png` and `image.png`; see `uwsim.camera.sensor`."""

    exposure_time_s: float
    f_number: float
    electrons_per_radiance: Vector3
    full_well_e: float
    read_noise_e: float
    white_balance: Vector3
    seed: int
    dark_e: float = 0.0
    prnu: float = 0.0
    dsnu_e: float = 0.0
    pattern_seed: int = 0
    vignetting: Vignetting | None = None
    gain: float = 1.0
    gain_dn_per_e: float | None = None
    adc_bits: Literal[8, 10, 12, 14, 16] | None = None
    black_level_dn: int = 0
    mosaic: Literal["RGGB", "BGGR", "GRBG", "GBRG"] | None = None
    demosaic: Literal["bilinear", "edge_aware", "vng"] = "bilinear"
    raw: bool = False
    auto: AutoExposure | None = None


class LampWindow(_Strict):
    """Flat, or a dome about the lamp; indices relative to air. See `uwsim.optics.window`."""

    kind: Literal["flat", "dome"]
    thickness_m: float
    n_glass: float
    n_water: float
    glass_absorption_per_m: float
    calibration: Literal["bare", "through_window"]
    air_gap_m: float | None = None
    radius_m: float | None = None
    inner_radius_m: float | None = None
    half_aperture_deg: float | None = None


class Lamp(_Strict):
    name: str
    position_m: Vector3
    direction: Vector3
    radiant_intensity_w_per_sr: float
    spectrum: str
    relative_spectrum_per_nm: Spectrum
    half_angle_deg: float | None
    beam_angles_deg: Spectrum | None
    beam_values: Spectrum | None
    beam_azimuths_deg: Spectrum | None = None
    beam_table: tuple[Spectrum, ...] | None = None
    world_from_lamp: Matrix4 | None = None
    world_from_leds: tuple[Matrix4, ...] | None = None
    die_radius_m: float = 0.0
    window: LampWindow | None = None
    housing: Housing | None = None


class WaterBands(_Strict):
    weighting: str
    absorption_per_m: Vector3
    scattering_per_m: Vector3
    attenuation_per_m: Vector3


class Water(_Strict):
    name: str
    wavelengths_nm: Spectrum
    absorption_per_m: Spectrum
    scattering_per_m: Spectrum
    phase_function: dict
    bands: WaterBands


class Body(_Strict):
    name: str
    kind: str
    instance: int
    world_from_body: Matrix4


class Marker(_Strict):
    body: str
    dictionary: str
    id: int
    corners_body_m: tuple[Vector3, Vector3, Vector3, Vector3]
    corners_world_m: tuple[Vector3, Vector3, Vector3, Vector3]
    corners_px: tuple[Vector2, Vector2, Vector2, Vector2] | None
    visible: tuple[bool, bool, bool, bool]


class Blur(_Strict):
    """Motion of the image during the exposure: medians over the pixels that see a body."""

    length_px: float
    angle_deg: float
    spread_px: float
    uniform: bool


class PictureNoise(_Strict):
    """Monte-Carlo noise of one light picture, as `uwsim.render.stopping` measures it."""

    batches: Annotated[int, Field(ge=2)]
    samples_per_pixel: Annotated[int, Field(ge=2)]
    ended_by: Literal["samples", "noise", "time"]
    region_error_p95: Annotated[float, Field(ge=0)]
    region_rule_met: bool | None
    pixel_ratio_p95: Annotated[float, Field(ge=0)]
    pixel_share_within: Annotated[float, Field(ge=0, le=1)]
    pixel_rule_met: bool


class Noise(_Strict):
    """Whether the light pictures are good enough; `met`: every picture meets the pixel rule, and the region rule at
    `region_rule` where that was asked for (else null)."""

    region_rule: float | None
    met: bool
    pictures: dict[Literal["radiance", "water_free", "sharp"], PictureNoise]

    @model_validator(mode="after")
    def _agrees(self):
        if "radiance" not in self.pictures:
            raise ValueError(f"noise.pictures has {sorted(self.pictures)}, allowed: radiance and its twins")
        rules = [rule for one in self.pictures.values() for rule in (one.pixel_rule_met, one.region_rule_met)]
        if self.met != (False not in rules):
            raise ValueError(f"noise.met is {self.met}, but the rules of the pictures are {rules}")
        return self


class FrameInfo(_Strict):
    """The contents of frame.json; FORMAT.md gives units and frames."""

    format: Literal[1]
    name: str
    group: str
    scene: str
    seed: int
    frame: int
    samples_per_pixel: int
    batches: int
    noise: Noise | None = None  # null: nothing was rendered
    camera: Camera
    sensor: Sensor
    lamps: tuple[Lamp, ...]
    water: Water
    bodies: tuple[Body, ...]
    markers: tuple[Marker, ...]
    blur: Blur | None

    @model_validator(mode="after")
    def _spectra_agree(self):
        water = self.water
        lengths = {len(water.wavelengths_nm), len(water.absorption_per_m), len(water.scattering_per_m)}
        if len(lengths) != 1:
            raise ValueError(f"water spectra differ in length: {sorted(lengths)}")
        return self


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
    """Write a frame to `<folder>.partial`, then rename: `folder` is complete or absent.

    `image` (H, W, 3) uint8; `buffers` by name as in BUFFERS, (H, W) or (H, W, C); `raw` uint16, (H, W) or (H, W, 3),
    if and only if `info.sensor.raw`.
    Raises ValueError on an unknown, missing, misshapen or non-finite buffer.
    """
    import shutil

    check_buffers(buffers, height=info.camera.height_px, width=info.camera.width_px)
    if (raw is not None) != info.sensor.raw:
        raise ValueError(f"{folder}: raw picture {'not ' if raw is None else ''}given, sensor.raw = {info.sensor.raw}")
    folder = Path(folder)
    partial = folder.with_name(folder.name + ".partial")
    shutil.rmtree(partial, ignore_errors=True)
    partial.mkdir(parents=True)
    images.write_png(partial / "image.png", image)
    if raw is not None:
        images.write_png(partial / RAW, raw)
    exr.write(partial / "frame.exr", {name: (buffers[name], BUFFERS[name][1]) for name in BUFFERS if name in buffers})
    write_json(partial / "frame.json", info.model_dump(mode="json"))
    partial.rename(folder)


def check_buffers(buffers: dict[str, np.ndarray], *, height: int, width: int, where: str = "frame") -> None:
    """Raise ValueError unless the buffers are those of the format, in shape and finite.

    `range` and `z_depth` are infinite where no body is seen; everything else is finite.
    """
    unknown = set(buffers) - set(BUFFERS)
    missing = set(REQUIRED) - set(buffers)
    moving = set(MOTION) & set(buffers)
    if moving and moving != set(MOTION):
        missing |= set(MOTION) - moving
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
