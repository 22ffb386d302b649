"""IES LM-63 files: what a good one holds, and that a bad one is refused in one line."""

import numpy as np
import pytest

from uwsim.optics import beam_profile, ies, lamp, led_spectrum, sources

GOOD = """IESNA:LM-63-2002
[TEST] 1234
[MANUFAC] Example Lamps
[LUMINAIRE] underwater flood
[MORE] with lens
[MORE] 60 degrees
TILT=NONE
1 1000 2.0 5 3 1 2 0.1, 0.1, 0
0.9 1.0 25
0 22.5 45 67.5 90
0 45 90
500 400 250 100 0
500 420 300
150 0
500 440 350 200 0
"""


def write(tmp_path, text):
    path = tmp_path / "lamp.ies"
    path.write_text(text, encoding="latin-1")
    return path


def test_a_good_file_is_read(tmp_path):
    found = ies.read(write(tmp_path, GOOD))
    assert found.keywords["MANUFAC"] == "Example Lamps"
    assert found.keywords["LUMINAIRE"] == "underwater flood\nwith lens\n60 degrees"
    assert found.luminous_flux_lm == 1000
    assert found.intensity_cd.shape == (3, 5)
    np.testing.assert_allclose(found.intensity_cd[:, 2], 2.0 * 0.9 * np.array([250, 300, 350]))
    assert found.intensity(33.75, 22.5) == pytest.approx(1.8 * (400 + 250 + 420 + 300) / 4)
    # quadrant symmetry, angles of any turn, dark behind
    around = found.intensity(45.0, np.array([30.0, 150.0, 210.0, 330.0, -30.0, 390.0]))
    np.testing.assert_allclose(around, around[0])
    assert found.intensity(120.0, 0.0) == 0
    assert found.intensity(45.0, 0.0) != pytest.approx(found.intensity(45.0, 90.0))


@pytest.mark.parametrize("header", ["IESNA91", "IESNA:LM-63-1991", "IESNA:LM-63-1995", "IES:LM-63-2019"])
def test_other_editions_hold_the_same(header):
    found = ies.parse(GOOD.replace("IESNA:LM-63-2002", header), where="lamp.ies")
    np.testing.assert_array_equal(found.intensity_cd, ies.parse(GOOD, where="lamp.ies").intensity_cd)
    # the 12th number: a factor, but since 2019 how the file was made
    other = ies.parse(GOOD.replace("IESNA:LM-63-2002", header).replace("0.9 1.0 25", "0.9 1.1 25"), where="lamp.ies")
    factor = 1.0 if header == "IES:LM-63-2019" else 1.1
    np.testing.assert_allclose(other.intensity_cd, factor * found.intensity_cd, rtol=1e-12)


@pytest.mark.parametrize("tilt", ["TILT = NONE", "TILT= NONE", " TILT =NONE "])
def test_spaces_round_the_equals_sign(tilt):
    assert ies.parse(GOOD.replace("TILT=NONE", tilt), where="lamp.ies").luminous_flux_lm == 1000
    with pytest.raises(ValueError, match="got TILT = INCLUDE, allowed: TILT=NONE"):
        ies.parse(GOOD.replace("TILT=NONE", "TILT = INCLUDE"), where="lamp.ies")


@pytest.mark.parametrize(("before", "after"), [(b"\xef\xbb\xbf", b""), (b"", b"\x1a"), (b"", b"\r\n\x1a\r\n")])
def test_marks_at_either_end_of_a_file_are_skipped(tmp_path, before, after):
    path = tmp_path / "lamp.ies"
    path.write_bytes(before + GOOD.replace("Example", "Lämp").encode("utf-8" if before else "latin-1") + after)
    assert ies.read(path).keywords["MANUFAC"] == "Lämp Lamps"
    assert ies.parse("\ufeff" + GOOD, where="lamp.ies").luminous_flux_lm == 1000


