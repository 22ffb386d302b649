"""Exposure and sensor of a scene's camera."""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from uwsim.camera import mosaic
from uwsim.camera.sensor import MOST_PRNU
from uwsim.scene.base import NonNegative, Positive, Strict

Time = Annotated[float, Field(gt=0, le=10)]
Gain = Annotated[float, Field(ge=1, le=1000)]


class _Auto(Strict):
    """Brightness that auto-exposure aims at: a percentile (without: the mean) of the linear picture, 1 = white."""

    target: Annotated[float, Field(gt=0, lt=1)]
    percentile: Annotated[float, Field(gt=0, le=100)] | None = None


class AutoTime(_Auto):
    """The exposure time is chosen, within limits; only for rigs at rest, as the motion blur depends on it."""

    adjust: Literal["time"]
    least_time_s: Time = 1e-6
    most_time_s: Time = 1.0

    @model_validator(mode="after")
    def _ordered(self):
        if self.least_time_s > self.most_time_s:
            raise ValueError(f"least_time_s = {self.least_time_s:g} is above most_time_s = {self.most_time_s:g}")
        return self


class AutoGain(_Auto):
    """The gain is chosen between 1 and a limit, at the exposure time given."""

    adjust: Literal["gain"]
    most_gain: Gain = 16.0


class Exposure(Strict):
    """When the rows of the image collect light.

    `readout_s`: time that the rows take to start one after the other, the top one first (0: global shutter). The row
    centred at y [px] of H starts readout_s y / H late; times are relative to the middle of the exposure at y = H / 2.
    """

    time_s: Time
    readout_s: NonNegative = 0.0
    f_number: Annotated[float, Field(gt=0.5, le=64)] = 2.8
    auto: Annotated[AutoTime | AutoGain, Field(discriminator="adjust")] | None = None


class Vignetting(Strict):
    """Darkening away from the optical axis: cos^4, and 1 + k1 tan^2 + k2 tan^4 + ... of the field angle."""

    cos4: bool = True
    polynomial: tuple[float, ...] = ()


class Sensor(Strict):
    """Noise, gain and output of the camera, in EMVA 1288 terms.

    Without `white_balance`, a grey body in air is made neutral, under the first lamp or in daylight. Without
    `adc_bits` the picture is made from the electrons directly. `gain` = 1 (also without either gain): the full well
    just fills the range; `gain_dn_per_e` is the system gain K instead.
    """

    pixel_pitch_m: Annotated[float, Field(gt=0, le=1e-3)] = 5.5e-6
    peak_quantum_efficiency: Annotated[float, Field(gt=0, le=1)] = 0.5
    full_well_e: Positive = 10000.0
    read_noise_e: NonNegative = 4.0
    dark_current_e_per_s: NonNegative = 0.0
    prnu: Annotated[float, Field(ge=0, le=MOST_PRNU)] = 0.0
    dsnu_e: NonNegative = 0.0
    pattern_seed: Annotated[int, Field(ge=0)] = 0
    vignetting: Vignetting | None = None
    adc_bits: Literal[8, 10, 12, 14, 16] | None = None
    black_level_dn: Annotated[int, Field(ge=0)] = 0
    gain: Annotated[float, Field(gt=0, le=1000)] | None = None
    gain_dn_per_e: Positive | None = None
    mosaic: Literal["RGGB", "BGGR", "GRBG", "GBRG"] | None = None
    demosaic: Literal["bilinear", "edge_aware", "vng"] = "bilinear"
    white_balance: tuple[Gain, Gain, Gain] | None = None
    raw: bool = False

    @model_validator(mode="after")
    def _usable(self):
        if self.gain is not None and self.gain_dn_per_e is not None:
            raise ValueError("gain and gain_dn_per_e are both given, allowed: one of them")
        if self.adc_bits is None:
            digital = ("gain_dn_per_e", "mosaic", "raw", "black_level_dn")
            if given := [name for name in digital if getattr(self, name)]:
                raise ValueError(f"{given[0]} = {getattr(self, given[0])} needs adc_bits, allowed: 8, 10, 12, 14 or 16")
        elif self.black_level_dn >= 2**self.adc_bits - 1:
            raise ValueError(
                f"black_level_dn: got {self.black_level_dn}, allowed: < {2**self.adc_bits - 1} at {self.adc_bits} bits"
            )
        if self.mosaic is not None:
            mosaic.check(self.mosaic, self.demosaic, adc_bits=self.adc_bits)
        return self

    @property
    def relative_gain(self) -> float:
        """The gain over the one at which the full well just fills the range."""
        if self.gain_dn_per_e is None:
            return 1.0 if self.gain is None else self.gain
        return self.gain_dn_per_e * self.full_well_e / (2**self.adc_bits - 1 - self.black_level_dn)
