"""The contents of frame.json as strict models; FORMAT.md says what each key means."""

from typing import Annotated, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_serializer, model_validator


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


class Daylight(_Strict):
    """Sun and sky above the flat water surface; see `uwsim.scene.daylight`."""

    sun_zenith_deg: float
    sun_azimuth_deg: float
    sun_irradiance_w_per_m2: float
    sky_irradiance_w_per_m2: float
    sky: Literal["uniform", "cardioidal"]
    spectrum: str
    relative_spectrum_per_nm: Spectrum
    refractive_index: float


class Body(_Strict):
    name: str
    kind: str
    instance: int
    world_from_body: Matrix4
    world_from_body_through_exposure: tuple[Matrix4, ...] | None = None  # null: at rest


class Marker(_Strict):
    body: str
    dictionary: str
    id: int
    corners_body_m: tuple[Vector3, Vector3, Vector3, Vector3]
    corners_world_m: tuple[Vector3, Vector3, Vector3, Vector3]
    corners_px: tuple[Vector2, Vector2, Vector2, Vector2] | None
    visible: tuple[bool, bool, bool, bool]


class Point(_Strict):
    """A point of a body that an image is to be measured by: the centre of a sphere, or a corner of a chessboard."""

    body: str
    id: int
    kind: Literal["sphere", "corner"]
    radius_m: float | None
    point_body_m: Vector3
    point_world_m: Vector3
    point_px: Vector2 | None
    visible: bool


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


class DenoiserBias(_Strict):
    """What the denoiser did to a layer, as `uwsim.render.smooth.Bias` measures it, relative to the layer's mean."""

    mean: Vector3
    region: Annotated[float, Field(ge=0)]
    pixel: Annotated[float, Field(ge=0)]
    pixel_error: Annotated[float, Field(ge=0)]
    pixel_error_before: Annotated[float, Field(ge=0)]


class Options(_Strict):
    """What the frame has on request; `denoiser` (else null) names what made `denoised_layers` smooth, and biased."""

    orders: bool = False
    denoiser: str | None = None
    denoised_layers: tuple[Literal["forward_scatter", "backscatter"], ...] = ()
    bias: dict[Literal["radiance", "sharp"], dict[Literal["forward_scatter", "backscatter"], DenoiserBias]] = {}

    @model_validator(mode="after")
    def _agrees(self):
        stated = [set(layers) for layers in self.bias.values()]
        if (self.denoiser is None) == bool(self.denoised_layers) or (self.denoiser is None) == bool(stated):
            raise ValueError("options: denoiser, denoised_layers and bias belong together, got only some of them")
        if any(layers != set(self.denoised_layers) for layers in stated):
            raise ValueError(f"options.bias: got {stated}, allowed: an entry for each of {self.denoised_layers}")
        return self


class RigView(_Strict):
    """Which camera of a rig took the frame, and where rig and camera were at mid-exposure."""

    camera: str
    moment: Annotated[int, Field(ge=0)]
    rig_from_camera: Matrix4
    world_from_rig: Matrix4


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
    options: Options = Options()
    camera: Camera
    sensor: Sensor
    lamps: tuple[Lamp, ...]
    water: Water
    added_water: tuple[dict, ...] = ()
    daylight: Daylight | None = None
    bodies: tuple[Body, ...]
    particles: tuple[dict, ...] = ()
    sub_frames: int = 1
    markers: tuple[Marker, ...]
    points: tuple[Point, ...] = ()
    blur: Blur | None
    time_ns: Annotated[int, Field(ge=0)] | None = None
    sequence: str | None = None
    rig: RigView | None = None

    @model_serializer(mode="wrap")
    def _without_what_it_is_not(self, handler):
        """Leave out the keys of sequences and rigs for a frame that belongs to none, and points where it has none."""
        absent = [key for key in ("time_ns", "sequence", "rig") if getattr(self, key) is None]
        absent += [] if self.points else ["points"]
        return {key: value for key, value in handler(self).items() if key not in absent}

    @model_validator(mode="after")
    def _rig_agrees(self):
        if (self.time_ns is None) != (self.sequence is None) or (self.sequence is not None and self.rig is None):
            raise ValueError("time_ns, sequence and rig belong together, got only some of them")
        if self.rig is not None:
            seen = np.array(self.rig.world_from_rig) @ np.array(self.rig.rig_from_camera)
            if not np.allclose(seen, self.camera.world_from_camera, rtol=0, atol=1e-6):
                raise ValueError("rig: world_from_rig and rig_from_camera do not make camera.world_from_camera")
        return self

    @model_validator(mode="after")
    def _spectra_agree(self):
        water = self.water
        lengths = {len(water.wavelengths_nm), len(water.absorption_per_m), len(water.scattering_per_m)}
        if len(lengths) != 1:
            raise ValueError(f"water spectra differ in length: {sorted(lengths)}")
        return self
