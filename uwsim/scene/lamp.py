"""Lamps in a scene: LEDs bare or behind a window, points or discs, alone or in arrays, with a housing."""

from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from uwsim.camera import pose
from uwsim.optics import beam_profile, ies, lamp_array, sources
from uwsim.optics import lamp as lamps
from uwsim.optics.lamp_array import Emitter
from uwsim.optics.spectrum import WAVELENGTHS_NM
from uwsim.scene.base import NonNegative, Positive, Strict, Table, Vector3
from uwsim.scene.bodies import File
from uwsim.scene.housing import Housing
from uwsim.scene.lamp_window import DomeLampWindow, FlatLampWindow

AZIMUTHS = 360
"""Rows of a profile that depends on the azimuth: whole degrees."""


class Beam(Strict):
    """Beam profile as a table of relative intensity over the angle from the axis."""

    angles_deg: tuple[float, ...]
    values: tuple[NonNegative, ...]


class Ring(Strict):
    """LEDs evenly on a circle, the first on the lamp's x axis, each tilted away from the centre."""

    kind: Literal["ring"]
    count: Annotated[int, Field(ge=1, le=1000)]
    radius_m: Positive
    outward_tilt_deg: Annotated[float, Field(ge=0, lt=90)] = 0.0

    def emitters(self, beam: beam_profile.Beam) -> list[Emitter]:
        tilt_rad = float(np.radians(self.outward_tilt_deg))
        return lamp_array.ring(beam, count=self.count, radius_m=self.radius_m, outward_tilt_rad=tilt_rad)

    @property
    def spacing_m(self) -> float:
        """Distance of the centres of neighbours."""
        return 2 * self.radius_m * float(np.sin(np.pi / self.count)) if self.count > 1 else float("inf")


class Grid(Strict):
    """LEDs on a square grid about the lamp's axis, columns along its x axis, all with the same direction."""

    kind: Literal["grid"]
    rows: Annotated[int, Field(ge=1, le=100)]
    columns: Annotated[int, Field(ge=1, le=100)]
    pitch_m: Positive

    def emitters(self, beam: beam_profile.Beam) -> list[Emitter]:
        return lamp_array.grid(beam, rows=self.rows, columns=self.columns, pitch_m=self.pitch_m)

    @property
    def spacing_m(self) -> float:
        """Distance of the centres of neighbours."""
        return self.pitch_m


