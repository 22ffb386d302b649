"""The scene description: strict, frozen models filled from TOML. Lengths in metres, angles in degrees.

World: z up, water surface at z = 0. Rig: x right, y down, z forward. Body: x right, y up, z out of its face.
"""

from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from uwsim.camera import pinhole, pose
from uwsim.optics import lamp as lamps
from uwsim.optics import phase as phases
from uwsim.optics import sources
from uwsim.optics.spectrum import WAVELENGTHS_NM, on_grid
from uwsim.optics.turbidity import turbid_water
from uwsim.optics.water import Water, named_water
from uwsim.scene.base import NonNegative, Positive, Strict, Table, Vector3
from uwsim.scene.bodies import Body, MarkerBoard


class Phase(Strict):
    """Phase function: `hg` with mean cosine g, one number or one per wavelength; or `hg_mixture`."""

    type: Literal["hg", "hg_mixture"] = "hg"
    g: float | tuple[float, ...]
    weights: tuple[NonNegative, ...] | None = None

    @model_validator(mode="after")
    def _usable(self):
        terms = self.g if isinstance(self.g, tuple) else (self.g,)
        if any(abs(g) >= 1 for g in terms):
            raise ValueError(f"g is {self.g}, allowed: between -1 and 1, exclusive")
        if self.type == "hg_mixture" and not isinstance(self.g, tuple):
            raise ValueError(f"g is {self.g}, allowed for hg_mixture: a list, one per weight")
        if (self.type == "hg_mixture") != (self.weights is not None):
            raise ValueError("weights belong to type hg_mixture, and only to it")
        if self.weights is not None and (len(self.weights) != len(terms) or abs(sum(self.weights) - 1) > 1e-6):
            raise ValueError(f"weights are {self.weights}, allowed: one per g, with sum 1")
        return self

    def mixture(self, wavelengths_nm: tuple[float, ...]) -> phases.PhaseMixture:
        if self.type == "hg_mixture":
            return phases.constant(list(self.g), list(self.weights))
        if not isinstance(self.g, tuple):
            return phases.constant([self.g], [1.0])
        return _spectral_hg(on_grid(wavelengths_nm, self.g, where="phase.g"))


def _spectral_hg(g: np.ndarray) -> phases.PhaseMixture:
    """Henyey-Greenstein with g over wavelength (61,): one term per distinct g, switched on where it applies."""
    terms, index = np.unique(np.round(g, 6), return_inverse=True)
    return phases.PhaseMixture(g=terms, weights=np.eye(len(terms))[:, index])


class NamedWater(Strict):
    """A water type by name; `particle_factor` multiplies its particles, `source` chooses among rival Jerlov tables."""

    name: str
    particle_factor: NonNegative = 1.0
    source: str | None = None

    @model_validator(mode="after")
    def _known(self):
        self.optical()
        return self

    def optical(self) -> Water:
        return named_water(self.name, particle_factor=self.particle_factor, source=self.source)


class TurbidWater(Strict):
    """Fresh water with suspended minerals by mass."""

    minerals_g_per_m3: NonNegative

    def optical(self) -> Water:
        return turbid_water(minerals_g_per_m3=self.minerals_g_per_m3)


class TabulatedWater(Strict):
    """Water by its coefficients over wavelength."""

    wavelengths_nm: tuple[float, ...]
    absorption_per_m: tuple[NonNegative, ...]
    scattering_per_m: tuple[NonNegative, ...]
    phase: Phase

    @model_validator(mode="after")
    def _usable(self):
        self.optical()
        return self

    def optical(self) -> Water:
        a = on_grid(self.wavelengths_nm, self.absorption_per_m, where="absorption_per_m")
        b = on_grid(self.wavelengths_nm, self.scattering_per_m, where="scattering_per_m")
        return Water(name="tabulated", absorption=a, scattering=b, phase=self.phase.mixture(self.wavelengths_nm))


