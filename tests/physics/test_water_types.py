"""Waters have the coefficients that are printed, in the order of their murkiness, and refuse what no table holds.

Tolerances: printed digits of the tables; round-off elsewhere, unless a test names another.
"""

import json

import numpy as np
import pytest

from uwsim.optics import constituents, describe, jerlov, phase, pure_water, turbidity
from uwsim.optics.phase_functions.petzold import petzold
from uwsim.optics.spectrum import WAVELENGTHS_NM
from uwsim.optics.water import Water, named_water, petzold_mixture, water_type_names

GREEN = int(np.flatnonzero(WAVELENGTHS_NM == 550)[0])
FLAT = np.ones(61)


def at(wavelength_nm, values):
    return values[list(WAVELENGTHS_NM).index(wavelength_nm)]


@pytest.mark.parametrize(
    ("spectrum", "wavelength_nm", "printed"),
    [
        (pure_water.absorption_pope1997, 417.5, 0.00442),
        (pure_water.absorption_pope1997, 550.0, 0.0565),
        (pure_water.absorption_pope1997, 700.0, 0.624),
        (pure_water.absorption_mason2016, 400.0, 0.00222),
        (pure_water.absorption_smith1981, 400.0, 0.0171),
        (pure_water.scattering_smith1981, 500.0, 0.00290269),
        (pure_water.scattering_morel1974, 500.0, 0.00288),
    ],
)
def test_water_itself_has_the_printed_values(spectrum, wavelength_nm, printed):
    """Negative control: the value 20 nm away is another."""
    assert spectrum(np.asarray(wavelength_nm)) == pytest.approx(printed, rel=1e-6)
    assert spectrum(np.asarray(wavelength_nm - 20)) != pytest.approx(printed, rel=1e-2)


def test_pure_water_is_not_004_per_metre_in_the_blue():
    """Expected: 0.0098-0.0114 /m over 462-475 nm, where 0.04 /m has been printed."""
    blue = pure_water.absorption_pope1997(np.linspace(462.5, 475, 11))
    assert np.all((blue > 0.0095) & (blue < 0.0115))


def test_scattering_of_water_follows_salinity_and_temperature():
    """Expected: Zhang et al. 2009 at 500 nm and 20 C: 0.0019575 (fresh) and 0.0025473 /m (salinity 35), b falling as
    lambda^-4.2; the stored table of fresh water to its digits. At 5 C 3.9 % more.
    Negative control: salinity 30."""
    wave = np.array([450.0, 500.0, 600.0])
    fresh, sea, other = (
        pure_water.scattering_zhang2009(wave, temperature_c=20, salinity_psu=salinity) for salinity in (0, 35, 30)
    )
    assert [fresh[1], sea[1]] == pytest.approx([0.00195751, 0.00254734], rel=3e-6)
    assert other[1] != pytest.approx(0.00254734, rel=1e-3)
    assert np.log(sea[2] / sea[0]) / np.log(450 / 600) == pytest.approx(4.21, abs=0.01)
    stored = named_water("tank_low", particle_factor=0).scattering
    ours = pure_water.scattering_zhang2009(WAVELENGTHS_NM, temperature_c=20, salinity_psu=0)
    np.testing.assert_allclose(stored, ours, rtol=5e-6)
    cold = pure_water.scattering_zhang2009(wave, temperature_c=5, salinity_psu=35)
    assert cold / sea == pytest.approx(np.full(3, 1.0393), abs=5e-4)


def test_absorption_of_water_follows_salinity_and_temperature():
    """Expected: at 740 nm +2.9 % for 5 K, at 700 nm -1.0 % for salinity 35; nothing in the blue."""

    def a(wavelength_nm, temperature_c, salinity_psu):
        wave = np.asarray(wavelength_nm)
        return pure_water.absorption_roettgers2016(wave, temperature_c=temperature_c, salinity_psu=salinity_psu)

    assert a(740.0, 25, 0) / a(740.0, 20, 0) == pytest.approx(1.0288, abs=1e-4)
    assert a(700.0, 20, 35) / a(700.0, 20, 0) == pytest.approx(0.9903, abs=1e-4)
    assert a(420.0, 20, 35) == pytest.approx(a(420.0, 20, 0), rel=1e-12)
    assert a(700.0, 20, 0) == pytest.approx(0.6126, rel=1e-9)


