"""Computed bodies are seen where their description puts them, with the reflectance that it gives them.

Setup: spheres of a marker layout, a slanted edge and a ChArUco board before a pinhole camera; geometry buffers (rays
through pixel centres), and one small render of the board in water that does nothing, in a lamp's light.
Expected: the outline of a sphere of radius r at the camera-frame place c is the conic of the rays d that touch it,
(c.d)^2 = (|c|^2 - r^2) |d|^2; a face of share s has the albedo (1 - s) dark + s bright; the corners that OpenCV finds
are those of the truth.
Tolerance: model (masks of whole pixels: centroid 0.1 px, area 1 %; OpenCV's corners 0.1 px on average); round-off.
"""

import cv2
import numpy as np
import pytest

from tests.physics import scenes
from uwsim.images import srgb_uint8_from_linear
from uwsim.render import film, geometry
from uwsim.scene import truth
from uwsim.scene.models import Scene

SIZE = {"width_px": 640, "height_px": 480, "horizontal_fov_deg": 60.0}


@pytest.fixture(scope="module", autouse=True)
def _variant(llvm_spectral):
    return llvm_spectral


def scene_with(**body) -> Scene:
    """Return a body 0.7 m before a camera at (0, 0, -100) that looks along +y."""
    values = scenes.wall(distance_m=1.0).model_dump()
    values["rig"]["camera"] |= SIZE
    values["bodies"] = [{"name": "it", "position_m": (0.0, 0.7, -100.0)} | body]
    return Scene.model_validate(values)


def buffers_of(scene: Scene) -> dict[str, np.ndarray]:
    return geometry.geometry(scene, film.view_of(scene))


# ---- spheres ----


def layout(radius_m: float) -> Scene:
    # off the axis, where the outline's middle is not the image of the centre
    return scene_with(
        kind="marker_layout", layout="planar_4", edge_m=0.3, sphere_radius_m=radius_m,
        position_m=(0.12, 0.7, -99.92), rotation_deg=(70.0, 0.0, 0.0),
    )  # fmt: skip


def ellipse(centre_m: np.ndarray, radius_m: float, camera_matrix: np.ndarray) -> tuple[np.ndarray, float]:
    """Return centroid (2,) and area of the outline of a sphere at a place in the camera frame. [px]"""
    cone = np.outer(centre_m, centre_m) - (centre_m @ centre_m - radius_m**2) * np.eye(3)
    back = np.linalg.inv(camera_matrix)
    conic = back.T @ cone @ back  # x^T conic x >= 0 inside
    middle = -np.linalg.solve(conic[:2, :2], conic[:2, 2])
    level = -np.linalg.det(conic) / np.linalg.det(conic[:2, :2])
    area = np.pi * abs(level) / np.sqrt(abs(np.linalg.det(conic[:2, :2])))
    return middle, area


def outlines(radius_m: float):
    """Return for each sphere the centroid and area of its mask, of its ellipse, and the image of its centre."""
    scene = layout(radius_m)
    buffers = buffers_of(scene)
    points = truth.marker_points(scene, range_m=buffers["range"])
    count, labels, _, centroids = cv2.connectedComponentsWithStats((buffers["instance"] == 1).astype(np.uint8))
    assert count == 5
    camera_from_world = np.linalg.inv(scene.rig.world_from_rig)
    for point in points:
        assert point["visible"] and point["radius_m"] == radius_m
        local = camera_from_world[:3, :3] @ point["point_world_m"] + camera_from_world[:3, 3]
        label = labels[int(point["point_px"][1]), int(point["point_px"][0])]
        middle, area = ellipse(local, radius_m, np.array(scene.rig.camera.K))
        yield centroids[label] + 0.5, (labels == label).sum(), middle, area, np.array(point["point_px"])


def test_masks_of_spheres_are_the_ellipses_that_their_centres_and_radius_make():
    for mask, pixels, middle, area, _ in outlines(0.06):
        assert mask == pytest.approx(middle, abs=0.1)
        assert pixels == pytest.approx(area, rel=0.01)


def test_negative_control_the_image_of_the_centre_is_not_the_middle_of_the_mask():
    assert max(np.linalg.norm(mask - centre) for mask, _, _, _, centre in outlines(0.06)) > 0.5


