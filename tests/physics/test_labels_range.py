"""Range and depth are those of closed forms that know nothing of the renderer, nor of the project's lens and port.

Setup: a tilted plane and balls before a pinhole, a distorted lens, and a lens behind a tilted flat port
(`label_scenes`). Expected: the equations of plane and sphere along rays by OpenCV and Snell's law.
Tolerance: round-off of float32; model (the balls are made of triangles).
"""

import numpy as np
import pytest

from tests.physics.label_scenes import AT_M, BALLS, CAMERAS, PLANE, RADIUS_M, buffers_of, own_rays, scene_of, to_world
from uwsim.camera import pose
from uwsim.scene.models import Scene


@pytest.fixture(scope="module", autouse=True)
def _variant(llvm_spectral):
    pass


def distances(scene: Scene, shift_px: float = 0.0) -> dict[str, np.ndarray]:
    """Return the range (H, W) of plane and balls by their equations, inf where missed, and the depth of the nearest."""
    origins, directions = own_rays(scene, shift_px=shift_px)
    at, way = to_world(origins) + AT_M, to_world(directions)
    normal = np.subtract(PLANE["towards_m"], PLANE["position_m"])
    plane = ((PLANE["position_m"] - at) @ normal) / (way @ normal)
    balls = np.full(plane.shape, np.inf)
    body = scene.bodies[1]
    for centre in pose.apply(body.world_from_body, body.points_m):
        offset = at - centre
        half = np.sum(offset * way, axis=-1)
        under = half**2 - np.sum(offset**2, axis=-1) + RADIUS_M**2
        balls = np.minimum(balls, np.where(under > 0, -half - np.sqrt(np.maximum(under, 0)), np.inf))
    nearest = np.minimum(plane, balls)
    return {"plane": plane, "balls": balls, "z_depth": origins[..., 2] + nearest * directions[..., 2]}


@pytest.mark.parametrize("camera", CAMERAS)
def test_range_and_depth_are_those_of_the_equations(camera):
    """Expected: the plane's range to 4e-6 of it, the balls' to 0.4 % of their radius away from the rim (facets), depth
    likewise. Negative control: rays half a pixel aside, off by 100 times as much on the plane."""
    scene = scene_of(camera, PLANE, BALLS)
    buffers = buffers_of(scene)
    found, expected = buffers["range"].astype(float), distances(scene)
    plane = (buffers["instance"] == 1) & np.isinf(expected["balls"])
    ball = (buffers["instance"] == 2) & np.isfinite(expected["balls"])
    assert plane.sum() > 50_000 and ball.sum() > 20_000
    off = np.abs(found / expected["plane"] - 1)[plane].max()
    aside = np.median(np.abs(found / distances(scene, 0.5)["plane"] - 1)[plane])
    print(f"{camera}: plane {off:.2e}, half a pixel aside {aside:.2e}")
    assert off < 4e-6 < aside / 100
    _, directions = own_rays(scene)
    facing = np.abs(np.sum(buffers["normal"] * to_world(directions), axis=-1)) > 0.35
    assert np.abs(found - expected["balls"])[ball & facing].max() < 0.004 * RADIUS_M
    depth = np.abs(buffers["z_depth"] - expected["z_depth"])
    assert depth[plane].max() < 5e-6 and depth[ball & facing].max() < 0.004 * RADIUS_M
