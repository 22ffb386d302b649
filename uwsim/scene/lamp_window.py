"""Windows of lamps in a scene."""

from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from uwsim.optics import window
from uwsim.optics.refractive_index import glass_nbk7
from uwsim.scene.base import NonNegative, Positive, Strict

N_BK7_INDEX = round(float(glass_nbk7(550.0)), 4)
"""Refractive index of N-BK7 at 550 nm, relative to air."""

Index = Annotated[float, Field(ge=1, le=3)]


class FlatLampWindow(Strict):
    """Flat window: LED, air gap, glass, water. `radius_m` is that of the round exit aperture on the outer face.

    `calibration`: the lamp's flux or intensity was measured without the window ("bare") or through it, in air.
    """

    kind: Literal["flat"] = "flat"
    air_gap_m: Positive
    thickness_m: NonNegative
    radius_m: Positive
    n_glass: Index = N_BK7_INDEX
    glass_absorption_per_m: NonNegative = 0.0
    calibration: window.Calibration = "bare"

    def optical(self, *, n_water: float) -> window.FlatWindow:
        """Return the window against water of this index."""
        return window.FlatWindow(
            air_gap_m=self.air_gap_m, thickness_m=self.thickness_m, n_glass=self.n_glass, n_water=n_water,
            glass_absorption_per_m=self.glass_absorption_per_m, radius_m=self.radius_m,
        )  # fmt: skip

    @property
    def front_m(self) -> float:
        """Distance of the front face from the LED."""
        return self.air_gap_m + self.thickness_m

    @property
    def front_radius_m(self) -> float:
        return self.radius_m


class DomeLampWindow(Strict):
    """Spherical window concentric with one LED without extent; `half_aperture_deg` as seen from it, about the beam.

    The front face passes through the dome's centre; the dome stands out of it.
    """

    kind: Literal["dome"]
    inner_radius_m: Positive
    thickness_m: NonNegative
    half_aperture_deg: Annotated[float, Field(gt=0, le=90)] = 90.0
    n_glass: Index = N_BK7_INDEX
    glass_absorption_per_m: NonNegative = 0.0
    calibration: window.Calibration = "bare"

    def optical(self, *, n_water: float) -> window.DomeWindow:
        """Return the window against water of this index."""
        return window.DomeWindow(
            inner_radius_m=self.inner_radius_m, thickness_m=self.thickness_m, n_glass=self.n_glass, n_water=n_water,
            glass_absorption_per_m=self.glass_absorption_per_m,
            half_aperture_rad=float(np.radians(self.half_aperture_deg)),
        )  # fmt: skip

    def transmittance(self, *, n_water: float) -> float:
        """Return the factor from flux as calibrated to flux in the water."""
        in_water = self.optical(n_water=n_water).transmittance
        return in_water if self.calibration == "bare" else in_water / self.optical(n_water=1.0).transmittance

    @property
    def front_m(self) -> float:
        """Distance of the front face from the LED."""
        return 0.0

    @property
    def front_radius_m(self) -> float:
        return self.inner_radius_m + self.thickness_m

    @property
    def outer_radius_m(self) -> float:
        return self.inner_radius_m + self.thickness_m
