"""Scenes: the shipped ones load and say what is true, charts have the bars of their standard, corners their order."""

import math
import re

import numpy as np
import pytest
from pydantic import ValidationError

from uwsim.camera import pinhole, pose
from uwsim.files import shipped
from uwsim.optics.spectrum import WAVELENGTHS_NM
from uwsim.scene import markers, truth, usaf
from uwsim.scene.load import load_scene, scene_values
from uwsim.scene.models import Scene
from uwsim.scene.phase import HenyeyGreensteinPhase
from uwsim.validation import validated

SHIPPED = sorted(shipped("scenes").glob("*.toml"))


def changed(name: str, **paths) -> Scene:
    """Return a shipped scene with values replaced, by paths with `__` for dots."""
    values, _ = scene_values(name)
    for path, value in paths.items():
        node = values
        *parents, last = path.split("__")
        for key in parents:
            node = node[int(key)] if isinstance(node, list) else node[key]
        node[last] = value
    return validated(Scene, values, where=name)


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_shipped_scenes_load_by_path_and_by_name(path):
    scene = load_scene(str(path))
    assert scene == load_scene(path.stem)
    assert scene.name == path.stem
    with pytest.raises(ValidationError, match="frozen"):
        scene.name = "other"


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_the_first_body_of_a_shipped_scene_is_in_the_middle_of_the_picture(path):
    scene = load_scene(path.stem)
    if scene.bodies[0].kind == "tank":
        pytest.skip("a whole tank, without a subject")
    local = pose.apply(pose.inverse(scene.rig.world_from_rig), np.array(scene.bodies[0].position_m))
    x, y = pinhole.project(local, scene.rig.camera.K)
    assert abs(x - scene.rig.camera.width_px / 2) < 0.1 * scene.rig.camera.width_px
    assert abs(y - scene.rig.camera.height_px / 2) < 0.1 * scene.rig.camera.height_px
    for lamp in scene.rig.lamps:  # and the lamps shine at it
        world_from_lamp = scene.rig.world_from_rig @ lamp.rig_from_lamp
        towards = np.array(scene.bodies[0].position_m) - world_from_lamp[:3, 3]
        assert world_from_lamp[:3, 2] @ towards / np.linalg.norm(towards) > math.cos(math.radians(lamp.half_angle_deg))


def test_bodies_face_what_they_are_to_face():
    scene = load_scene("tank_usaf")
    chart, _, floor = scene.bodies
    assert chart.world_from_body[:3, 2] == pytest.approx([0, -1, 0], abs=1e-12)
    assert chart.world_from_body[:3, 1] == pytest.approx([0, 0, 1], abs=1e-12)  # its top is up
    assert floor.world_from_body[:3, :3] == pytest.approx(np.eye(3))


# The USAF-1951 chart


@pytest.mark.parametrize(
    ("group", "element", "line_pairs_per_mm"), [(0, 1, 1.0), (1, 1, 2.0), (-2, 6, 0.445), (2, 3, 5.04)]
)
def test_bar_widths_are_those_of_the_standard(group, element, line_pairs_per_mm):
    width = usaf.bar_width_mm(group=group, element=element)
    assert width == pytest.approx(0.5 / 2 ** (group + (element - 1) / 6), rel=1e-12)
    assert 0.5 / width == pytest.approx(line_pairs_per_mm, rel=2e-3)  # printed digits of the table


def test_the_comment_of_the_shipped_chart_is_true():
    path = shipped("scenes") / "tank_usaf.toml"
    comment = re.search(
        r"finest bars: group (\S+), element (\d), (\S+) line pairs/mm \((\S+) mm\), (\S+) pixels per pair at 1 m",
        path.read_text(),
    )
    group, element, line_pairs, width_mm, pixels = map(float, comment.groups())
    scene = load_scene("tank_usaf")
    finest = scene.bodies[0].layout.finest
    assert (finest.group, finest.element) == (group, element)
    assert finest.line_pairs_per_mm == pytest.approx(line_pairs, abs=5e-4)
    assert finest.bar_mm == pytest.approx(width_mm, abs=5e-3)
    assert scene.rig.camera.K[0, 0] * 2e-3 * finest.bar_mm == pytest.approx(pixels, abs=0.05)
    assert math.dist(scene.bodies[0].position_m, scene.rig.position_m) == pytest.approx(1)


