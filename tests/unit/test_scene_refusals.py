"""Scenes that would be silently wrong are refused by the models or before rendering."""

import pytest

from tests.physics import scenes
from uwsim.optics.spectrum import WAVELENGTHS_NM
from uwsim.scene import truth
from uwsim.scene.models import Scene
from uwsim.scene.phase import MixturePhase
from uwsim.validation import validated


def changed(**changes):
    return Scene.model_validate(scenes.wall(distance_m=1.0).model_dump() | changes)


def board(name, first_id):
    return {
        "name": name, "kind": "marker_board", "columns": 2, "rows": 1, "marker_size_m": 0.1, "gap_m": 0.02,
        "position_m": (0.0, 1.0, -100.0), "first_id": first_id,
    }  # fmt: skip


def test_boards_must_not_share_markers():
    changed(bodies=[board("a", 0), board("b", 2)])
    with pytest.raises(ValueError, match="share marker ids"):
        changed(bodies=[board("a", 0), board("b", 1)])


def chart(width_m, last_group):
    return {
        "name": "chart", "kind": "usaf_1951", "width_m": width_m, "first_group": -3, "last_group": last_group,
        "position_m": (0.0, 1.0, -100.0),
    }  # fmt: skip


def test_a_chart_whose_bars_its_texture_cannot_hold_is_refused():
    changed(bodies=[chart(0.3, 0)])
    with pytest.raises(ValueError, match="last_group"):
        changed(bodies=[chart(0.3, 4)])


def narrow_lamp(white_balance=None):
    base = scenes.wall(distance_m=1.0).model_dump()
    spectrum = {"wavelengths_nm": tuple(WAVELENGTHS_NM), "values": tuple(float(w == 400) for w in WAVELENGTHS_NM)}
    base["rig"]["lamps"] = [base["rig"]["lamps"][0] | {"spectrum": spectrum}]
    base["sensor"]["white_balance"] = white_balance
    return Scene.model_validate(base)


def test_a_lamp_that_leaves_a_band_dark_needs_given_gains():
    with pytest.raises(ValueError, match="sensor.white_balance"):
        truth.sensor_constants(narrow_lamp())
    assert truth.sensor_constants(narrow_lamp((1.0, 1.5, 2.0)))["white_balance"].tolist() == [1.0, 1.5, 2.0]


def test_gains_are_at_least_one_so_that_saturated_pixels_are_white():
    assert truth.sensor_constants(changed())["white_balance"].min() == pytest.approx(1.0)


def test_a_mixture_needs_a_list_of_g():
    with pytest.raises(ValueError, match="a list"):
        validated(MixturePhase, {"type": "hg_mixture", "g": 0.9, "weights": [1.0]}, where="phase")


def test_a_lamp_in_the_pinhole_is_refused():
    """Light scattered between the two would be infinite."""
    values = scenes.wall(distance_m=1.0).model_dump()
    values["rig"]["lamps"] = [values["rig"]["lamps"][0] | {"position_m": (0.0, 0.0, 0.0)}]
    with pytest.raises(ValueError, match="pinhole"):
        Scene.model_validate(values)


def test_rival_tables_of_a_water_can_be_chosen():
    first, second = (
        changed(water={"name": "jerlov_III", "source": source}).water.optical()
        for source in ("williamson2022", "solonenko2015")
    )
    assert second.scattering[30] > 2 * first.scattering[30]
    with pytest.raises(ValueError, match="source"):
        changed(water={"name": "jerlov_III", "source": "nobody1900"})


def test_turbidity_by_the_mass_of_minerals():
    clear, turbid = (changed(water={"minerals_g_per_m3": mass}).water.optical() for mass in (0.0, 1.8))
    assert turbid.attenuation[30] == pytest.approx(1.0, rel=0.02)  # that of tank_low, at 550 nm
    assert clear.attenuation[30] < 0.07
    with pytest.raises(ValueError, match="minerals_g_per_m3"):
        changed(water={"minerals_g_per_m3": -1.0})


def test_a_beam_narrower_than_its_table_holds_is_refused():
    from uwsim.optics import lamp

    profile = lamp.profile_from_half_angle(half_angle_deg=1.0)
    order = lamp.lambertian_order(half_angle_deg=1.0)
    exact = (order + 1) / (2 * 3.141592653589793)
    assert lamp.intensity_from_flux(radiant_flux_w=1.0, profile=profile) == pytest.approx(exact, rel=2e-3)
    with pytest.raises(ValueError, match="at least 1"):
        lamp.lambertian_order(half_angle_deg=0.3)
