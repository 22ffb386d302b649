"""Sun and sky through a flat water surface, Snell's window, and the decrease of daylight with depth.

Angles are from the vertical: zenith angles in air, `water_angle_rad` of a ray in the water.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from uwsim.optics.checks import require, require_index
from uwsim.optics.fresnel import critical_angle_rad, slab, snell

SkyRadiance = Callable[[np.ndarray], np.ndarray]
"""Zenith angle in air (...) [rad] -> radiance of the sky (...), mean over the azimuth. [W/(m^2 sr)]"""


class SurfaceIrradiance(NamedTuple):
    """Downwelling plane irradiance just below the surface, and the mean cosine of sun and sky there."""

    direct_w_per_m2: np.ndarray
    diffuse_w_per_m2: np.ndarray
    sun_cosine: np.ndarray
    sky_cosine: float

    @property
    def total_w_per_m2(self) -> np.ndarray:
        """Direct and diffuse together."""
        return self.direct_w_per_m2 + self.diffuse_w_per_m2

    @property
    def mean_cosine(self) -> np.ndarray:
        """Plane over scalar irradiance of the downwelling light; NaN where there is none."""
        scalar = self.direct_w_per_m2 / self.sun_cosine + self.diffuse_w_per_m2 / self.sky_cosine
        lit = np.asarray(scalar) > 0
        return np.where(lit, self.total_w_per_m2, np.nan) / np.where(lit, scalar, 1.0)


def snell_window_half_angle_rad(*, n_water: float) -> float:
    """Return the half angle of the cone that holds the whole sky, seen from below: 48.6 degrees for 1.333. [rad]"""
    return critical_angle_rad(n_from=n_water, n_to=1.0)


def surface_transmittance(zenith_rad: np.ndarray, *, n_water: float) -> np.ndarray:
    """Return the share of unpolarised flux that enters through a flat surface, (...) -> (...).

    Source: Fresnel equations. Valid: no waves, no foam.
    """
    return slab(zenith_rad, n_in=1.0, n_slab=n_water, n_out=n_water).transmittance


def sky_transmittance(*, n_water: float, sky: SkyRadiance = np.ones_like) -> float:
    """Return the share of the sky's irradiance that enters through a flat surface; a uniform sky unless given.

    Raises ValueError for a sky without light.
    Source: integral of T L cos over the hemisphere over that of L cos, Gauss-Legendre in the cosine (200 nodes).
    """
    _, incident, passed = _sky_flux(n_water=n_water, sky=sky)
    return float(np.sum(incident * passed) / np.sum(incident))


def sky_mean_cosine(*, n_water: float, sky: SkyRadiance = np.ones_like) -> float:
    """Return the mean cosine of the sky's light just below a flat surface, plane over scalar irradiance."""
    cosine, incident, passed = _sky_flux(n_water=n_water, sky=sky)
    refracted = np.cos(snell(np.arccos(cosine), n_from=1.0, n_to=n_water))
    return float(np.sum(incident * passed) / np.sum(incident * passed / refracted))