@pytest.fixture(scope="module")
def chart():
    """A chart of three groups and its coverage with its texels per mm."""
    layout = usaf.layout(first_group=-2, last_group=0, width_mm=85.0)
    drawn = usaf.draw(layout)
    return layout, drawn, drawn.shape[1] / layout.width_mm


def test_bars_are_dark_and_the_gaps_between_them_bright(chart):
    layout, drawn, texels_per_mm = chart
    assert len(layout.elements) == 18

    def at(x_mm, y_mm):
        return drawn[math.floor(y_mm * texels_per_mm), math.floor(x_mm * texels_per_mm)]

    for element in layout.elements:
        x, y, w = element.left_mm, element.top_mm, element.bar_mm
        assert [at(x + 2.5 * w, y + (k + 0.5) * w) for k in range(5)] == pytest.approx([0, 1, 0, 1, 0])  # lying
        assert [at(x + (7.5 + k) * w, y + 2.5 * w) for k in range(5)] == pytest.approx([0, 1, 0, 1, 0])  # upright
        assert at(x + 6 * w, y + 2.5 * w) == 1  # between the two


def test_each_bar_covers_its_own_area_to_a_share_of_a_texel(chart):
    layout, drawn, texels_per_mm = chart
    for element in layout.elements:
        left, top, size = element.left_mm, element.top_mm, 5 * element.bar_mm
        rows = slice(math.floor((top - 0.4 * element.bar_mm) * texels_per_mm), None)
        rows = slice(rows.start, math.ceil((top + size + 0.4 * element.bar_mm) * texels_per_mm))
        columns = slice(
            math.floor((left - 0.4 * element.bar_mm) * texels_per_mm),
            math.ceil((left + size + 0.4 * element.bar_mm) * texels_per_mm),
        )
        dark = (1 - drawn[rows, columns]).sum() / texels_per_mm**2
        assert dark == pytest.approx(3 * 5 * element.bar_mm**2, rel=0.01)


def test_elements_neither_overlap_nor_leave_the_chart(chart):
    layout, _, _ = chart
    boxes = [(e.left_mm, e.top_mm, e.left_mm + 12 * e.bar_mm, e.top_mm + 5 * e.bar_mm) for e in layout.elements]
    for index, (left, top, right, bottom) in enumerate(boxes):
        assert left > 0 and top > 0 and right < layout.width_mm and bottom < layout.height_mm
        for other in boxes[index + 1 :]:
            assert right < other[0] or other[2] < left or bottom < other[1] or other[3] < top


def test_groups_that_do_not_fit_name_the_width_that_would():
    with pytest.raises(ValueError, match=r"width_m: got 0.05, needed for groups -2 to 0: (\S+) or more") as caught:
        usaf.layout(first_group=-2, last_group=0, width_mm=50.0)
    needed_mm = 1e3 * float(re.search(r"0: (\S+) or more", str(caught.value))[1])
    assert len(usaf.layout(first_group=-2, last_group=0, width_mm=1.01 * needed_mm).elements) == 18


# Markers


def test_corners_go_clockwise_from_the_top_left_in_reading_order():
    found = markers.corners(rows=2, columns=2, marker_size_m=0.2, gap_m=0.1)
    assert found[0] == pytest.approx(np.array([[-0.25, 0.25, 0], [-0.05, 0.25, 0], [-0.05, 0.05, 0], [-0.25, 0.05, 0]]))
    assert found[1] - found[0] == pytest.approx(np.tile([0.3, 0, 0], (4, 1)))
    assert found[2] - found[0] == pytest.approx(np.tile([0, -0.3, 0], (4, 1)))


def test_a_drawn_marker_is_read_as_its_own_id_the_right_way_up():
    import cv2

    drawn = np.full((120, 120), 255, np.uint8)
    drawn[30:90, 30:90] = np.kron(255 * markers.modules("DICT_4X4_50", 17), np.ones((10, 10)))
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    found, ids, _ = cv2.aruco.ArucoDetector(dictionary).detectMarkers(drawn)
    assert ids.ravel().tolist() == [17]
    assert found[0][0] == pytest.approx(np.array([[30, 30], [89, 30], [89, 89], [30, 89]]), abs=1)


