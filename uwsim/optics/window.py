"""Lamp behind a window: flat (air, glass, water) and dome; geometry, transmittance and intensity in the water."""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from uwsim.optics import fresnel
from uwsim.optics.beam_profile import Beam
from uwsim.optics.checks import require, require_index

Calibration = Literal["bare", "through_window"]
"""How the lamp's intensity in air was measured: without the window, or through it with air on both sides."""


def _require_ordered_indices(where: str, *, n_air: float, n_glass: float, n_water: float) -> None:
    require_index(where, n_air=n_air, n_glass=n_glass, n_water=n_water)
    if n_air > min(n_glass, n_water):
        got = f"n_air {n_air:g}, n_glass {n_glass:g}, n_water {n_water:g}"
        raise ValueError(f"{where}: got {got}, allowed: n_air not above the others")


@dataclass(frozen=True)
class FlatWindow:
    """Plane-parallel window, its normal through the origin: lamp side at z = -(air gap + thickness), water from z = 0.

    `air_gap_m` lamp to inner face, `radius_m` of the round exit aperture on the outer face, centred on the normal.
    Raises ValueError for a gap that is not positive, a negative thickness, indices below 1 or n_air above the others.
    """

    air_gap_m: float
    thickness_m: float
    n_glass: float
    n_water: float
    n_air: float = 1.0
    glass_absorption_per_m: float = 0.0
    radius_m: float = math.inf

    def __post_init__(self):
        require("flat window air_gap_m", self.air_gap_m, above=0)
        require("flat window thickness_m", self.thickness_m, least=0)
        require("flat window glass_absorption_per_m", self.glass_absorption_per_m, least=0)
        if self.radius_m != math.inf:
            require("flat window radius_m", self.radius_m, above=0)
        _require_ordered_indices("flat window", n_air=self.n_air, n_glass=self.n_glass, n_water=self.n_water)

    @property
    def glass_ratio(self) -> float:
        """Index of the glass relative to the air in the housing."""
        return self.n_glass / self.n_air

    @property
    def water_ratio(self) -> float:
        """Index of the water relative to the air in the housing, the n of eqs. 2.20-2.28."""
        return self.n_water / self.n_air

    @property
    def critical_angle_rad(self) -> float:
        """Largest angle to the normal at which a ray can enter the water; 90 degrees for equal indices. [rad]"""
        return math.asin(1 / self.water_ratio)

    @property
    def virtual_distance_m(self) -> float:
        """Distance of the paraxial virtual source behind the outer face. [m]

        Source: dissertation, eq. 2.19, d_w / n_w = d_a / n_a + t_g / n_g.
        Valid: rays near the normal.
        Errata: printed with transmittances for indices (1.04 d instead of 1.34 d) and without the glass; the virtual
        source recedes from the window, it does not move out into the water.
        """
        return self.n_water * (self.air_gap_m / self.n_air + self.thickness_m / self.n_glass)

    def water_angle_rad(self, air_angle_rad: np.ndarray) -> np.ndarray:
        """Return the angle in the water of rays at an angle in air, (...) -> (...). [rad]

        Source: dissertation, eq. 2.24. Valid: parallel faces, any glass.
        Errata: none; the printed form is right.
        """
        return fresnel.snell(air_angle_rad, n_from=self.n_air, n_to=self.n_water)

    def air_angle_rad(self, water_angle_rad: np.ndarray) -> np.ndarray:
        """Return the angle in air of rays at an angle in the water, (...) -> (...). [rad]

        Raises ValueError for a lamp beyond the critical angle: no direction in air leaves the window there.
        Source: dissertation, eq. 2.25, its inner arcsin.
        Errata: printed with n_a/n_w and theta_a, which gives theta_w back; n_w/n_a and theta_w.
        """
        return fresnel.snell(water_angle_rad, n_from=self.n_water, n_to=self.n_air)

    def exit_radius_m(self, air_angle_rad: np.ndarray) -> np.ndarray:
        """Return the distance from the lamp's foot at which a ray leaves the outer face, (...) -> (...). [m]"""
        glass_angle = fresnel.snell(air_angle_rad, n_from=self.n_air, n_to=self.n_glass)
        return self.air_gap_m * np.tan(air_angle_rad) + self.thickness_m * np.tan(glass_angle)

    def transmittance(self, air_angle_rad: np.ndarray, *, calibration: Calibration = "bare") -> np.ndarray:
        """Return the factor from flux measured in air to flux in the water, at the angle in air, (...) -> (...).

        `bare`: T of air, glass, water. `through_window`: its ratio to air, glass, air, above 1.
        Source: dissertation, eq. 2.18, its corrected form: `fresnel.slab`.
        Errata: printed as t_w/t_a without saying that this is a ratio, right (to the inter-reflections, 1.0400 for
        1.0383) only for a lamp measured in air through the same window; a bare lamp needs the product, 0.9543.
        """
        if calibration not in ("bare", "through_window"):
            raise ValueError(f"lamp calibration: got {calibration!r}, allowed: 'bare', 'through_window'")
        in_water = self._slab(air_angle_rad, self.n_water).transmittance
        if calibration == "bare":
            return in_water
        in_air = self._slab(air_angle_rad, self.n_air).transmittance
        return np.divide(in_water, in_air, out=np.zeros_like(in_water), where=in_air > 0)

    def _slab(self, air_angle_rad: np.ndarray, n_out: float) -> fresnel.SlabCoefficients:
        return fresnel.slab(
            air_angle_rad,
            n_in=self.n_air,
            n_slab=self.n_glass,
            n_out=n_out,
            absorption_per_m=self.glass_absorption_per_m,
            thickness_m=self.thickness_m,
        )

    def radiance_ratio(self, air_angle_rad: np.ndarray) -> np.ndarray:
        """Return radiance in the water over radiance in air along one ray, T (n_w/n_a)^2, (...) -> (...).

        Source: dissertation, eq. 2.20.
        Errata: printed with transmittances for indices and without T.
        """
        return self.transmittance(air_angle_rad) * self.water_ratio**2