@pytest.mark.parametrize(
    ("water_type", "source", "wavelength_nm", "a", "b"),
    [
        ("III", "williamson2022", 550, 0.0878, 0.287),
        ("III", "solonenko2015", 550, 0.0646, 0.98),
        ("II", "williamson2022", 550, 0.0724, 0.177),
        ("II", "solonenko2015", 550, 0.0622, 0.358),
        ("5C", "williamson2022", 550, 0.159, 1.19),
        ("5C", "solonenko2015", 550, 0.117, 1.33),
        ("I", "solonenko2015", 700, 0.582, 0.000685),
        ("9C", "solonenko2015", 400, 1.613, 5.36),
        ("IB", "williamson2022", 415, 0.0433, 0.141),
    ],
)
def test_jerlov_types_have_the_printed_coefficients(water_type, source, wavelength_nm, a, b):
    found = jerlov.coefficients(water_type, np.asarray(float(wavelength_nm)), source=source)
    assert found == pytest.approx((a, b), rel=1e-9)
    other = jerlov.coefficients(
        water_type, np.asarray(wavelength_nm - 15.0 if wavelength_nm > 500 else 440.0), source=source
    )
    assert other != pytest.approx((a, b), rel=1e-3)


def test_jerlov_waters_use_their_tables_and_the_source_can_be_chosen():
    default, rival = named_water("jerlov_III"), named_water("jerlov_III", source="solonenko2015")
    assert (at(550, default.scattering), at(550, rival.scattering)) == pytest.approx((0.287, 0.98))
    assert (at(550, default.absorption), at(550, rival.absorption)) == pytest.approx((0.0878, 0.0646))
    assert "williamson2022" in default.name and "solonenko2015" in rival.name
    assert at(550, named_water("jerlov_9C").scattering) == pytest.approx(3.12)
    assert [t for t in jerlov.TYPES if jerlov.default_source(t) == "williamson2022"] == [
        "IB",
        "II",
        "III",
        "1C",
        "3C",
        "5C",
    ]


@pytest.mark.parametrize(
    ("water_type", "source", "wavelength_nm", "printed"),
    [
        ("I", "jerlov1976", 400, 0.028),
        ("III", "jerlov1976", 550, 0.12),
        ("9C", "jerlov1976", 350, 3.9),
        ("IA", "austin1986", 500, 0.0332),
        ("1C", "austin1986", 700, 0.6896),
    ],
)
def test_diffuse_attenuation_has_the_printed_values(water_type, source, wavelength_nm, printed):
    assert jerlov.diffuse_attenuation(water_type, np.asarray(float(wavelength_nm)), source=source) == printed


def test_type_9c_is_murkier_than_type_i():
    """Expected: c rises I < IA < IB < II < III and 1C < 3C < 5C < 7C < 9C at 550 nm, 9C above I at every wavelength.
    So 9C lets less light through 2 m. Negative control: c^d, c taken for a transmittance per metre, puts I below 9C."""
    c = {name: named_water(f"jerlov_{name}").attenuation for name in jerlov.TYPES}
    for order in (jerlov.TYPES[:5], jerlov.TYPES[5:]):
        green = [at(550, c[name]) for name in order]
        assert green == sorted(green) and len(set(green)) == len(green)
    assert np.all(c["9C"] > c["I"]) and np.all(c["9C"] > 2 * c["III"])
    clear, murky = (named_water(f"jerlov_{name}").transmittance(path_m=2.0) for name in ("I", "9C"))
    assert np.all(murky < clear) and not np.any(c["9C"] ** 2 < c["I"] ** 2)
    kd = [jerlov.diffuse_attenuation(name, np.asarray(450.0)) for name in jerlov.TYPES]
    assert kd == sorted(kd)


@pytest.mark.parametrize("name", water_type_names())
def test_attenuation_is_not_a_transmittance_per_metre(name):
    """Expected: exp(-c d), so that two metres let through the square of one, twice the coefficients as much as twice
    the path. Negative control: c^d, the coefficient taken for a transmittance, is another curve."""
    water = named_water(name)
    one, two = water.transmittance(path_m=1.0), water.transmittance(path_m=2.0)
    np.testing.assert_allclose(two, one**2, rtol=1e-12)
    np.testing.assert_allclose(-np.log(one), water.attenuation, rtol=1e-12)
    assert np.all(two < one) and np.all(water.transmittance(path_m=0.0) == 1)
    murkier = Water(water.name, 2 * water.absorption, 2 * water.scattering, water.phase)
    np.testing.assert_allclose(murkier.transmittance(path_m=1.0), two, rtol=1e-12)
    assert not np.allclose(water.attenuation, one, rtol=0, atol=0.05)