@pytest.mark.parametrize(("last", "same", "other"), [("90", 150.0, 60.0), ("180", 330.0, 150.0), ("360", 390.0, 330.0)])
def test_symmetries_fold(last, same, other):
    middle = float(last) / 2
    text = GOOD.replace("0 45 90\n500", f"0 {middle:g} {last}\n500").replace(" 0 45 90\n0 ", " 0 45 90\n0 ")
    found = ies.parse(text, where="lamp.ies")
    assert found.intensity(45.0, same) == pytest.approx(found.intensity(45.0, 30.0))
    assert found.intensity(45.0, other) != pytest.approx(found.intensity(45.0, 30.0))


def test_an_axial_file_is_a_profile(tmp_path):
    angles = np.arange(0.0, 91.0, 1.0)
    candela = 300 * np.cos(np.radians(angles)) ** 3
    text = "IESNA:LM-63-1995\r\nTILT=NONE\r\n1 -1 1 91 1 1 2 0 0 0 1 1 10\r\n"
    text += " ".join(f"{a:g}" for a in angles) + "\r\n0\r\n" + "\r\n".join(f"{c:.6e}" for c in candela) + "\r\n"
    photometry = ies.parse(text, where="lamp.ies")
    assert photometry.luminous_flux_lm is None
    assert photometry.emitted_flux_lm() == pytest.approx(2 * np.pi * 300 / 4, rel=3e-4)
    profile = beam_profile.from_ies(write(tmp_path, text))
    grid = np.radians([0.0, 20.0, 60.0, 100.0])
    np.testing.assert_allclose(profile(grid, 1.0), np.maximum(np.cos(grid), 0) ** 3, atol=3e-4)
    tabulated = beam_profile.tabulated(profile)
    assert tabulated.shape == lamp.PROFILE_ANGLES_DEG.shape and tabulated[0] == pytest.approx(1)
    intensity = beam_profile.axis_intensity_w_per_sr(radiant_flux_w=7.0, profile=profile)
    assert intensity == pytest.approx(7.0 * 4 / (2 * np.pi), rel=3e-4)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("150 0\n", "150\n", r"got 35 numbers after TILT, allowed: 36 \(13 \+ 5 vertical \+ 3 horizontal"),
        ("150 0\n", "150 0 7\n", "got 37 numbers after TILT, allowed: 36"),
        ("5 3 1 2", "5 4 1 2", "got 36 numbers after TILT, allowed: 42"),
        ("5 3 1 2", "5.5 3 1 2", "vertical angles: got 5.5, allowed: a whole number"),
        ("5 3 1 2", "1e300 3 1 2", r"vertical angles: got 1e\+300, allowed: a whole number from 1 to 100000$"),
        ("5 3 1 2", "5 100001 1 2", "horizontal angles: got 100001, allowed"),
        ("5 3 1 2", "5 0 1 2", "horizontal angles: got 0, allowed"),
        ("5 3 1 2", "5 3 2 2", r"photometric type: got 2, allowed: 1 \(type C\)"),
        ("5 3 1 2", "5 3 3 2", "photometric type: got 3"),
        ("TILT=NONE", "TILT=INCLUDE", "got TILT=INCLUDE, allowed: TILT=NONE"),
        ("TILT=NONE", "", "no line TILT="),
        ("IESNA:LM-63-2002", "IESNA:LM-63-1986", "first line: got 'IESNA:LM-63-1986'"),
        ("500 420 300", "500 4x0 300", "line 13: got '4x0', allowed: a number"),
        ("500 420 300", "500 nan 300", "line 13: got 'nan'"),
        ("500 420 300", "500 1_0 300", "line 13: got '1_0'"),
        ("500 420 300", "500 1e999 300", "allowed: finite numbers"),
        ("500 420 300", "500 -420 300", "intensities: got -420, allowed: at least 0"),
        ("0 22.5 45 67.5 90", "0 45 22.5 67.5 90", "vertical angles: got angles out of order"),
        ("0 22.5 45 67.5 90", "0 22.5 45 67.5 80", "vertical angles: got 0 to 80, allowed in type C"),
        ("0 45 90\n500", "0 45 100\n500", "horizontal angles: got 0 to 100"),
        ("1 1000 2.0", "1 1000 0", "multiplier: got 0, allowed: above 0"),
        ("1 1000 2.0", "1 0 2.0", "lumens per lamp: got 0"),
        ("1 1000 2.0", "0 1000 2.0", "number of lamps: got 0"),
    ],
)
def test_a_bad_file_is_refused_in_one_line(tmp_path, old, new, message):
    assert old in GOOD
    with pytest.raises(ValueError, match=f"^lamp.ies: .*{message}") as caught:
        ies.read(write(tmp_path, GOOD.replace(old, new, 1)))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("text", ["", "IESNA:LM-63-2002", "IESNA:LM-63-2002\nTILT=NONE\n1 1000 1 5"])
