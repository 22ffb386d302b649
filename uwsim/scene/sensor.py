"""Exposure and sensor of a scene's camera."""

from typing import Annotated

from pydantic import Field

from uwsim.scene.base import NonNegative, Positive, Strict


class Exposure(Strict):
    time_s: Annotated[float, Field(gt=0, le=10)]
    f_number: Annotated[float, Field(gt=0.5, le=64)] = 2.8


Gain = Annotated[float, Field(ge=1, le=1000)]


class Sensor(Strict):
    """Noise and gain of the camera; without gains, white balance is set on a grey body under the first lamp, in air."""

    pixel_pitch_m: Annotated[float, Field(gt=0, le=1e-3)] = 5.5e-6
    peak_quantum_efficiency: Annotated[float, Field(gt=0, le=1)] = 0.5
    full_well_e: Positive = 10000.0
    read_noise_e: NonNegative = 4.0
    white_balance: tuple[Gain, Gain, Gain] | None = None
