"""Reflection, refraction and absorption at interfaces and windows; refractive indices."""

import math

import numpy as np
import pytest

from tests.references.tables import read_table
from uwsim.optics import fresnel, refractive_index

WATER = 1.34
# printed digits of the reference: 6 decimals
DIGITS = 5.1e-7


def rows(glass):
    return [row for row in read_table("oracle_fresnel_window") if row["glass"] == glass]


def column(glass, name):
    return np.array([float(row[name]) for row in rows(glass)])


@pytest.mark.parametrize("glass", ["BK7", "PMMA"])
def test_window_agrees_with_the_reference(glass):
    """Setup: clear window between air and water or air, 0-85 deg. Expected: reference table.
    Tolerance: printed digits."""
    n_glass, angle = column(glass, "n_glass")[0], np.radians(column(glass, "theta_air_deg"))
    water = fresnel.slab(angle, n_in=1.0, n_slab=n_glass, n_out=WATER)
    air = fresnel.slab(angle, n_in=1.0, n_slab=n_glass, n_out=1.0)
    refracted = fresnel.snell(angle, n_from=1.0, n_to=WATER)
    for found, name in (
        (water.transmittance, "T_air_glass_water_unpol"),
        (water.transmittance_by_polarisation.s, "T_s"),
        (water.transmittance_by_polarisation.p, "T_p"),
        (water.reflectance, "R_total_unpol"),
        (air.transmittance, "T_air_glass_air_unpol"),
        (water.transmittance / air.transmittance, "ratio_water_over_air"),
        (WATER**2 * np.cos(refracted) / np.cos(angle), "dOmega_air_over_dOmega_water"),
    ):
        np.testing.assert_allclose(found, column(glass, name), rtol=0, atol=DIGITS, err_msg=name)
    np.testing.assert_allclose(np.degrees(refracted), column(glass, "theta_water_deg"), rtol=0, atol=5.1e-5)


def test_product_of_mean_transmittances_is_not_the_window():
    """Negative control: averaging polarisations before the product, or leaving inter-reflections out, is seen."""
    angle = np.radians(column("BK7", "theta_air_deg"))
    truth = column("BK7", "T_air_glass_water_unpol")
    inside = fresnel.snell(angle, n_from=1.0, n_to=1.5168)
    first = fresnel.interface_reflectance(angle, n_from=1.0, n_to=1.5168)
    second = fresnel.interface_reflectance(inside, n_from=1.5168, n_to=WATER)
    mean = (1 - np.mean(first, axis=0)) * (1 - np.mean(second, axis=0))
    single = np.mean((1 - np.array(first)) * (1 - np.array(second)), axis=0)
    np.testing.assert_allclose(single, column("BK7", "T_without_interreflection"), rtol=0, atol=DIGITS)
    assert not np.allclose(single, truth, rtol=0, atol=1e-4)
    assert not np.allclose(mean, truth, rtol=0, atol=1e-3)


@pytest.mark.parametrize(("n_in", "n_out"), [(1.0, 1.34), (1.34, 1.0), (1.0, 1.0), (1.6, 1.34), (1.0, 1.5)])
def test_energy_is_kept(n_in, n_out):
    """Setup: clear slab of n = 1.5, 0-90 deg, also beyond the critical angle. Expected: R + T = 1, T the same in
    both directions along one ray. Tolerance: round-off."""
    angle = np.linspace(0, math.pi / 2, 181)
    one = fresnel.slab(angle, n_in=n_in, n_slab=1.5, n_out=n_out)
    np.testing.assert_allclose(one.transmittance + one.reflectance, 1, atol=1e-14)
    assert np.all(one.transmittance >= 0) and np.all(one.reflectance >= 0)
    passes = n_in * np.sin(angle) < 0.9999 * min(n_out, 1.5)
    far = fresnel.snell(angle[passes], n_from=n_in, n_to=n_out)
    back = fresnel.slab(far, n_in=n_out, n_slab=1.5, n_out=n_in)
    np.testing.assert_allclose(back.transmittance, one.transmittance[passes], atol=1e-12)
    beyond = n_in * np.sin(angle) > 1.0001 * n_out
    assert np.all(one.transmittance[beyond] == 0)


def test_glass_absorbs_along_the_refracted_ray():
    """Setup: index-matched slab, so nothing is reflected. Expected: exp(-alpha t / cos). Tolerance: round-off.
    Negative control: the thickness for the path."""
    angle = np.radians([0, 30, 60])
    found = fresnel.slab(angle, n_in=1.5, n_slab=1.5, n_out=1.5, absorption_per_m=20.0, thickness_m=0.01)
    np.testing.assert_allclose(found.transmittance, np.exp(-0.2 / np.cos(angle)), rtol=1e-12)
    assert not np.allclose(found.transmittance, np.exp(-0.2), rtol=1e-2)
    lossy = fresnel.slab(angle, n_in=1.0, n_slab=1.5, n_out=1.34, absorption_per_m=20.0, thickness_m=0.01)
    assert np.all(lossy.transmittance + lossy.reflectance < 0.9)


