"""The contents of frame.json as strict models; FORMAT.md says what each key means."""

from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_serializer, model_validator

from uwsim.dataset.parts import Body, Camera, Daylight, Lamp, Marker, Matrix4, Point, Sensor, Strict, Vector3, Water


class Blur(Strict):
    """Motion of the image during the exposure: medians over the pixels that see a body."""

    length_px: float
    angle_deg: float
    spread_px: float
    uniform: bool


class PictureNoise(Strict):
    """Monte-Carlo noise of one light picture, as `uwsim.render.stopping` measures it."""

    batches: Annotated[int, Field(ge=2)]
    samples_per_pixel: Annotated[int, Field(ge=2)]
    ended_by: Literal["samples", "noise", "time"]
    region_error_p95: Annotated[float, Field(ge=0)]
    region_rule_met: bool | None
    pixel_ratio_p95: Annotated[float, Field(ge=0)]
    pixel_share_within: Annotated[float, Field(ge=0, le=1)]
    pixel_rule_met: bool | None


class Noise(Strict):
    """Whether the light pictures are good enough; `met`: every picture meets the rules that were asked for.

    Rules that were not are null: the pixel rule with `pixels = false`, the region rule (at `region_rule`) without one.
    """

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


class DenoiserBias(Strict):
    """What the denoiser did to a layer, as `uwsim.render.smooth.Bias` measures it, relative to the layer's mean."""

    mean: Vector3
    region: Annotated[float, Field(ge=0)]
    pixel: Annotated[float, Field(ge=0)]
    pixel_error: Annotated[float, Field(ge=0)]
    pixel_error_before: Annotated[float, Field(ge=0)]


Layer = Literal["direct", "forward_scatter", "backscatter"]


class Options(Strict):
    """What the frame has on request; `denoiser` (else null) names what made `denoised_layers` smooth, and biased."""

    orders: bool = False
    denoiser: str | None = None
    denoised_layers: tuple[Layer, ...] = ()
    bias: dict[Literal["radiance", "sharp"], dict[Layer, DenoiserBias]] = {}

    @model_validator(mode="after")
    def _agrees(self):
        stated = [set(layers) for layers in self.bias.values()]
        if (self.denoiser is None) == bool(self.denoised_layers) or (self.denoiser is None) == bool(stated):
            raise ValueError("options: denoiser, denoised_layers and bias belong together, got only some of them")
        if any(layers != set(self.denoised_layers) for layers in stated):
            raise ValueError(f"options.bias: got {stated}, allowed: an entry for each of {self.denoised_layers}")
        return self


class RigView(Strict):
    """Which camera of a rig took the frame, and where rig and camera were at mid-exposure."""

    camera: str
    moment: Annotated[int, Field(ge=0)]
    rig_from_camera: Matrix4
    world_from_rig: Matrix4


class FrameInfo(Strict):
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