def ray_directions(angle_rad: np.ndarray, azimuth_rad: np.ndarray) -> np.ndarray:
    """Return unit vectors at an angle to +z and an azimuth, (...) -> (..., 3)."""
    angle, azimuth = np.broadcast_arrays(angle_rad, azimuth_rad)
    sine = np.sin(angle)
    return np.stack([sine * np.cos(azimuth), sine * np.sin(azimuth), np.cos(angle)], axis=-1)


def water_intensity(
    beam: Beam,
    window: FlatWindow,
    *,
    water_angle_rad: np.ndarray,
    azimuth_rad: np.ndarray = 0.0,
    calibration: Calibration = "bare",
) -> np.ndarray:
    """Return the radiant intensity in the water behind a flat window, as seen from far away, (...) -> (...). [W/sr]

    I_w = T(theta_a) I_a(theta_a) (n_w/n_a)^2 cos theta_w / cos theta_a; 0 beyond the critical angle.
    Source: flux conservation, dPhi_w = T dPhi_a, with Snell's solid angles; relative to the axis: dissertation,
    eq. 2.25, f_w = f(theta_a) [T(theta_a)/T(0)] cos theta_w / cos theta_a.
    Errata: printed as f(theta_w), without Fresnel losses and without the cosines; for a Lambertian f alone the cosines
    make up for the angle.
    """
    angle = require("lamp field: water_angle_rad", water_angle_rad, least=0, most=math.pi / 2)
    sine = window.water_ratio * np.sin(angle)
    inside = sine < 1
    air_angle = np.arcsin(np.where(inside, sine, 0.0))
    passed = window.transmittance(air_angle, calibration=calibration)
    emitted = beam.intensity(ray_directions(air_angle, azimuth_rad))
    widened = window.water_ratio**2 * np.cos(angle) / np.cos(air_angle)
    return np.where(inside, passed * emitted * widened, 0.0)


@dataclass(frozen=True)
class DomeWindow:
    """Spherical window concentric with the lamp: every ray meets it along its normal, so none is refracted.

    No shift of the source, no n^2 and no change of solid angle; only the transmittance at normal incidence.
    `half_aperture_rad` limits the dome, seen from the lamp about +z.
    """

    inner_radius_m: float
    thickness_m: float
    n_glass: float
    n_water: float
    n_air: float = 1.0
    glass_absorption_per_m: float = 0.0
    half_aperture_rad: float = math.pi / 2

    def __post_init__(self):
        require("dome window inner_radius_m", self.inner_radius_m, above=0)
        require("dome window thickness_m", self.thickness_m, least=0)
        require("dome window glass_absorption_per_m", self.glass_absorption_per_m, least=0)
        require("dome window half_aperture_rad", self.half_aperture_rad, above=0, most=math.pi)
        _require_ordered_indices("dome window", n_air=self.n_air, n_glass=self.n_glass, n_water=self.n_water)

    @property
    def outer_radius_m(self) -> float:
        """Where the water begins. [m]"""
        return self.inner_radius_m + self.thickness_m

    @property
    def transmittance(self) -> float:
        """Share of the flux that enters the water, inter-reflections included."""
        slab = fresnel.slab(
            np.zeros(()),
            n_in=self.n_air,
            n_slab=self.n_glass,
            n_out=self.n_water,
            absorption_per_m=self.glass_absorption_per_m,
            thickness_m=self.thickness_m,
        )
        return float(slab.transmittance)
