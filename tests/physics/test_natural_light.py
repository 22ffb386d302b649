"""Sun and sky through a flat surface, Snell's window, K_d."""

import math

import numpy as np
import pytest

from uwsim.optics import natural_light

WATER = 1.34


def test_surface_reflects_what_textbooks_say():
    """Expected: 2.1 % reflected at the zenith, 6 % at 60 deg, all at the horizon; 6.6 % of a uniform sky for 1.333,
    5.2 % of a cardioidal one. Tolerance: printed digits (Jerlov 1976; Mobley 1994). Negative control: no surface."""
    zenith = np.radians([0, 60, 90])
    reflected = 1 - natural_light.surface_transmittance(zenith, n_water=1.333)
    np.testing.assert_allclose(reflected, [0.0204, 0.0594, 1.0], atol=6e-4)
    assert 1 - natural_light.sky_transmittance(n_water=1.333) == pytest.approx(0.066, abs=5e-4)
    cardioidal = natural_light.sky_transmittance(n_water=1.333, sky=natural_light.cardioidal_sky)
    assert 1 - cardioidal == pytest.approx(0.052, abs=1e-3)
    assert natural_light.sky_transmittance(n_water=1.0) == pytest.approx(1, abs=1e-12)


def test_snells_window_holds_the_whole_sky():
    """Setup: eye below the surface under a uniform sky. Expected: half angle 48.6 deg (n 1.333); flux through the
    window = T times that of the sky (n^2 law); in equilibrium (same n^2-reduced radiance everywhere) no window is seen.
    Tolerance: quadrature 1e-4. Negative control: without n^2."""
    half = natural_light.snell_window_half_angle_rad(n_water=1.333)
    assert math.degrees(half) == pytest.approx(48.6, abs=0.05)
    angle = np.linspace(0, math.pi / 2, 200001)
    seen = natural_light.upward_view(angle, sky=np.ones_like, n_water=1.333)
    assert np.all(seen[angle > half + 1e-9] == 0) and np.all(seen[angle < half - 1e-3] > 0)
    flux = 2 * np.pi * np.trapezoid(seen * np.sin(angle) * np.cos(angle), angle)
    truth = np.pi * natural_light.sky_transmittance(n_water=1.333)
    assert flux == pytest.approx(truth, rel=1e-4)
    assert flux / 1.333**2 != pytest.approx(truth, rel=0.3)
    even = natural_light.upward_view(angle, sky=np.ones_like, n_water=1.333, upwelling_w_per_m2_sr=1.333**2)
    np.testing.assert_allclose(even, 1.333**2, rtol=1e-12)


def test_sun_and_sky_below_the_surface():
    """Expected: each its own transmittance; cosine of the sun by Snell; mean cosine between sun's and sky's 0.84.
    Tolerance: round-off. Negative control: the sun's cosine in air."""
    zenith = math.radians(60)
    below = natural_light.below_surface(direct_w_per_m2=0.5, diffuse_w_per_m2=0.2, sun_zenith_rad=zenith, n_water=WATER)
    assert below.direct_w_per_m2 == pytest.approx(0.5 * 0.939, abs=3e-4)
    assert below.diffuse_w_per_m2 == pytest.approx(0.2 * 0.9325, abs=5e-5)
    assert below.sun_cosine == pytest.approx(math.sqrt(1 - (math.sin(zenith) / WATER) ** 2), rel=1e-12)
    assert below.sun_cosine < below.mean_cosine < below.sky_cosine == pytest.approx(0.840, abs=5e-4)
    assert below.sun_cosine > 1.4 * math.cos(zenith)


def canonical_sun():
    """Return the lit surface of Mobley et al. 1993, Appl. Opt. 32:7484: sun at 60 deg, 0.5 W/m^2, black sky."""
    return natural_light.below_surface(
        direct_w_per_m2=0.5, diffuse_w_per_m2=0.0, sun_zenith_rad=math.radians(60), n_water=WATER
    )