@pytest.mark.parametrize("name", ["s", "p"])
def test_an_absorbing_slab_is_the_sum_of_its_bounces(name):
    """Expected: light followed through 60 reflections, each crossing of the glass costing A = exp(-alpha t / cos).
    Tolerance: round-off. Negative control: A once per round trip."""
    angle = math.radians(75)
    inside = math.asin(math.sin(angle) / 1.5)
    first = float(getattr(fresnel.interface_reflectance(angle, n_from=1.0, n_to=1.5), name))
    second = float(getattr(fresnel.interface_reflectance(inside, n_from=1.5, n_to=1.2), name))

    def followed(back):
        out, returned, going = 0.0, first, (1 - first) * crossing
        for _ in range(60):
            out += going * (1 - second)
            arriving = going * second * back
            returned += arriving * (1 - first)
            going = arriving * first * crossing
        return out, returned

    crossing = math.exp(-20.0 * 0.01 / math.cos(inside))
    found = fresnel.slab(angle, n_in=1.0, n_slab=1.5, n_out=1.2, absorption_per_m=20.0, thickness_m=0.01)
    pair = [getattr(found.transmittance_by_polarisation, name), getattr(found.reflectance_by_polarisation, name)]
    np.testing.assert_allclose(pair, followed(crossing), rtol=1e-12)
    assert not np.any(np.isclose(pair, followed(1.0), rtol=1e-6))


def test_polarisations_at_special_angles():
    """Expected: Brewster's angle passes all p; equal reflectances at 0 deg, the share of eqs. 2.16-2.17."""
    brewster = math.atan(1.5)
    assert fresnel.interface_reflectance(brewster, n_from=1.0, n_to=1.5).p == pytest.approx(0, abs=1e-30)
    assert fresnel.interface_reflectance(brewster, n_from=1.0, n_to=1.5).s > 0.1
    s, p = fresnel.interface_reflectance(0.0, n_from=1.0, n_to=1.5)
    assert s == pytest.approx(0.04, rel=1e-12) and p == pytest.approx(0.04, rel=1e-12)
    assert fresnel.normal_transmittance(n_from=1.0, n_to=1.5) == pytest.approx(0.96, rel=1e-12)


def test_lambertian_light_through_windows():
    """Expected: 0.9024 into water, 0.8471 into air behind BK7. Tolerance: printed digits."""
    assert fresnel.lambertian_transmittance(n_in=1.0, n_slab=1.5168, n_out=WATER) == pytest.approx(0.9024, abs=5e-5)
    assert fresnel.lambertian_transmittance(n_in=1.0, n_slab=1.5168, n_out=1.0) == pytest.approx(0.8471, abs=5e-5)


def test_rays_that_cannot_leave_are_refused_or_dark():
    critical = fresnel.critical_angle_rad(n_from=WATER, n_to=1.0)
    assert math.degrees(critical) == pytest.approx(48.268, abs=1e-3)
    assert fresnel.snell(critical, n_from=WATER, n_to=1.0) == pytest.approx(math.pi / 2)
    with pytest.raises(ValueError, match="got 50 deg, allowed: up to the critical angle 48.27 deg"):
        fresnel.snell(math.radians(50), n_from=WATER, n_to=1.0)
    with pytest.raises(ValueError, match="n_from above n_to"):
        fresnel.critical_angle_rad(n_from=1.0, n_to=WATER)
    assert fresnel.slab(math.radians(50), n_in=WATER, n_slab=1.5, n_out=1.0).transmittance == 0
    with pytest.raises(ValueError, match="n_slab: got 0.9, allowed: finite, at least 1"):
        fresnel.slab(0.0, n_in=1.0, n_slab=0.9, n_out=1.0)
    with pytest.raises(ValueError, match="thickness_m: got -0.01"):
        fresnel.slab(0.0, n_in=1.0, n_slab=1.5, n_out=1.0, thickness_m=-0.01)
    with pytest.raises(ValueError, match="angle_rad: got -0.1"):
        fresnel.interface_reflectance(-0.1, n_from=1.0, n_to=1.5)


def test_refractive_indices_are_those_published():
    """Expected: water at the sodium line 1.3330, the catalogue's n_d = 1.51680 and n_F = 1.52238 of N-BK7, acrylic
    within 0.003 of 1.491. Tolerance: printed digits. Negative control: sea water."""
    assert refractive_index.water_quan1995(589.3, temperature_c=20, salinity_psu=0) == pytest.approx(1.3330, abs=5e-5)
    assert refractive_index.water_quan1995(589.3, temperature_c=20, salinity_psu=35) == pytest.approx(1.3394, abs=5e-4)
    assert refractive_index.glass_nbk7(587.6) == pytest.approx(1.51680, abs=5e-6)
    assert refractive_index.glass_nbk7(486.1) == pytest.approx(1.52238, abs=5e-6)
    for acrylic in (refractive_index.acrylic_beadie2015, refractive_index.acrylic_sultanova2009):
        assert acrylic(589.3) == pytest.approx(1.491, abs=3e-3)
    wave = np.array([440.0, 550.0, 650.0])
    # refractiveindex.info and the formula of Quan & Fry 1995, 5 decimals
    found = refractive_index.water_quan1995(wave[:2], temperature_c=20, salinity_psu=35)
    np.testing.assert_allclose(found, [1.34656, 1.34079], atol=5.1e-6)
    np.testing.assert_allclose(refractive_index.acrylic_beadie2015(wave[:2]), [1.50264, 1.49428], atol=5.1e-6)
    np.testing.assert_allclose(refractive_index.acrylic_sultanova2009(wave[:2]), [1.50175, 1.49259], atol=5.1e-6)
    for wrong in ({"temperature_c": 31, "salinity_psu": 0}, {"temperature_c": 20, "salinity_psu": 36}):
        with pytest.raises(ValueError, match="refractive index of water"):
            refractive_index.water_quan1995(550, **wrong)
    for index in (refractive_index.acrylic_sultanova2009, refractive_index.acrylic_beadie2015):
        with pytest.raises(ValueError, match="wavelength_nm: got 400, allowed"):
            index(np.array([400.0, 500.0]))