def test_a_cut_off_file_is_refused(text):
    with pytest.raises(ValueError, match="^lamp.ies: "):
        ies.parse(text, where="lamp.ies")


def test_a_lamp_dark_on_its_axis_is_no_profile(tmp_path):
    up = GOOD.replace("0 22.5 45 67.5 90", "90 112.5 135 157.5 180")
    with pytest.raises(ValueError, match="lamp.ies: intensity on the axis"):
        beam_profile.from_ies(write(tmp_path, up))


def test_a_beam_rolls_and_tilts_its_profile(tmp_path):
    profile = beam_profile.from_ies(write(tmp_path, GOOD))
    directions = np.array([[np.sin(0.7), 0, np.cos(0.7)], [0, np.sin(0.7), np.cos(0.7)]])
    straight = beam_profile.Beam(3.0, profile).intensity(directions)
    rolled = beam_profile.Beam(3.0, profile, roll_rad=np.pi / 2).intensity(directions)
    np.testing.assert_allclose(rolled, straight[::-1], rtol=1e-12)
    assert straight[0] < 0.95 * straight[1]
    tilted = beam_profile.Beam(3.0, profile, tilt_rad=0.7, tilt_azimuth_rad=np.pi / 2).intensity(directions)
    assert tilted[1] == pytest.approx(3.0)
    table = beam_profile.from_table(angles_deg=[0, 10, 20], values=[4, 4, 2])
    np.testing.assert_allclose(table(np.radians([0, 15, 25]), 0.0), [1, 0.75, 0])


def test_the_white_led_model_fits_the_cie_illuminants():
    # rms as published with the fits, of the peak; against 400-700 nm here, which has fewer empty wavelengths
    for name, rms in (("LED-B1", 0.0224), ("LED-B3", 0.0202), ("LED-B5", 0.0154)):
        table, model = sources.illuminant(name), led_spectrum.white_led(name)
        found = np.sqrt(np.mean((model - table) ** 2)) / table.max()
        assert found == pytest.approx(rms, rel=0.35)
        efficacy = led_spectrum.luminous_efficacy_lm_per_w(table)
        assert led_spectrum.luminous_efficacy_lm_per_w(model) == pytest.approx(efficacy, rel=0.01)
        assert 300 < efficacy < 345
        assert led_spectrum.radiant_flux_w(luminous_flux_lm=1000, power=table) == pytest.approx(1000 / efficacy)
    # negative control: another LED's model
    far = np.sqrt(np.mean((led_spectrum.white_led("LED-B5") - sources.illuminant("LED-B1")) ** 2))
    assert far / sources.illuminant("LED-B1").max() > 0.1
    with pytest.raises(ValueError, match="white LED model: got 'LED-V1', allowed: LED-B1"):
        led_spectrum.white_led("LED-V1")
    with pytest.raises(ValueError, match="short_sigma_nm: got 0, allowed"):
        led_spectrum.SplitGaussian(1.0, 450.0, 0.0, 10.0)
