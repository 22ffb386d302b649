"""Lamps in scenes: beams, windows, arrays and housings say what is meant, and what cannot be is refused in one line."""

import json

import numpy as np
import pytest

from uwsim.dataset import info, make
from uwsim.optics import beam_profile, lamp
from uwsim.scene.lamp import Lamp
from uwsim.scene.load import load_scene, scene_values
from uwsim.validation import validated

PHOTOMETRY = """IESNA:LM-63-2002
TILT=NONE
1 -1 1.0 5 3 1 2 0 0 0
1 1 10
0 22.5 45 67.5 90
0 45 90
500 400 250 100 0
500 420 300 150 0
500 440 350 200 0
"""
FLAT = {"air_gap_m": 0.01, "thickness_m": 0.005, "radius_m": 0.02}
RING = {"kind": "ring", "count": 6, "radius_m": 0.01, "outward_tilt_deg": 15.0}


def lamp_with(**changes) -> Lamp:
    values = {
        "position_m": [0.2, -0.1, 0.05],
        "look_at_m": [0.2, -0.1, 1.0],
        "radiant_intensity_w_per_sr": 2.0,
        "half_angle_deg": 50.0,
        "spectrum": "E",
    } | changes
    return validated(Lamp, {k: v for k, v in values.items() if v is not None}, where="lamp")


@pytest.fixture
def ies_file(tmp_path):
    path = tmp_path / "flood.ies"
    path.write_text(PHOTOMETRY)
    return path


def test_a_bare_lamp_is_as_before():
    found = lamp_with()
    np.testing.assert_array_equal(found.profile[0], lamp.profile_from_half_angle(half_angle_deg=50.0))
    assert found.profile.shape == (1, 1801)
    assert len(found.emitters) == 1
    assert found.front_radius_m == 0
    np.testing.assert_array_equal(found.rig_from_front, found.rig_from_lamp)


def test_the_table_of_an_ies_file_is_its_profile(ies_file):
    found = lamp_with(half_angle_deg=None, ies=str(ies_file))
    truth = beam_profile.from_ies(ies_file)
    angles, azimuths = np.radians(lamp.PROFILE_ANGLES_DEG), np.radians(np.arange(360.0))
    np.testing.assert_allclose(found.profile, truth(angles[None], azimuths[:, None]), atol=1e-12)
    assert abs(found.profile[0, 450] - found.profile[90, 450]) > 0.1  # the azimuth matters
    given = lamp_with(half_angle_deg=None, ies=str(ies_file), radiant_intensity_w_per_sr=None, radiant_flux_w=3.0)
    assert given.intensity_w_per_sr == pytest.approx(
        beam_profile.axis_intensity_w_per_sr(radiant_flux_w=3.0, profile=truth), rel=1e-4
    )


def test_the_ies_file_of_a_scene_lies_beside_it(tmp_path, ies_file):
    _, path = scene_values("tank_usaf")
    text = path.read_text().replace("half_angle_deg", 'ies = "flood.ies"\n#', 1)
    (tmp_path / "mine.toml").write_text(text.replace('name = "tank_usaf"', 'name = "mine"'))
    assert load_scene(str(tmp_path / "mine.toml")).rig.lamps[0].ies == ies_file.resolve()


def test_flux_is_that_of_the_whole_lamp_and_intensity_the_sum_of_the_leds():
    one = lamp_with(radiant_intensity_w_per_sr=None, radiant_flux_w=6.0)
    ring = lamp_with(radiant_intensity_w_per_sr=None, radiant_flux_w=6.0, array=RING)
    assert ring.intensity_w_per_sr == pytest.approx(one.intensity_w_per_sr)
    each = [emitter.beam.axis_intensity_w_per_sr for emitter in ring.emitters]
    np.testing.assert_allclose(each, one.intensity_w_per_sr / 6)
    cosines = np.cos(np.radians(lamp.PROFILE_ANGLES_DEG))
    flux = 2 * np.pi * np.trapezoid(ring.profile[0] * each[0] * 6, -cosines)
    assert flux == pytest.approx(6.0, rel=1e-4)


def test_leds_stand_where_the_array_says_and_lean_outwards():
    ring = lamp_with(array=RING, roll_deg=30.0)
    places = ring.lamp_from_led
    np.testing.assert_allclose(np.hypot(places[:, 0, 3], places[:, 1, 3]), 0.01)
    outward = np.einsum("ni,ni->n", places[:, :3, 2], places[:, :3, 3] / 0.01)
    np.testing.assert_allclose(outward, np.sin(np.radians(15.0)))
    grid = lamp_with(array={"kind": "grid", "rows": 2, "columns": 3, "pitch_m": 0.004})
    np.testing.assert_allclose(np.ptp(grid.lamp_from_led[:, :2, 3], axis=0), [0.008, 0.004])
    assert grid.front_radius_m == pytest.approx(np.hypot(0.004, 0.002))
    turned, still = ring.rig_from_lamp, lamp_with().rig_from_lamp
    np.testing.assert_allclose(turned[:3, 2], still[:3, 2])  # the roll leaves the beam
    assert turned[:3, 0] @ still[:3, 1] == pytest.approx(0.5)  # and turns x towards y


def test_the_front_face_is_the_outer_face_of_the_window():
    flat = lamp_with(window=FLAT, housing={"radius_m": 0.02, "length_m": 0.1})
    np.testing.assert_allclose(flat.rig_from_front[:3, 3] - flat.rig_from_lamp[:3, 3], [0, 0, 0.015], atol=1e-12)
    dome = lamp_with(window={"kind": "dome", "inner_radius_m": 0.02, "thickness_m": 0.003})
    np.testing.assert_allclose(dome.rig_from_front, dome.rig_from_lamp)
    assert dome.dome_radius_m == dome.front_radius_m == pytest.approx(0.023)
    assert flat.window.n_glass == pytest.approx(1.5185, abs=1e-4)