def frontal_board(**paths) -> Scene:
    return changed("tank_markers", bodies__0__rotation_deg=[0.0, 0.0, 0.0], **paths)


def corners_of(scene: Scene, z_depth_m: float) -> list[dict]:
    """Return the markers as seen in front of (or behind) a wall at a distance along the optical axis."""
    camera = scene.rig.camera
    rays = pinhole.ray_directions(camera.K, width_px=camera.width_px, height_px=camera.height_px)
    buffer = z_depth_m / rays[..., 2]
    return truth.marker_corners(scene, range_m=buffer)


def test_marker_corners_in_the_image_against_a_calculation_by_hand():
    found = corners_of(frontal_board(), z_depth_m=np.inf)
    assert [entry["id"] for entry in found] == list(range(12))
    focal_px = 320 / math.tan(math.radians(25))
    # first marker: its top left corner is 1.5 pitches and half a marker to the left, and a pitch and a half up
    left_m, up_m = 1.5 * 0.12 + 0.045, 0.12 + 0.045
    expected = np.array([320 - focal_px * left_m / 0.8, 240 - focal_px * up_m / 0.8])
    assert found[0]["corners_px"][0] == pytest.approx(expected, abs=1e-9)
    side = focal_px * 0.09 / 0.8
    assert np.array(found[0]["corners_px"]) - expected == pytest.approx(
        np.array([[0, 0], [side, 0], [side, side], [0, side]]), abs=1e-9
    )
    assert found[0]["corners_world_m"][0] == pytest.approx([-left_m, 0.8, -0.6 + up_m])


def test_corners_are_seen_unless_hidden_outside_or_turned_away():
    assert all(all(entry["visible"]) for entry in corners_of(frontal_board(), z_depth_m=0.8))
    assert not any(any(entry["visible"]) for entry in corners_of(frontal_board(), z_depth_m=0.5))
    away = frontal_board(bodies__0__towards_m=[0.0, 2.0, -0.6])
    assert not any(any(entry["visible"]) for entry in corners_of(away, z_depth_m=0.8))
    aside = frontal_board(rig__camera__horizontal_fov_deg=10.0)
    seen = [any(entry["visible"]) for entry in corners_of(aside, z_depth_m=0.8)]
    assert any(seen) and not all(seen)


def test_the_white_balance_makes_grey_under_the_first_lamp_grey():
    constants = truth.sensor_constants(load_scene("tank_usaf"))
    assert constants["white_balance"][1] == 1
    assert np.all(constants["electrons_per_radiance"] > 0)


def test_band_coefficients_lie_within_the_spectrum_and_red_is_absorbed_most():
    scene = load_scene("tank_usaf")
    bands, water = truth.water_bands(scene), scene.water.optical()
    absorption = np.array(bands["absorption_per_m"])
    assert water.absorption.min() < absorption.min() and absorption.max() < water.absorption.max()
    assert absorption.argmax() == 0
    total = absorption + bands["scattering_per_m"]
    assert bands["attenuation_per_m"] == pytest.approx(total, rel=1e-12)


def test_a_phase_function_over_wavelength():
    mixture = HenyeyGreensteinPhase(type="hg", g=(0.5, 0.9)).mixture((400.0, 700.0))
    assert mixture.mean_cosine == pytest.approx(np.interp(WAVELENGTHS_NM, [400, 700], [0.5, 0.9]), abs=1e-6)


def test_a_reflectance_table_is_interpolated():
    sand = load_scene("tank_colorchecker").bodies[2]
    assert sand.spectrum[WAVELENGTHS_NM == 550] == pytest.approx(0.25)
    assert sand.heights_m.min() >= 0 and 0.03 < sand.heights_m.max() <= 0.04


def test_a_colorchecker_has_its_first_patch_at_the_top_left():
    chart = load_scene("tank_colorchecker").bodies[0]
    names = [name for name, _, _ in chart.patches]
    (_, first, _), (_, last, _) = chart.patches[0], chart.patches[-1]
    assert names[0] == "dark skin" and len(names) == 24
    assert first[0] < 0 < first[1] and last[1] < 0 < last[0]
    assert chart.width_m == pytest.approx(0.42) and chart.height_m < chart.width_m
