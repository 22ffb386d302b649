"""Lamps in a scene."""

from typing import Annotated

import numpy as np
from pydantic import Field, model_validator

from uwsim.camera import pose
from uwsim.optics import lamp as lamps
from uwsim.optics import sources
from uwsim.optics.spectrum import WAVELENGTHS_NM
from uwsim.scene.base import NonNegative, Positive, Strict, Table, Vector3


class Beam(Strict):
    """Beam profile as a table of relative intensity over the angle from the axis."""

    angles_deg: tuple[float, ...]
    values: tuple[NonNegative, ...]


class Lamp(Strict):
    """An LED mounted on the rig; position and aim in rig axes."""

    name: str = "led"
    position_m: Vector3
    look_at_m: Vector3
    radiant_flux_w: Positive | None = None
    radiant_intensity_w_per_sr: Positive | None = None
    half_angle_deg: Annotated[float, Field(ge=1, lt=90)] | None = None
    beam: Beam | None = None
    spectrum: str | Table = "LED-B3"

    @model_validator(mode="after")
    def _usable(self):
        if (self.radiant_flux_w is None) == (self.radiant_intensity_w_per_sr is None):
            raise ValueError("give either radiant_flux_w or radiant_intensity_w_per_sr (on the axis)")
        if (self.half_angle_deg is None) == (self.beam is None):
            raise ValueError("give either half_angle_deg or beam = {angles_deg, values}")
        _ = self.profile, self.relative_spectrum, self.rig_from_lamp
        return self

    @property
    def profile(self) -> np.ndarray:
        """Intensity relative to the axis on `optics.lamp.PROFILE_ANGLES_DEG`."""
        if self.beam is None:
            return lamps.profile_from_half_angle(half_angle_deg=self.half_angle_deg)
        return lamps.profile_from_table(angles_deg=self.beam.angles_deg, values=self.beam.values)

    @property
    def relative_spectrum(self) -> np.ndarray:
        """Spectral power with unit integral over 400-700 nm, (61,). [1/nm]"""
        if isinstance(self.spectrum, str):
            return sources.illuminant(self.spectrum)
        power = self.spectrum.on_grid(where=f"lamp {self.name}: spectrum")
        integral = np.trapezoid(power, WAVELENGTHS_NM)
        if integral <= 0:
            raise ValueError(f"lamp {self.name}: the spectrum has no power within 400-700 nm")
        return power / integral

    @property
    def intensity_w_per_sr(self) -> float:
        """Radiant intensity on the axis over the whole spectrum."""
        if self.radiant_intensity_w_per_sr is not None:
            return self.radiant_intensity_w_per_sr
        return lamps.intensity_from_flux(radiant_flux_w=self.radiant_flux_w, profile=self.profile)

    @property
    def rig_from_lamp(self) -> np.ndarray:
        """Pose of the lamp on the rig, beam along its +z axis, (4, 4)."""
        return pose.looking_at(self.position_m, self.look_at_m, where=f"lamp {self.name}")