@pytest.mark.parametrize("name", water_type_names())
def test_every_named_water_is_whole(name):
    """Expected: spectra of 61 finite values, b = b_f + b_b, phase function that integrates to 1 with the stated share
    behind 90 deg. Tolerance: the trapezium rule."""
    water = named_water(name)
    assert water.absorption.shape == water.scattering.shape == (61,)
    assert np.all(water.single_scattering_albedo < 1) and np.all(water.attenuation > 0)
    assert np.all(water.backscattering <= water.scattering * (0.5 + 1e-9))
    np.testing.assert_allclose(water.forward_scattering + water.backscattering, water.scattering, rtol=1e-12)
    s = np.concatenate([[0], np.geomspace(1e-12, 1, 20001)])
    share = 4 * np.pi * np.trapezoid(water.volume_scattering(1 - 2 * s), s, axis=0)
    np.testing.assert_allclose(share, water.scattering, rtol=1e-4)
    behind = 4 * np.pi * np.trapezoid(water.volume_scattering(1 - 2 * s[s >= 0.5]), s[s >= 0.5], axis=0)
    np.testing.assert_allclose(behind, water.backscattering, rtol=5e-3)


@pytest.mark.parametrize(("name", "c_550"), [("clear", 0.2), ("low", 1), ("medium", 3), ("high", 6)])
def test_tank_waters_keep_their_attenuation(name, c_550):
    assert at(550, named_water(f"tank_{name}").attenuation) == pytest.approx(c_550, abs=1e-3)


@pytest.mark.parametrize(
    ("water", "c_530", "b_530"), [("clear", 0.151, 0.037), ("coastal", 0.398, 0.219), ("harbor", 2.19, 1.824)]
)
def test_petzold_waters_have_the_published_coefficients_at_530_nm(water, c_530, b_530):
    """Negative control: at 560 nm they are others. The volume scattering function at 530 nm follows the table
    within the worst angle of the fit (20 %) and what separates b of the report from that of its table."""
    named = named_water(f"petzold_{water}")
    assert (at(530, named.attenuation), at(530, named.scattering)) == pytest.approx((c_530, b_530), rel=1e-9)
    assert at(560, named.scattering) != pytest.approx(b_530, rel=1e-2)
    table = petzold(water)
    vsf = named.volume_scattering(np.cos(table.angles_rad))[:, list(WAVELENGTHS_NM).index(530)]
    np.testing.assert_allclose(vsf, table.vsf, rtol=0.23)


def test_constituents_have_the_printed_coefficients():
    """Expected: A and B, E of the tables at Chl = 1 and 2 mg/m3. Negative control: 1 - E for E."""
    wave = np.asarray(440.0)
    one, two = (constituents.phytoplankton_absorption_bricaud1995(wave, chlorophyll_mg_per_m3=c) for c in (1, 2))
    assert (one, two) == pytest.approx((0.0403, 0.0403 * 2**0.668))
    one, two = (constituents.particle_absorption_bricaud1998(wave, chlorophyll_mg_per_m3=c) for c in (1, 2))
    assert (one, two) == pytest.approx((0.0520, 0.0520 * 2**0.635))
    assert two != pytest.approx(0.0520 * 2**0.365, rel=0.05)
    cdom = constituents.cdom_absorption(np.array([440.0, 540.0]), absorption_440_per_m=0.1)
    assert cdom == pytest.approx([0.1, 0.1 * np.exp(-1.4)])
    b = constituents.particle_scattering_gordon1983(np.array([550.0, 440.0]), chlorophyll_mg_per_m3=2.0)
    assert b == pytest.approx(0.30 * 2**0.62 * np.array([1, 550 / 440]))
    b = constituents.particle_scattering_loisel1998(np.array([550.0, 440.0]), chlorophyll_mg_per_m3=0.5)
    exponent = 0.5 * (np.log10(0.5) - 0.3)
    assert b == pytest.approx(0.416 * 0.5**0.766 * np.array([1, 0.8**exponent]))
    minerals = constituents.mineral_scattering_babin2003(np.asarray(555.0), concentration_g_per_m3=4.0)
    assert minerals == pytest.approx(2.0)


