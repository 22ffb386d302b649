"""Daylight in a scene: sun and sky above a flat water surface."""

from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from uwsim.optics import sources
from uwsim.optics.spectrum import WAVELENGTHS_NM
from uwsim.scene.base import NonNegative, Strict, Table


class Daylight(Strict):
    """Sun and sky over a flat surface at z = 0, as irradiances of a horizontal plane above it over 400-700 nm.

    Both 0: the surface at night, which reflects lamps and bodies. The sun stands at `sun_zenith_deg` from the vertical,
    `sun_azimuth_deg` from world x towards y. The sky is uniform, or cardioidal: three times brighter above than at the
    horizon. Valid: no waves, no polarisation, a sun without extent.
    """

    sun_zenith_deg: Annotated[float, Field(ge=0, lt=90)] = 30.0
    sun_azimuth_deg: float = 0.0
    sun_irradiance_w_per_m2: NonNegative = 0.0
    sky_irradiance_w_per_m2: NonNegative = 0.0
    sky: Literal["uniform", "cardioidal"] = "uniform"
    spectrum: str | Table = "D65"

    @model_validator(mode="after")
    def _usable(self):
        _ = self.relative_spectrum
        return self

    @property
    def is_dark(self) -> bool:
        """Whether neither sun nor sky has light."""
        return self.sun_irradiance_w_per_m2 + self.sky_irradiance_w_per_m2 == 0

    @property
    def relative_spectrum(self) -> np.ndarray:
        """Spectral power with unit integral over 400-700 nm, (61,). [1/nm]"""
        if isinstance(self.spectrum, str):
            return sources.illuminant(self.spectrum)
        power = self.spectrum.on_grid(where="daylight: spectrum")
        integral = np.trapezoid(power, WAVELENGTHS_NM)
        if integral <= 0:
            raise ValueError("daylight: the spectrum has no power within 400-700 nm")
        return power / integral

    @property
    def towards_sun_in_air(self) -> np.ndarray:
        """Unit vector from the surface to the sun, (3,)."""
        zenith, azimuth = np.radians(self.sun_zenith_deg), np.radians(self.sun_azimuth_deg)
        return np.array([np.sin(zenith) * np.cos(azimuth), np.sin(zenith) * np.sin(azimuth), np.cos(zenith)])