# ---- tones ----


def test_the_halves_of_an_edge_have_its_two_reflectances():
    scene = scene_with(
        kind="slanted_edge", width_m=0.3, height_m=0.3, dark=0.1, bright=0.7, angle_deg=5.0,
        towards_m=(0.0, 0.0, -100.0),
    )  # fmt: skip
    buffers = buffers_of(scene)
    albedo = buffers["albedo"][..., 1]
    x = np.arange(640) + 0.5 - 320
    y = (240 - (np.arange(480) + 0.5))[:, None]
    right = x > -np.tan(np.radians(5.0)) * y
    seen = buffers["instance"] == 1
    assert seen.sum() > 20000
    wrong = np.abs(albedo - np.where(right, 0.7, 0.1)) > 1e-4
    assert wrong[seen].mean() < 1e-4
    assert (np.abs(albedo - np.where(right, 0.1, 0.7)) > 1e-4)[seen].all()  # control: the halves exchanged


def test_shares_at_vertices_mix_the_tones_between_them():
    scene = scene_with(
        kind="stones", diameters_m=(0.2, 0.2), dark=0.2, bright=0.6, seed=1, position_m=(0.0, 0.7, -100.05)
    )
    albedo = buffers_of(scene)["albedo"][..., 1]
    seen = albedo[albedo > 0]
    share = scene.bodies[0].parts["stones"].vertex_share
    assert 0.2 + 0.4 * share.min() - 1e-4 <= seen.min() and seen.max() <= 0.2 + 0.4 * share.max() + 1e-4
    assert seen.mean() == pytest.approx(0.2 + 0.4 * share.mean(), abs=0.03)  # one side of the stone
    assert abs(seen.mean() - (0.6 - 0.4 * share.mean())) > 0.03  # control: the tones exchanged


# ---- the board in a picture ----


def board_corners(scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    """Return the corners (n, 2) that OpenCV finds in a picture of a ChArUco board, and where they are in truth. [px]"""
    from uwsim.render.build import build
    from uwsim.render.frame import Rounds
    from uwsim.render.smooth import Options
    from uwsim.render.stopping import Until

    view = film.view_of(scene)
    rounds = Rounds(
        scene, view, Until(samples_per_batch=16, batches=2), names=("radiance",), checkpoint=None, progress=None,
        options=Options(),
    )  # fmt: skip
    built = build(scene, water=None, rig_poses=scene.rig.world_from_rig[None])
    light = rounds.picture("radiance", built, seed=3, view=view)["radiance"]
    image = srgb_uint8_from_linear(0.8 * light / np.percentile(light, 95))
    body = scene.bodies[0]
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, body.dictionary))
    theirs = cv2.aruco.CharucoBoard((body.columns, body.rows), body.square_m, body.marker_m, dictionary)
    grey = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY)
    corners, ids, _, _ = cv2.aruco.CharucoDetector(theirs).detectBoard(grey)
    enough = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 50, 1e-3)
    corners = cv2.cornerSubPix(grey, corners, (5, 5), (-1, -1), enough)
    points = truth.marker_points(scene, range_m=buffers_of(scene)["range"])
    assert all(point["visible"] for point in points)
    return corners.reshape(-1, 2) + 0.5, np.array([points[number]["point_px"] for number in ids.ravel()])


def test_opencv_finds_the_corners_of_a_charuco_board_where_the_truth_has_them():
    found, true = board_corners(
        scene_with(
            kind="charuco_board", columns=7, rows=5, square_m=0.07, marker_m=0.052, position_m=(0.0, 0.7, -100.0),
            towards_m=(0.0, 0.0, -100.0), rotation_deg=(12.0, -18.0, 6.0),
        )
    )  # fmt: skip
    assert len(found) >= 20
    assert np.abs((found - true).mean(axis=0)).max() < 0.1
    assert np.sqrt(np.mean((found - true) ** 2)) < 0.1
    # control: OpenCV's own pixel centres, half a pixel away
    assert np.abs((found - 0.5 - true).mean(axis=0)).max() > 0.1