def test_a_dome_calibrated_through_itself_gives_more():
    dome = {"kind": "dome", "inner_radius_m": 0.02, "thickness_m": 0.003}
    bare, through = (lamp_with(window=dome | {"calibration": c}).window for c in ("bare", "through_window"))
    assert 0.94 < bare.transmittance(n_water=1.34) < 0.96 < 1.0 < through.transmittance(n_water=1.34)
    assert through.transmittance(n_water=1.0) == pytest.approx(1.0)


@pytest.mark.parametrize(
    "beam",
    [
        {"half_angle_deg": 60.0},
        {"half_angle_deg": 20.0},
        {"half_angle_deg": None, "beam": {"angles_deg": [0, 50, 80], "values": [1, 1.2, 0.4]}},
        {"half_angle_deg": None, "beam": {"angles_deg": [0, 80, 90], "values": [1, 0.3, 0]}},
    ],
)
def test_a_die_takes_beams_that_end_with_the_cosine(beam):
    assert lamp_with(die_radius_m=0.002, **beam).die_radius_m == 0.002


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"half_angle_deg": None}, "give one of half_angle_deg, beam"),
        ({"ies": "missing.ies"}, "give one of half_angle_deg, beam"),
        ({"half_angle_deg": None, "ies": "missing.ies"}, "ies: missing.ies does not exist"),
        ({"die_radius_m": 0.002, "half_angle_deg": 61.0}, "infinite radiance"),
        (
            {
                "die_radius_m": 0.002,
                "half_angle_deg": None,
                "beam": {"angles_deg": [0, 90, 100], "values": [1, 0.2, 0]},
            },
            "falls slower than the cosine",
        ),
        (
            {
                "die_radius_m": 0.002,
                "half_angle_deg": None,
                "beam": {"angles_deg": [0, 89.9, 90], "values": [1, 0.2, 0]},
            },
            "falls slower than the cosine",
        ),
        ({"die_radius_m": 0.006, "array": RING}, "die_radius_m: got 0.006, allowed: at most half the distance of LEDs"),
        (
            {"die_radius_m": 0.004, "array": RING, "window": FLAT | {"air_gap_m": 0.001}},
            "tilted dies reach 0.00103528 m towards the window",
        ),
        ({"array": RING, "window": {"kind": "dome", "inner_radius_m": 0.02, "thickness_m": 0.0}}, "behind a dome"),
        ({"window": {"kind": "dome", "inner_radius_m": 0.02, "thickness_m": 0.0}, "die_radius_m": 0.001}, "dome"),
        ({"window": FLAT, "housing": {"radius_m": 0.019, "length_m": 0.1}}, "housing.radius_m: got 0.019, allowed"),
        ({"array": RING, "die_radius_m": 0.002, "housing": {"radius_m": 0.0115, "length_m": 0.1}}, "at least 0.012"),
        ({"housing": {"radius_m": 0.02}}, "housing.length_m: missing"),
        ({"window": FLAT | {"gap_m": 1}}, "window.gap_m: unknown key, allowed: kind, air_gap_m"),
        ({"window": FLAT | {"air_gap_m": 0.0}}, "window.air_gap_m: got 0.0, allowed: > 0"),
        ({"window": FLAT | {"calibration": "guess"}}, "window.calibration: got 'guess', allowed: 'bare' or"),
        ({"array": RING | {"kind": "star"}}, "array.kind: got 'star', allowed: 'ring', 'grid'"),
        ({"array": RING | {"count": 0}}, "array.count: got 0, allowed: >= 1"),
        ({"window": {"kind": "dome", "inner_radius_m": 0.02, "thickness_m": 0, "half_aperture_deg": 91}}, "<= 90"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(changes, message):
    with pytest.raises(ValueError, match=message) as refusal:
        lamp_with(**changes)
    assert "\n" not in str(refusal.value)
    assert str(refusal.value).startswith("lamp: ")


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"window": FLAT, "array": RING, "die_radius_m": 0.001, "housing": {"radius_m": 0.03, "length_m": 0.1}},
        {"window": {"kind": "dome", "inner_radius_m": 0.02, "thickness_m": 0.003}},
        {"half_angle_deg": None, "beam": {"angles_deg": [0, 50, 80], "values": [1, 1.2, 0.4]}},
    ],
)
def test_a_frame_tells_all_about_its_lamp(changes):
    described = make._lamp(lamp_with(**changes), np.eye(4), n_water=1.34)
    read = info.Lamp.model_validate_json(json.dumps(described))
    assert read == info.Lamp.model_validate(described)
    assert (read.window is None) == ("window" not in changes)
    assert read.world_from_lamp[0][3] == pytest.approx(0.2)
    assert (read.world_from_leds is None) == ("array" not in changes)
    if read.window is not None:
        assert read.window.n_water == 1.34


def test_a_frame_tells_the_table_of_an_ies_file(ies_file):
    described = make._lamp(lamp_with(half_angle_deg=None, ies=str(ies_file)), np.eye(4), n_water=1.34)
    read = info.Lamp.model_validate_json(json.dumps(described))
    assert read.beam_azimuths_deg == (0, 45, 90)
    assert read.beam_angles_deg == (0, 22.5, 45, 67.5, 90)
    assert np.array(read.beam_table).shape == (3, 5)
    assert {row[0] for row in read.beam_table} == {1.0}