class Lamp(Strict):
    """A lamp mounted on the rig; position and aim in rig axes.

    `position_m` is the middle of the LED (of the array), behind the window where there is one; the beam is the lamp's
    +z axis and the window's normal, its x axis (azimuth 0 of a profile or an array) the rig's, as far as the aim
    allows, turned about the beam by `roll_deg` from x to y.
    `radiant_flux_w` is that of the whole lamp, all LEDs together; `radiant_intensity_w_per_sr` the sum over the LEDs of
    the intensity on each one's own axis (with parallel LEDs: that of the lamp on its axis). Both are in air, without
    the window or, with `calibration = "through_window"`, behind it; without a window they are those in the water.
    `die_radius_m`: each LED is a disc of this radius, normal to its axis, that shines evenly; 0 a point.
    """

    name: str = "led"
    position_m: Vector3
    look_at_m: Vector3
    roll_deg: float = 0.0
    radiant_flux_w: Positive | None = None
    radiant_intensity_w_per_sr: Positive | None = None
    half_angle_deg: Annotated[float, Field(ge=1, lt=90)] | None = None
    beam: Beam | None = None
    ies: File | None = None
    spectrum: str | Table = "LED-B3"
    die_radius_m: NonNegative = 0.0
    window: FlatLampWindow | DomeLampWindow | None = None
    array: Annotated[Ring | Grid, Field(discriminator="kind")] | None = None
    housing: Housing | None = None

    @model_validator(mode="after")
    def _usable(self):
        if (self.radiant_flux_w is None) == (self.radiant_intensity_w_per_sr is None):
            raise ValueError("give either radiant_flux_w or radiant_intensity_w_per_sr (on the axis)")
        if [self.half_angle_deg, self.beam, self.ies].count(None) != 2:
            raise ValueError("give one of half_angle_deg, beam = {angles_deg, values} and ies")
        _ = self.relative_spectrum, self.rig_from_lamp
        if self.die_radius_m > 0:
            _require_finite_radiance(self.profile, where=f"lamp {self.name}")
            self._require_room_for_dies()
        else:
            _ = self.profile
        if isinstance(self.window, DomeLampWindow) and (self.array is not None or self.die_radius_m > 0):
            raise ValueError(
                f"lamp {self.name}: array or die_radius_m behind a dome, allowed: one LED without extent at its centre"
            )
        if self.housing is not None and self.housing.radius_m < self.front_radius_m:
            raise ValueError(
                f"housing.radius_m: got {self.housing.radius_m:g}, allowed: at least {self.front_radius_m:g}, what the "
                f"front face of lamp {self.name} holds"
            )
        return self

    def _require_room_for_dies(self) -> None:
        if self.array is not None and self.array.spacing_m < 2 * self.die_radius_m:
            raise ValueError(
                f"die_radius_m: got {self.die_radius_m:g}, allowed: at most half the distance of LEDs, "
                f"{self.array.spacing_m / 2:g}"
            )
        highest_m = self.die_radius_m * float(np.sin(max(emitter.beam.tilt_rad for emitter in self._leds(_UNIT))))
        if self.window is not None and isinstance(self.window, FlatLampWindow) and highest_m >= self.window.air_gap_m:
            raise ValueError(
                f"die_radius_m: tilted dies reach {highest_m:g} m towards the window, allowed: below the air gap, "
                f"{self.window.air_gap_m:g} m"
            )

    @property
    def profile(self) -> np.ndarray:
        """Intensity relative to the axis at azimuths x angles, (1 or AZIMUTHS, 1801).

        Columns are `optics.lamp.PROFILE_ANGLES_DEG`, rows whole degrees of azimuth; one row is for all azimuths.
        """
        if self.ies is not None:
            return _ies_table(self.ies)
        if self.beam is not None:
            return lamps.profile_from_table(angles_deg=self.beam.angles_deg, values=self.beam.values)[None]
        return lamps.profile_from_half_angle(half_angle_deg=self.half_angle_deg)[None]

    @property
    def ies_table(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Azimuths (h,) and angles (v,) [deg] of the IES file, and its intensity relative to the axis, (h, v)."""
        photometry = ies.read(self.ies)
        return photometry.horizontal_deg, photometry.vertical_deg, photometry.intensity_cd / _axis_cd(photometry)

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
        """Radiant intensity over the whole spectrum: the sum over the LEDs, each on its own axis."""
        if self.radiant_intensity_w_per_sr is not None:
            return self.radiant_intensity_w_per_sr
        return lamps.intensity_from_flux(radiant_flux_w=self.radiant_flux_w, profile=self.profile.mean(axis=0))

    @property
    def rig_from_lamp(self) -> np.ndarray:
        """Pose of the lamp on the rig, beam along its +z axis, (4, 4)."""
        return pose.looking_at(self.position_m, self.look_at_m, roll_deg=self.roll_deg, where=f"lamp {self.name}")

    def _leds(self, beam: beam_profile.Beam) -> list[Emitter]:
        return [Emitter(beam, (0.0, 0.0))] if self.array is None else self.array.emitters(beam)

    @property
    def emitters(self) -> list[Emitter]:
        """The LEDs as `optics.lamp_array` has them, in the lamp's frame, all of the same intensity."""
        each = self.intensity_w_per_sr / len(self._leds(_UNIT))
        return self._leds(beam_profile.Beam(axis_intensity_w_per_sr=each, profile=self._profile))

    @property
    def _profile(self) -> beam_profile.Profile:
        if self.ies is not None:
            return beam_profile.from_ies(self.ies)
        if self.beam is not None:
            return beam_profile.from_table(angles_deg=self.beam.angles_deg, values=self.beam.values)
        return beam_profile.lambertian(half_angle_deg=self.half_angle_deg)

    @property
    def lamp_from_led(self) -> np.ndarray:
        """Pose of every LED in the lamp, its own beam along its +z axis, (count, 4, 4)."""
        return np.stack([pose.from_parts(e.beam.window_from_beam, (*e.position_m, 0.0)) for e in self._leds(_UNIT)])

    @property
    def dome_radius_m(self) -> float:
        """Radius of the dome that stands out of the front face; 0 without one."""
        return self.window.outer_radius_m if isinstance(self.window, DomeLampWindow) else 0.0

    @property
    def front_radius_m(self) -> float:
        """Radius of what stands in the front face: the window, or the LEDs where there is none."""
        if self.window is not None:
            return self.window.front_radius_m
        return max(float(np.hypot(*emitter.position_m)) for emitter in self._leds(_UNIT)) + self.die_radius_m

    @property
    def rig_from_front(self) -> np.ndarray:
        """Pose of the front face, where the housing begins, +z out of it into the water, (4, 4)."""
        return self.rig_from_lamp @ pose.from_parts(np.eye(3), (0.0, 0.0, self.window.front_m if self.window else 0.0))


_UNIT = beam_profile.Beam(axis_intensity_w_per_sr=1.0, profile=beam_profile.lambertian(half_angle_deg=60.0))


def _ies_table(path) -> np.ndarray:
    """Return the intensity in an IES file relative to the axis, (1 or AZIMUTHS, 1801).

    Raises ValueError for a missing or bad file, and for one without intensity on the axis.
    """
    if not path.is_file():
        raise ValueError(f"ies: {path} does not exist")
    beam_profile.from_ies(path)  # refuses a file without intensity on the axis
    photometry = ies.read(path)
    angles = lamps.PROFILE_ANGLES_DEG
    rows = [np.interp(angles, photometry.vertical_deg, row, left=0, right=0) for row in photometry.intensity_cd]
    shares = _shares(photometry) if len(rows) > 1 else np.eye(1)
    return shares @ np.stack(rows) / _axis_cd(photometry)


def _shares(photometry: ies.Photometry) -> np.ndarray:
    """Return what each plane of a file contributes to each azimuth, (AZIMUTHS, planes)."""
    # the file's symmetry, asked of the file itself: intensity 1 in one plane at a time, numbered by the angle
    number = np.arange(len(photometry.horizontal_deg))
    planes = ies.Photometry(number, photometry.horizontal_deg, np.eye(len(number)), {}, None)
    return planes.intensity(number, np.arange(AZIMUTHS)[:, None] * (360 / AZIMUTHS))


def _axis_cd(photometry: ies.Photometry) -> float:
    """Return the intensity at vertical angle 0, where all planes meet, as `beam_profile.from_ies` takes it. [cd]"""
    return float(np.mean(photometry.intensity(0.0, np.arange(360.0))))


def _require_finite_radiance(profile: np.ndarray, *, where: str) -> None:
    """Raise ValueError unless a profile (rows, 1801) falls to 90 degrees like the cosine or faster, 0 from there."""
    cosine = np.cos(np.radians(lamps.PROFILE_ANGLES_DEG))
    near, nearer = (np.searchsorted(lamps.PROFILE_ANGLES_DEG, angle) for angle in (88.99, 89.89))
    behind = profile[:, lamps.PROFILE_ANGLES_DEG >= 90].max()
    rises = np.any(profile[:, nearer] / cosine[nearer] > 1.01 * profile[:, near] / cosine[near])
    if behind > 1e-6 or rises:
        raise ValueError(
            f"{where}: die_radius_m with a profile that falls slower than the cosine towards 90 deg (infinite "
            "radiance), allowed: half_angle_deg up to 60, a table or ies that goes to 0 linearly or before 90 deg"
        )