class Camera(Strict):
    """Pinhole camera in the rig's origin: field of view, or K as (fx, fy, cx, cy) [px]."""

    width_px: Annotated[int, Field(ge=1, le=16384)]
    height_px: Annotated[int, Field(ge=1, le=16384)]
    horizontal_fov_deg: Annotated[float, Field(gt=0, lt=170)] | None = None
    K_px: tuple[Positive, Positive, float, float] | None = None
    response: str = "Nikon 5100 (NPL)"

    @model_validator(mode="after")
    def _one_way(self):
        if (self.horizontal_fov_deg is None) == (self.K_px is None):
            raise ValueError("give either horizontal_fov_deg or K_px = [fx, fy, cx, cy]")
        sources.camera_response(self.response)
        return self

    @property
    def K(self) -> np.ndarray:
        """Camera matrix (3, 3), pixel centres at integer + 0.5. [px]"""
        if self.K_px is None:
            return pinhole.camera_matrix(
                width_px=self.width_px, height_px=self.height_px, horizontal_fov_deg=self.horizontal_fov_deg
            )
        fx, fy, cx, cy = self.K_px
        return np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1.0]])


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


class Motion(Strict):
    """Uniform motion of the rig during the exposure, along and about the rig's own axes."""

    velocity_m_per_s: Vector3 = (0.0, 0.0, 0.0)
    rotation_deg_per_s: Vector3 = (0.0, 0.0, 0.0)


LEAST_LAMP_DISTANCE_M = 1e-3


class Rig(Strict):
    """Camera and lamps mounted together and moved as one."""

    position_m: Vector3
    look_at_m: Vector3
    roll_deg: float = 0.0
    camera: Camera
    lamps: Annotated[tuple[Lamp, ...], Field(min_length=1)]
    motion: Motion | None = None

    @model_validator(mode="after")
    def _usable(self):
        if self.position_m[2] >= 0:
            raise ValueError(f"position_m has z = {self.position_m[2]:g} m, allowed: below the water surface (z < 0)")
        _ = self.world_from_rig
        for lamp in self.lamps:
            apart_m = float(np.linalg.norm(lamp.position_m))
            if apart_m < LEAST_LAMP_DISTANCE_M:
                raise ValueError(
                    f"lamp {lamp.name} is {apart_m:g} m from the camera's pinhole, allowed: at least "
                    f"{LEAST_LAMP_DISTANCE_M:g} m (the light scattered in between is infinite)"
                )
        names = [lamp.name for lamp in self.lamps]
        if len(set(names)) != len(names):
            raise ValueError(f"lamp names {names} are not unique")
        return self

    @property
    def world_from_rig(self) -> np.ndarray:
        return pose.looking_at(self.position_m, self.look_at_m, roll_deg=self.roll_deg, where="look_at_m")


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


class Scene(Strict):
    """One scene: water, rig, bodies, exposure and sensor."""

    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9_-]+$")]
    description: str
    water: NamedWater | TurbidWater | TabulatedWater
    rig: Rig
    bodies: Annotated[tuple[Body, ...], Field(min_length=1)]
    exposure: Exposure
    sensor: Sensor = Sensor()

    @model_validator(mode="after")
    def _usable(self):
        names = [body.name for body in self.bodies]
        if len(set(names)) != len(names):
            raise ValueError(f"bodies: names {names} are not unique")
        boards = [body for body in self.bodies if isinstance(body, MarkerBoard)]
        marks = [(board.dictionary, marker_id) for board in boards for marker_id in board.ids]
        if len(set(marks)) != len(marks):
            names = [board.name for board in boards]
            raise ValueError(f"bodies: boards {names} share marker ids, allowed: each marker once (first_id)")
        for lamp in self.rig.lamps:
            height = (self.rig.world_from_rig @ lamp.rig_from_lamp)[2, 3]
            if height >= 0:
                raise ValueError(f"lamp {lamp.name} is at z = {height:.3g} m, allowed: below the water surface (z < 0)")
        return self