def test_natural_water_is_the_sum_of_its_constituents():
    """Expected: eq. 2.2 and 2.4 term by term; nothing but water without constituents; phases mixed by b."""
    pure, rich = (
        constituents.natural_water(
            chlorophyll_mg_per_m3=c, cdom_440_per_m=g, non_algal_440_per_m=n, minerals_g_per_m3=m
        )
        for c, g, n, m in ((0, 0, 0, 0), (1.0, 0.05, 0.02, 0.5))
    )
    wave = WAVELENGTHS_NM
    added = (
        constituents.phytoplankton_absorption_bricaud1995(wave, chlorophyll_mg_per_m3=1.0)
        + constituents.cdom_absorption(wave, absorption_440_per_m=0.05)
        + constituents.non_algal_absorption(wave, absorption_440_per_m=0.02)
    )
    np.testing.assert_allclose(rich.absorption - pure.absorption, added, rtol=1e-9)
    sea = pure_water.scattering_zhang2009(wave, temperature_c=20, salinity_psu=35)
    np.testing.assert_allclose(pure.scattering, sea, rtol=1e-12)
    assert pure.phase.backscatter_fraction == pytest.approx(np.full(61, 0.5), abs=1e-9)
    share = sea / rich.scattering
    particles = petzold_mixture("average").backscatter_fraction
    np.testing.assert_allclose(rich.phase.backscatter_fraction, share * 0.5 + (1 - share) * particles, rtol=1e-6)
    detritus = constituents.natural_water(chlorophyll_mg_per_m3=1.0, particle_absorption="bricaud1998")
    assert np.all(detritus.absorption > pure.absorption)


def test_turbidity_is_continuous_and_meets_the_tank_waters():
    """Expected: c linear in mass, the tank waters within 0.1 % at 0.27-11.2 g/m3 (rounded masses). Negative control:
    twice the mass."""
    for mass, c_550 in ((0.2685, 0.2), (1.779, 1.0), (5.550, 3.0), (11.22, 6.0)):
        assert at(550, turbidity.turbid_water(minerals_g_per_m3=mass).attenuation) == pytest.approx(c_550, rel=1e-3)
        assert at(550, turbidity.turbid_water(minerals_g_per_m3=2 * mass).attenuation) > 1.5 * c_550
    clear, one, two = (turbidity.turbid_water(minerals_g_per_m3=mass).attenuation for mass in (0, 1, 2))
    np.testing.assert_allclose(two - one, one - clear, rtol=1e-9)
    scattering = at(550, turbidity.turbid_water(minerals_g_per_m3=4.0).scattering)
    assert turbidity.approximate_ntu(scattering) == pytest.approx(2.0, rel=0.01)
    assert turbidity.approximate_ntu(0.0) == 0


def test_eqs_2_1_and_2_38_are_natural_logarithms():
    """Expected: a from a long path as from a short one; a decadic absorbance of 1 on 1 m is 2.303 /m. Negative control:
    the printed difference quotient loses a third at one optical depth."""
    for path in (1e-3, 2.0):
        out = np.exp(-0.5 * path)
        assert constituents.coefficient_from_loss(flux_in=1.0, flux_out=out, path_m=path) == pytest.approx(
            0.5, rel=1e-9
        )
    assert (1 - np.exp(-1.0)) / 2.0 < 0.7 * 0.5
    assert constituents.absorption_from_absorbance(np.asarray(1.0), path_m=1.0) == pytest.approx(2.302585, abs=1e-6)


def test_a_water_is_described_in_numbers_and_text():
    numbers = json.loads(json.dumps(describe.describe_named("jerlov_III"), allow_nan=False))
    assert numbers["wavelengths_nm"][0] == 400 and numbers["wavelengths_nm"][-1] == 700
    assert numbers["at_550_nm"]["attenuation_per_m"] == pytest.approx(0.3748)
    text = describe.as_text(numbers)
    assert "Williamson & Hollins" in text and "0.37480" in text
    rival = describe.describe_named("jerlov_III", source="solonenko2015")
    assert "Solonenko" in rival["source"] and "Williamson" not in rival["source"]


