"""Masks of balls end at their outline, and the labels of their centres are where light from there arrives.

Setup: balls before a pinhole, a distorted lens, and a lens behind a tilted flat port (`label_scenes`).
Expected: the outline is the hull of the images of points all over a ball, for the pinhole the ellipse of the rays that
touch it; the centre's image is where the shortest optical path from there meets the picture.
Tolerance: model (masks of whole pixels, balls of triangles).
"""

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.spatial import ConvexHull

from tests.physics.label_scenes import (
    BALLS,
    GAP_M,
    GLASS_M,
    HEIGHT_PX,
    N_GLASS,
    RADIUS_M,
    WIDTH_PX,
    buffers_of,
    port_normal,
    scene_of,
)
from uwsim.camera import pose
from uwsim.scene import truth
from uwsim.scene.models import Scene


@pytest.fixture(scope="module", autouse=True)
def _variant(llvm_spectral):
    pass


def outline(scene: Scene, centre_m: np.ndarray) -> tuple[np.ndarray, float, float]:
    """Return centroid (2,), area and length of the outline of a ball [px]: what its surface's points are imaged on."""
    # those near the rim, about the direction to the camera
    turn = pose.looking_at(centre_m, scene.rig.position_m)[:3, :3]
    polar, azimuth = np.meshgrid(np.radians(np.arange(60, 120, 0.5)), np.radians(np.arange(0, 360, 0.5)))
    points = np.stack([np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)], axis=-1)
    points = centre_m + RADIUS_M * points.reshape(-1, 3) @ turn.T
    pixels = scene.lens.project(pose.apply(pose.inverse(scene.rig.world_from_rig), points))[0]
    hull = ConvexHull(pixels)
    corners = pixels[hull.vertices]
    x, y = corners.T
    cross = x * np.roll(y, -1) - np.roll(x, -1) * y
    middle = ((corners + np.roll(corners, -1, axis=0)) * cross[:, None]).sum(axis=0) / (3 * cross.sum())
    return middle, hull.volume, hull.area


def ellipse(scene: Scene, centre_m: np.ndarray) -> tuple[np.ndarray, float]:
    """Return centroid (2,) and area [px] of a ball's outline through the pinhole K alone.

    The rays d that touch it: (c.d)^2 = (|c|^2 - r^2) |d|^2.
    """
    local = pose.apply(pose.inverse(scene.rig.world_from_rig), centre_m)
    cone = np.outer(local, local) - (local @ local - RADIUS_M**2) * np.eye(3)
    back = np.linalg.inv(scene.rig.camera.K)
    conic = back.T @ cone @ back
    level = np.linalg.det(conic) / np.linalg.det(conic[:2, :2])
    return -np.linalg.solve(conic[:2, :2], conic[:2, 2]), np.pi * abs(level) / np.sqrt(np.linalg.det(conic[:2, :2]))


@pytest.mark.parametrize("camera", ["pinhole", pytest.param("distorted", marks=pytest.mark.slow), "port"])
def test_masks_of_balls_end_at_their_outline(camera):
    """Setup: three balls, one after the other. Expected: centroid of the mask and of the outline
    agree to 0.05 px, and the mask's edge is on average within 0.1 px of the outline: difference of areas over its
    length. For the pinhole, hull and ellipse agree too, 0.02 px. Negative controls: half a pixel aside; the ellipse
    without port or distortion; the image of the centre."""
    layout = scene_of(camera, BALLS).bodies[0]
    one = {"name": "one", "kind": "marker_layout", "layout": "planar_4", "edge_m": 20.0, "sphere_radius_m": RADIUS_M}
    wrong, centre_off = [], []
    for centre in pose.apply(layout.world_from_body, layout.points_m)[[0, 2, 4]]:
        # one corner of a square of 20 m; the others are out of view
        scene = scene_of(camera, one | {"position_m": tuple(centre - (10.0, 10.0, 0.0)), "rotation_deg": (0, 0, 0)})
        buffers = buffers_of(scene)
        rows, columns = np.nonzero(buffers["instance"])
        assert rows.min() > 0 and columns.min() > 0 and rows.max() < HEIGHT_PX - 1 and columns.max() < WIDTH_PX - 1
        mask = np.array([columns.mean(), rows.mean()]) + 0.5
        middle, area, length = outline(scene, centre)
        assert np.linalg.norm(mask - middle) < 0.05
        assert abs(len(rows) - area) / length < 0.1
        assert np.linalg.norm(mask + 0.5 - middle) > 0.5
        own, own_area = ellipse(scene, centre)
        if camera == "pinhole":
            assert own == pytest.approx(middle, abs=0.02) and abs(own_area - area) / length < 0.02
        wrong.append(np.linalg.norm(mask - own))
        point = truth.marker_points(scene, range_m=buffers["range"])[0]
        assert np.linalg.norm(np.array(point["point_world_m"]) - centre) < 1e-9 and point["visible"]
        centre_off.append(np.linalg.norm(np.array(point["point_px"]) - mask))
    assert max(centre_off) > 0.3
    assert camera == "pinhole" or max(wrong) > 0.6


def test_centres_behind_the_port_are_where_fermat_has_them():
    """Expected: `point_px` is where the shortest optical path from the centre to the pinhole meets the picture, found
    by minimising it; 0.01 px. Negative control: the straight line to the pinhole, pixels away."""
    scene = scene_of("port", BALLS)
    points = truth.marker_points(scene, range_m=buffers_of(scene)["range"])
    normal, n_water, K = port_normal(), scene.water.refractive_index, scene.rig.camera.K
    across = np.linalg.svd(normal[None])[2][1:]
    for point in points:
        local = pose.apply(pose.inverse(scene.rig.world_from_rig), np.array(point["point_world_m"]))

        def faces(places, normal=normal):
            first, second = places.reshape(2, 2) @ across
            return first + GAP_M * normal, second + (GAP_M + GLASS_M) * normal

        def optical_path(places, local=local):
            inner, outer = faces(places)
            legs = (inner, outer - inner, local - outer)
            return 1e3 * np.dot((1.0, N_GLASS, n_water), [np.linalg.norm(leg) for leg in legs])

        straight = np.concatenate([across @ local * d / (local @ normal) for d in (GAP_M, GAP_M + GLASS_M)])
        found = minimize(optical_path, straight, method="Nelder-Mead", options={"xatol": 1e-10, "fatol": 1e-14,
                                                                               "maxiter": 4000})  # fmt: skip
        inner, _ = faces(found.x)
        pixel = (K @ inner / inner[2])[:2]
        assert point["point_px"] == pytest.approx(pixel, abs=0.01)
        assert np.abs((K @ local / local[2])[:2] - pixel).max() > 3