def test_irradiance_at_depth_against_published_transport():
    """Setup: problem 2 of Mobley et al. 1993 (Petzold, albedo 0.9, c = 1 /m), E_d = .413 and .187 at 1 and 5 m.
    Expected: E_d by Kirk's and Lee's K_d. Tolerance: model 5 % (Kirk) and 12 % (Lee) of K_d, as the papers state for
    their fits. Negative controls: c for K_d (eq. 2.40 as printed), and molecular scattering (problem 1, .366 and
    .0433), for which Kirk's coefficients are not made."""
    published = math.log(0.413 / 0.187) / 4
    mean_cosine = float(canonical_sun().mean_cosine)
    kirk = natural_light.diffuse_attenuation_kirk1984(
        absorption_per_m=0.1, scattering_per_m=0.9, mean_cosine=mean_cosine
    )
    lee = natural_light.diffuse_attenuation_lee2005(
        absorption_per_m=0.1, backscattering_per_m=0.0183 * 0.9, sun_zenith_rad=math.radians(60)
    )
    assert kirk == pytest.approx(published, rel=0.05)
    assert lee == pytest.approx(published, rel=0.12)
    found = natural_light.irradiance_at_depth(
        surface_irradiance_w_per_m2=0.413, diffuse_attenuation_per_m=kirk, water_depth_m=4.0
    )
    assert found == pytest.approx(0.187, rel=0.03)
    too_dark = natural_light.irradiance_at_depth(
        surface_irradiance_w_per_m2=0.413, diffuse_attenuation_per_m=1.0, water_depth_m=4.0
    )
    assert too_dark < 0.1 * found
    assert kirk != pytest.approx(math.log(0.366 / 0.0433) / 4, rel=0.5)


def test_attenuation_has_the_published_coefficients():
    """Expected: by hand, Kirk with (0.425 * 0.8 - 0.190) a b = 0.15 * 0.09, Lee at 30 deg. Tolerance: round-off.
    Negative control: neighbouring arguments."""
    kirk, lee = natural_light.diffuse_attenuation_kirk1984, natural_light.diffuse_attenuation_lee2005
    found = kirk(absorption_per_m=0.1, scattering_per_m=0.9, mean_cosine=0.8)
    assert found == pytest.approx(math.sqrt(0.0235) / 0.8, rel=1e-12)
    assert kirk(absorption_per_m=0.1, scattering_per_m=0.9, mean_cosine=0.801) != pytest.approx(found, rel=1e-5)
    found = lee(absorption_per_m=0.1, backscattering_per_m=0.02, sun_zenith_rad=math.radians(30))
    assert found == pytest.approx(0.115 + 0.0836 * (1 - 0.52 * math.exp(-1.08)), rel=1e-12)
    other = lee(absorption_per_m=0.1, backscattering_per_m=0.02, sun_zenith_rad=math.radians(31))
    assert other != pytest.approx(found, rel=1e-5)


def test_limits_of_the_attenuation():
    """Expected: without scattering K_d = a / mu, the unscattered sun's; with it a/mu < K_d < c/mu. Tolerance:
    round-off. Negative control: the depth for the path."""
    below = canonical_sun()
    mu = float(below.sun_cosine)
    pure = natural_light.diffuse_attenuation_kirk1984(absorption_per_m=0.3, scattering_per_m=0.0, mean_cosine=mu)
    depth = np.array([0.0, 1.0, 7.0])
    deep = natural_light.irradiance_at_depth(
        surface_irradiance_w_per_m2=below.direct_w_per_m2, diffuse_attenuation_per_m=pure, water_depth_m=depth
    )
    beam = natural_light.unscattered_sun(
        direct_below_w_per_m2=below.direct_w_per_m2, attenuation_per_m=0.3, sun_cosine=mu, water_depth_m=depth
    )
    np.testing.assert_allclose(deep, beam, rtol=1e-12)
    assert np.all(deep[1:] < 0.95 * below.direct_w_per_m2 * np.exp(-0.3 * depth[1:]))
    turbid = natural_light.diffuse_attenuation_kirk1984(absorption_per_m=0.3, scattering_per_m=2.0, mean_cosine=mu)
    assert 0.3 / mu < turbid < 2.3 / mu
    spectral = natural_light.irradiance_at_depth(
        surface_irradiance_w_per_m2=np.ones(61),
        diffuse_attenuation_per_m=np.full(61, 0.2),
        water_depth_m=depth[:, None],
    )
    assert spectral.shape == (3, 61)


def test_night_and_negative_depths_are_refused():
    sun = {"direct_w_per_m2": 1.0, "diffuse_w_per_m2": 1.0, "sun_zenith_rad": 0.5, "n_water": WATER}
    for wrong in ({"sun_zenith_rad": math.pi / 2}, {"direct_w_per_m2": -1.0}, {"n_water": 0.9}):
        with pytest.raises(ValueError, match="got .*, allowed"):
            natural_light.below_surface(**(sun | wrong))
    with pytest.raises(ValueError, match="water_depth_m: got -1"):
        natural_light.irradiance_at_depth(
            surface_irradiance_w_per_m2=1.0, diffuse_attenuation_per_m=0.1, water_depth_m=-1.0
        )
    with pytest.raises(ValueError, match="sky irradiance: got 0"):
        natural_light.sky_transmittance(n_water=WATER, sky=np.zeros_like)