def _sky_flux(*, n_water: float, sky: SkyRadiance) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return cosines in air, the flux per node on a horizontal plane and its transmittance, (200,) each."""
    nodes, weights = np.polynomial.legendre.leggauss(200)
    cosine = 0.5 * (nodes + 1)
    zenith = np.arccos(cosine)
    incident = weights * cosine * require("sky radiance", sky(zenith), least=0)
    require("sky irradiance", np.sum(incident), above=0)
    return cosine, incident, surface_transmittance(zenith, n_water=n_water)


def cardioidal_sky(zenith_rad: np.ndarray) -> np.ndarray:
    """Return the relative radiance of an overcast sky, three times brighter above than at the horizon, (...).

    Source: Moon & Spencer 1942, (1 + 2 cos zenith) / 3.
    """
    return (1 + 2 * np.cos(zenith_rad)) / 3


def below_surface(
    *,
    direct_w_per_m2: np.ndarray,
    diffuse_w_per_m2: np.ndarray,
    sun_zenith_rad: float,
    n_water: float,
    sky: SkyRadiance = np.ones_like,
) -> SurfaceIrradiance:
    """Return downwelling irradiance below a flat surface from that of sun and sky on a horizontal plane above it.

    Light that the water returns and the surface reflects down again is left out (47 % of a uniform
    upwelling irradiance).
    Raises ValueError for negative irradiance and a sun at or below the horizon.
    """
    sun = require("sun_zenith_rad", sun_zenith_rad, least=0, below=math.pi / 2)
    direct = require("direct irradiance of the sun", direct_w_per_m2, least=0)
    diffuse = require("diffuse irradiance of the sky", diffuse_w_per_m2, least=0)
    return SurfaceIrradiance(
        direct_w_per_m2=direct * surface_transmittance(sun, n_water=n_water),
        diffuse_w_per_m2=diffuse * sky_transmittance(n_water=n_water, sky=sky),
        sun_cosine=np.cos(snell(sun, n_from=1.0, n_to=n_water)),
        sky_cosine=sky_mean_cosine(n_water=n_water, sky=sky),
    )


def diffuse_attenuation_kirk1984(
    *, absorption_per_m: np.ndarray, scattering_per_m: np.ndarray, mean_cosine: float
) -> np.ndarray:
    """Return K_d of downwelling irradiance at mid-depth of the lit layer, (...) -> (...). [1/m]

    `mean_cosine` of the light just below the surface (`SurfaceIrradiance.mean_cosine`).
    Source: Kirk 1984, Limnol. Oceanogr. 29:350, K_d = sqrt(a^2 + (0.425 mu - 0.190) a b) / mu.
    Valid: phase function like Petzold's San Diego harbour (b_b/b 0.02); wrong for molecular scattering.
    """
    a = require("absorption_per_m", absorption_per_m, least=0)
    b = require("scattering_per_m", scattering_per_m, least=0)
    mu = require("mean_cosine", mean_cosine, above=0.190 / 0.425, most=1)
    return np.sqrt(a * a + (0.425 * mu - 0.190) * a * b) / mu


def diffuse_attenuation_lee2005(
    *, absorption_per_m: np.ndarray, backscattering_per_m: np.ndarray, sun_zenith_rad: float
) -> np.ndarray:
    """Return K_d averaged down to 10 % of the surface irradiance, (...) -> (...). [1/m]

    Source: Lee, Du & Arnone 2005, J. Geophys. Res. 110:C02016, eq. 11, the zenith angle in air.
    Valid: ocean and coastal water under a clear sky (2 % on average, 12 % at most against transport).
    """
    a = require("absorption_per_m", absorption_per_m, least=0)
    b_b = require("backscattering_per_m", backscattering_per_m, least=0)
    sun = require("sun_zenith_rad", sun_zenith_rad, least=0, below=math.pi / 2)
    return (1 + 0.005 * math.degrees(sun)) * a + 4.18 * (1 - 0.52 * np.exp(-10.8 * a)) * b_b


def irradiance_at_depth(
    *, surface_irradiance_w_per_m2: np.ndarray, diffuse_attenuation_per_m: np.ndarray, water_depth_m: np.ndarray
) -> np.ndarray:
    """Return downwelling irradiance at a depth from that just below the surface. [W/m^2]

    Depths (...) and attenuation (...) broadcast: depths (n, 1) and K_d (61,) give (n, 61).
    Source: dissertation, eq. 2.40, as E(z) = E(0-) exp(-K_d z).
    Errata: printed with c, the loss of a narrow beam, along an unnamed distance; and with a convolution of itself
    added, which counts the scattered part twice.
    """
    start = require("irradiance below the surface", surface_irradiance_w_per_m2, least=0)
    loss = require("diffuse_attenuation_per_m", diffuse_attenuation_per_m, least=0)
    return start * np.exp(-loss * require("water_depth_m", water_depth_m, least=0))


def unscattered_sun(
    *, direct_below_w_per_m2: np.ndarray, attenuation_per_m: np.ndarray, sun_cosine: float, water_depth_m: np.ndarray
) -> np.ndarray:
    """Return the unscattered sun on a horizontal plane at a depth, E exp(-c z / mu). [W/m^2]

    Source: Beer-Lambert law along the refracted ray. Valid: collimated sun, flat surface.
    """
    start = require("direct irradiance below the surface", direct_below_w_per_m2, least=0)
    loss = require("attenuation_per_m", attenuation_per_m, least=0)
    cosine = require("sun_cosine", sun_cosine, above=0, most=1)
    return start * np.exp(-loss * require("water_depth_m", water_depth_m, least=0) / cosine)


def upward_view(
    water_angle_rad: np.ndarray, *, sky: SkyRadiance, n_water: float, upwelling_w_per_m2_sr: float = 0.0
) -> np.ndarray:
    """Return the radiance that reaches an eye just below the surface, looking up at an angle to the vertical, (...).

    Inside Snell's window n^2 T L_sky(theta_a) plus the reflected water; outside it the water's own upwelling radiance,
    totally reflected. [W/(m^2 sr)]
    Source: n^2 law of radiance with Fresnel transmittance.
    """
    require_index("water surface", n_water=n_water)
    require("upwelling radiance", upwelling_w_per_m2_sr, least=0)
    angle = require("water_angle_rad", water_angle_rad, least=0, most=math.pi / 2)
    inside = n_water * np.sin(angle) < 1
    zenith = np.arcsin(np.where(inside, n_water * np.sin(angle), 0.0))
    passed = np.where(inside, surface_transmittance(zenith, n_water=n_water), 0.0)
    return n_water**2 * passed * require("sky radiance", sky(zenith), least=0) + (1 - passed) * upwelling_w_per_m2_sr
