"""Every kind of body stands where its description says, the right way round, with its own reflectance."""

import cv2
import numpy as np
import pytest

from tests.physics import scenes
from tests.system.broken_placement import cube
from uwsim.camera import pinhole, pose
from uwsim.optics.sources import camera_response
from uwsim.optics.spectrum import band_mean
from uwsim.render import film, geometry
from uwsim.scene.models import Scene


@pytest.fixture(scope="module", autouse=True)
def _variant():
    from uwsim.render import variants

    variants.use()


def seen(*bodies):
    """Return (scene, geometry buffers) of bodies before a camera at (0, 0, -100) that looks along +y."""
    values = scenes.wall(distance_m=1.0).model_dump()
    values["rig"]["camera"] |= {"width_px": 80, "height_px": 60, "horizontal_fov_deg": 50.0}
    values["bodies"] = [{"position_m": (0.0, 1.0, -100.0), "towards_m": (0.0, 0.0, -100.0)} | body for body in bodies]
    scene = Scene.model_validate(values)
    buffers = geometry.geometry(scene, film.view_of(scene), world_from_camera=scene.rig.world_from_rig)
    return scene, buffers


def pixel_of(scene, point_body):
    """Return (row, column) of a point given in the frame of the first body."""
    world = pose.apply(scene.bodies[0].world_from_body, np.array(point_body))
    column, row = pinhole.project(pose.apply(pose.inverse(scene.rig.world_from_rig), world), scene.rig.camera.K)
    return int(row), int(column)


def test_a_mesh_is_scaled_and_placed(tmp_path):
    (tmp_path / "cube.ply").write_text(cube())
    mesh = {"name": "cube", "kind": "mesh", "file": str(tmp_path / "cube.ply"), "scale": 0.1, "reflectance": 0.6}
    wall = {"name": "wall", "kind": "rectangle", "width_m": 9, "height_m": 9, "reflectance": 0.2}
    scene, buffers = seen(mesh, wall | {"position_m": (0.0, 2.0, -100.0)})
    assert buffers["z_depth"][30, 40] == pytest.approx(0.9, rel=1e-5)  # a face 0.1 m before the cube's centre
    assert buffers["instance"][30, 40] == 1
    assert buffers["instance"][2, 2] == 2
    assert buffers["z_depth"][2, 2] == pytest.approx(2.0, rel=1e-5)
    np.testing.assert_allclose(buffers["albedo"][30, 40], 0.6, rtol=1e-5)
    np.testing.assert_allclose(buffers["normal"][30, 40], (0, -1, 0), atol=1e-5)


def test_a_heightfield_rises_out_of_its_plane_with_row_0_on_top(tmp_path):
    relief = np.zeros((64, 64), np.uint16)
    relief[:32, :] = 65535  # the upper half stands out
    cv2.imwrite(str(tmp_path / "relief.png"), relief)
    body = {
        "name": "relief", "kind": "heightfield", "file": str(tmp_path / "relief.png"), "reflectance": 0.5,
        "width_m": 0.6, "height_m": 0.6, "relief_m": 0.1,
    }  # fmt: skip
    _, buffers = seen(body)
    assert buffers["z_depth"][20, 40] == pytest.approx(0.9, rel=1e-4)
    assert buffers["z_depth"][40, 40] == pytest.approx(1.0, rel=1e-4)


def test_a_textured_chart_is_the_right_way_round(tmp_path):
    picture = np.full((40, 40), 255, np.uint8)
    picture[:20, :20] = 0  # top left dark
    cv2.imwrite(str(tmp_path / "chart.png"), picture)
    body = {"name": "chart", "kind": "textured", "file": str(tmp_path / "chart.png"), "width_m": 0.5}
    scene, buffers = seen(body | {"dark": 0.1, "bright": 0.7})
    corners = {(-0.15, 0.15): 0.1, (0.15, 0.15): 0.7, (-0.15, -0.15): 0.7, (0.15, -0.15): 0.7}
    for (x, y), reflectance in corners.items():
        np.testing.assert_allclose(buffers["albedo"][pixel_of(scene, (x, y, 0))], reflectance, rtol=1e-4)
    assert pixel_of(scene, (-0.15, 0.15, 0)) < (30, 40)  # the body's x is right, y up in the picture


def test_every_patch_of_the_colorchecker_has_its_own_reflectance():
    scene, buffers = seen({"name": "chart", "kind": "colorchecker", "width_m": 0.7})
    response = camera_response(scene.rig.camera.response)
    found = []
    for _, (x, y), reflectance in scene.bodies[0].patches:
        found.append(buffers["albedo"][pixel_of(scene, (x, y, 0))])
        np.testing.assert_allclose(found[-1], band_mean(reflectance, response), rtol=2e-3)
    assert len(np.unique(np.round(found, 4), axis=0)) == 24
    assert found[18].min() > 0.8  # the white patch is at the lower left
    assert pixel_of(scene, (*scene.bodies[0].patches[18][1], 0)) > (30, 0)


def test_the_bars_of_the_usaf_chart_lie_where_its_layout_says():
    """Tolerance 0.1 of the contrast: a pixel centre lies up to 0.4 bar widths from the middle of the bar."""
    scene, buffers = seen({"name": "chart", "kind": "usaf_1951", "width_m": 0.7, "first_group": -5, "last_group": -5})
    chart = scene.bodies[0].layout
    first = chart.elements[0]
    for left, top, right, bottom in first.bars_mm:
        x = ((left + right) / 2 - chart.width_mm / 2) / 1e3
        y = (chart.height_mm / 2 - (top + bottom) / 2) / 1e3
        np.testing.assert_allclose(buffers["albedo"][pixel_of(scene, (x, y, 0))], 0.03, atol=0.1)
        beside = pixel_of(scene, (x + (right - left) / 1e3 if right - left < bottom - top else x, y, 0))
        if right - left < bottom - top:  # an upright bar: the gap to its right is bright
            np.testing.assert_allclose(buffers["albedo"][beside], 0.80, atol=0.1)