def test_the_command_prints_and_draws_a_water(tmp_path, capsys):
    from uwsim import cli

    picture, numbers = tmp_path / "w.png", tmp_path / "w.json"
    cli.water("petzold_harbor", out=picture, particle_factor=1.0, source=None, json=str(numbers))
    assert "petzold_harbor" in capsys.readouterr().out
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert json.loads(numbers.read_text())["at_550_nm"]["mean_cosine"] == pytest.approx(0.9194, abs=1e-4)
    with pytest.raises(ValueError, match="allowed: a name that ends in .png"):
        cli.water("petzold_harbor", out=tmp_path / "w.jpg", particle_factor=1.0, source=None, json=None)


MOLECULES = phase.molecular()


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Water("w", -FLAT, FLAT, MOLECULES), "absorption has a minimum of -1, allowed: >= 0"),
        (lambda: Water("w", FLAT, FLAT * np.nan, MOLECULES), "scattering has a minimum of nan"),
        (lambda: Water("w", FLAT * np.inf, FLAT, MOLECULES), "absorption has"),
        (lambda: Water("w", FLAT[:5], FLAT, MOLECULES), r"shape \(5,\), allowed: \(61,\)"),
        (lambda: named_water("jerlov_X"), "got 'jerlov_X', allowed: jerlov_1C"),
        (lambda: named_water("jerlov_I", particle_factor=2.0), "particle_factor is 2.0, allowed: 1"),
        (lambda: named_water("tank_low", particle_factor=-1.0), "allowed: >= 0"),
        (lambda: named_water("tank_low", source="williamson2022"), "allowed: none"),
        (lambda: named_water("jerlov_9C", source="williamson2022"), "got '9C', allowed: IB, II"),
        (lambda: named_water("jerlov_5C", source="solonenko2015"), "no value is printed at 600, 625"),
        (lambda: named_water("jerlov_3C", source="solonenko2015"), "no value is printed at 675, 700"),
        (lambda: named_water("jerlov_III", source="jerlov1976"), "source: got 'jerlov1976'"),
        (lambda: jerlov.coefficients("III", np.asarray(810.0)), "got 810 nm, allowed: 300-800 nm"),
        (lambda: jerlov.diffuse_attenuation("7C", np.asarray(330.0)), "no value is printed at 310"),
        (lambda: jerlov.diffuse_attenuation("9C", np.asarray(500.0), source="austin1986"), "got '9C', allowed: I, IA"),
        (lambda: pure_water.absorption_pope1997(np.array([500.0, 379.0])), "got 379 nm, allowed: 380-727.5 nm"),
        (lambda: pure_water.absorption_mason2016(np.asarray(np.nan)), "got nan nm"),
        (lambda: pure_water.scattering_zhang2009(np.asarray(750.0), temperature_c=20, salinity_psu=0), "750"),
        (lambda: pure_water.scattering_zhang2009(np.asarray(500.0), temperature_c=20, salinity_psu=-1), "-1"),
        (lambda: pure_water.absorption_roettgers2016(np.asarray(500.0), temperature_c=60, salinity_psu=0), "60"),
        (lambda: constituents.natural_water(chlorophyll_mg_per_m3=-1.0), "got -1, allowed"),
        (lambda: constituents.natural_water(chlorophyll_mg_per_m3=100.0), "got 100, allowed"),
        (lambda: constituents.natural_water(cdom_440_per_m=np.nan), "CDOM: absorption_440_per_m: got nan"),
        (lambda: constituents.natural_water(minerals_g_per_m3=np.inf), "concentration_g_per_m3: got inf"),
        (
            lambda: constituents.natural_water(particle_scattering="x"),
            "particle_scattering is 'x', allowed: gordon1983",
        ),
        (
            lambda: constituents.natural_water(particle_absorption="bricaud1998", non_algal_440_per_m=0.1),
            "allowed with bricaud1998: 0",
        ),
        (lambda: turbidity.turbid_water(minerals_g_per_m3=-1.0), "got -1, allowed"),
        (lambda: turbidity.turbid_water(minerals_g_per_m3=1.0, albedo_550=0.0), "albedo_550: got 0"),
        (lambda: named_water("tank_low").transmittance(path_m=-1.0), "path_m is -1.0, allowed: >= 0"),
        (lambda: constituents.coefficient_from_loss(flux_in=1.0, flux_out=2.0, path_m=1.0), "flux_out: got 2"),
    ],
)
def test_what_no_water_can_be_is_refused(make, message):
    with pytest.raises(ValueError, match=message) as refusal:
        make()
    assert "\n" not in str(refusal.value)
