"""Several LEDs behind one window: rings, grids and the sum of their fields."""

import dataclasses
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from uwsim.optics.beam_profile import Beam
from uwsim.optics.checks import require
from uwsim.optics.window import Calibration, FlatWindow
from uwsim.optics.window_field import exact_field


class Emitter(NamedTuple):
    """One LED: its beam and its place in the plane parallel to the window, (x, y) from the window's centre. [m]"""

    beam: Beam
    position_m: tuple[float, float]


def _count(name: str, value: int) -> int:
    if not (math.isfinite(value) and value == int(value) and value >= 1):
        raise ValueError(f"lamp array {name}: got {value:g}, allowed: a whole number of at least 1")
    return int(value)


def ring(beam: Beam, *, count: int, radius_m: float, outward_tilt_rad: float = 0.0) -> list[Emitter]:
    """Return LEDs evenly on a circle, the first at azimuth 0, each tilted away from the centre."""
    require("lamp array radius_m", radius_m, above=0)
    azimuths = 2 * math.pi * np.arange(_count("count", count)) / count
    return [
        Emitter(
            dataclasses.replace(beam, tilt_rad=outward_tilt_rad, tilt_azimuth_rad=float(azimuth)),
            (radius_m * math.cos(azimuth), radius_m * math.sin(azimuth)),
        )
        for azimuth in azimuths
    ]


def grid(beam: Beam, *, rows: int, columns: int, pitch_m: float) -> list[Emitter]:
    """Return LEDs on a square grid about the centre, all with the same direction."""
    require("lamp array pitch_m", pitch_m, above=0)
    across = (np.arange(_count("columns", columns)) - (columns - 1) / 2) * pitch_m
    down = (np.arange(_count("rows", rows)) - (rows - 1) / 2) * pitch_m
    return [Emitter(beam, (float(x), float(y))) for y in down for x in across]


def array_irradiance(
    emitters: Sequence[Emitter],
    window: FlatWindow,
    *,
    lateral_m: np.ndarray,
    depth_m: np.ndarray,
    attenuation_per_m: np.ndarray = 0.0,
    calibration: Calibration = "bare",
) -> np.ndarray:
    """Return the irradiance of all LEDs together on a plane parallel to the window, (..., 2), (...) -> (...). [W/m^2]

    Incoherent sum of `exact_field`; the exit aperture is the window's, the same for all.
    """
    if not emitters:
        raise ValueError("lamp array: got no emitter, allowed: at least 1")
    return sum(
        exact_field(
            emitter.beam,
            window,
            lateral_m=lateral_m,
            depth_m=depth_m,
            attenuation_per_m=attenuation_per_m,
            emitter_m=emitter.position_m,
            calibration=calibration,
        ).irradiance_w_per_m2
        for emitter in emitters
    )
