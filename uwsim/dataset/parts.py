"""What frame.json says of camera, lamps, water and bodies, as strict models; FORMAT.md says what each key means."""

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field


class Strict(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


Vector3 = tuple[float, float, float]
Vector2 = tuple[float, float]
Row4 = tuple[float, float, float, float]
Matrix4 = tuple[Row4, Row4, Row4, Row4]
Matrix3 = tuple[Vector3, Vector3, Vector3]
Spectrum = tuple[float, ...]


class Housing(Strict):
    """Black cylinder from the front face backwards."""

    radius_m: float
    length_m: float


class FlatPort(Strict):
    """See `uwsim.camera.flat_port`."""

    kind: Literal["flat"]
    gap_m: float
    thickness_m: float
    normal: Vector3
    n_air: float
    n_glass: float
    n_water: float
    glass_absorption_per_m: float


class DomePort(Strict):
    """See `uwsim.camera.dome_port`."""

    kind: Literal["dome"]
    inner_radius_m: float
    thickness_m: float
    decentring_m: Vector3
    n_air: float
    n_glass: float
    n_water: float
    glass_absorption_per_m: float


class Camera(Strict):
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


class Vignetting(Strict):
    """See `uwsim.camera.vignetting`."""

    cos4: bool
    polynomial: tuple[float, ...]


class AutoExposure(Strict):
    """What auto-exposure was asked for, and the brightness that it reached."""

    adjust: Literal["time", "gain"]
    target: float
    percentile: float | None
    reached: float


class Sensor(Strict):
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


class LampWindow(Strict):
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


class Lamp(Strict):
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


class WaterBands(Strict):
    weighting: str
    absorption_per_m: Vector3
    scattering_per_m: Vector3
    attenuation_per_m: Vector3


class Water(Strict):
    name: str
    wavelengths_nm: Spectrum
    absorption_per_m: Spectrum
    scattering_per_m: Spectrum
    phase_function: dict
    bands: WaterBands


class Daylight(Strict):
    """Sun and sky above the flat water surface; see `uwsim.scene.daylight`."""

    sun_zenith_deg: float
    sun_azimuth_deg: float
    sun_irradiance_w_per_m2: float
    sky_irradiance_w_per_m2: float
    sky: Literal["uniform", "cardioidal"]
    spectrum: str
    relative_spectrum_per_nm: Spectrum
    refractive_index: float


class Body(Strict):
    name: str
    kind: str
    instance: int
    world_from_body: Matrix4
    world_from_body_through_exposure: tuple[Matrix4, ...] | None = None  # null: at rest


class Marker(Strict):
    body: str
    dictionary: str
    id: int
    corners_body_m: tuple[Vector3, Vector3, Vector3, Vector3]
    corners_world_m: tuple[Vector3, Vector3, Vector3, Vector3]
    corners_px: tuple[Vector2, Vector2, Vector2, Vector2] | None
    visible: tuple[bool, bool, bool, bool]


class Point(Strict):
    """A point of a body that an image is to be measured by: the centre of a sphere, or a corner of a chessboard."""

    body: str
    id: int
    kind: Literal["sphere", "corner"]
    radius_m: float | None
    point_body_m: Vector3
    point_world_m: Vector3
    point_px: Vector2 | None
    visible: bool
