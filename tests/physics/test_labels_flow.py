"""The flow of a frame leads from the picture in the middle of the exposure to those at its start and its end.

Setup: a rig that moves and turns before a tilted plane, balls that turn themselves (`label_scenes`).
Expected: for the plane the homography of the motion; for all, the difference of two position buffers, which are made
of geometry alone.
Tolerance: round-off of float32; model (position buffers between pixels, balls of triangles).
"""

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.physics.label_scenes import BALLS, PLANE, buffers_of, own_rays, scene_of
from uwsim.camera import pose
from uwsim.render import film, geometry, motion
from uwsim.scene.models import Scene


@pytest.fixture(scope="module", autouse=True)
def _variant(llvm_spectral):
    pass


SIZE_PX = (320, 240)
MOTION = {"velocity_m_per_s": (1.5, -0.8, 2.0), "rotation_deg_per_s": (60.0, -40.0, 200.0)}


def test_flow_of_a_plane_is_a_homography():
    """Setup: pinhole in motion before the plane. Expected: at both ends of the exposure the picture of the plane is the
    one in the middle under H = K (R + t n^T / d) K^-1; 0.01 px (range in float32). Negative control: start and end
    exchanged, and H without the turn."""
    scene = scene_of("pinhole", PLANE, size_px=SIZE_PX, motion=MOTION)
    buffers = buffers_of(scene)
    start, end = motion.flow(scene, film.view_of(scene), buffers["range"])
    K, half_s = scene.rig.camera.K, scene.exposure.time_s / 2
    rows, columns = np.mgrid[: SIZE_PX[1], : SIZE_PX[0]] + 0.5
    pixels = np.stack([columns, rows, np.ones_like(rows)], axis=-1)
    normal = np.linalg.inv(scene.rig.world_from_rig)[:3, :3] @ np.subtract(PLANE["towards_m"], PLANE["position_m"])
    distance = normal @ pose.apply(pose.inverse(scene.rig.world_from_rig), np.array(PLANE["position_m"]))

    def moved(time_s: float, turned: bool = True) -> np.ndarray:
        turn = cv2.Rodrigues(np.radians(MOTION["rotation_deg_per_s"]) * time_s * turned)[0]
        there = np.array(MOTION["velocity_m_per_s"]) * time_s
        H = K @ turn.T @ (np.eye(3) - np.outer(there, normal) / distance) @ np.linalg.inv(K)
        places = pixels @ H.T
        return places[..., :2] / places[..., 2:] - pixels[..., :2]

    assert np.linalg.norm(end - start, axis=-1).min() > 0.5
    for found, time_s in ((start, -half_s), (end, half_s)):
        assert np.abs(found - moved(time_s)).max() < 0.01
        assert np.linalg.norm(found - moved(-time_s), axis=-1).min() > 0.5
        assert np.abs(found - moved(time_s, turned=False)).max() > 0.5


@pytest.mark.parametrize("camera", [pytest.param("distorted", marks=pytest.mark.slow), "port"])
def test_flow_leads_from_one_position_buffer_to_the_other(camera):
    """Setup: rig in motion and turning balls before the plane at rest. Position buffers: the point in its body's frame
    that each pixel sees, with rig and bodies where they are in the middle of the exposure, at its start and its end.
    Expected: `flow` further, the buffer of that moment has the point of the middle; by the buffer's own change from
    pixel to pixel half of the pixels within 0.01 px and 95 % within 0.1 px (the balls have facets and hide each other).
    Negative controls: the flow without that of the balls' own motion; start and end exchanged; half a pixel aside."""
    turning = BALLS | {"motion": {"velocity_m_per_s": (-1.0, 0.0, 1.0), "rotation_deg_per_s": (0.0, 0.0, 300.0)}}
    scene = scene_of(camera, PLANE, turning, size_px=SIZE_PX, motion=MOTION)
    view, half_s = film.view_of(scene), scene.exposure.time_s / 2
    flows = motion.flow(scene, view, *(buffers_of(scene)[name] for name in ("range", "instance")))
    at_rest = scene.model_copy(update={"bodies": scene_of(camera, PLANE, BALLS).bodies})
    alone = motion.flow(at_rest, view, buffers_of(scene)["range"])
    middle, numbers = positions(scene, 0.0)
    for index, time_s in enumerate((-half_s, half_s)):
        there, other = positions(scene, time_s)
        for number in (1, 2):
            off = missed_px(middle, there, other, flows[index], numbers, number)
            half, most = np.percentile(off, (50, 95))
            print(f"{camera}, body {number}: 50 % within {half:.4f}, 95 % within {most:.4f} px of {off.size}")
            assert off.size > 0.6 * np.sum(numbers == number)
            assert half < 0.01 and most < 0.1
            assert np.median(missed_px(middle, there, other, flows[index] + 0.35, numbers, number)) > 0.45
            assert np.median(missed_px(middle, there, other, flows[1 - index], numbers, number)) > 3
        assert np.median(missed_px(middle, there, other, alone[index], numbers, 2)) > 1


def positions(scene: Scene, time_s: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the points (H, W, 3) in their bodies' frames that the pixels see at a time, and the bodies' numbers."""
    placed = []
    for body in scene.bodies:
        then = body.poses_at(np.array([time_s]))[0]
        angles_deg = tuple(Rotation.from_matrix(then[:3, :3]).as_euler("XYZ", degrees=True))
        place = {"position_m": tuple(then[:3, 3]), "towards_m": None, "motion": None, "rotation_deg": angles_deg}
        placed.append(type(body).model_validate(body.model_dump() | place))
    moment = scene.model_copy(update={"bodies": tuple(placed)})
    rig = scene.rig.poses_at(np.array([time_s]))[0]
    buffers = geometry.geometry(moment, film.view_of(scene), world_from_camera=rig)
    origins, directions = own_rays(scene)
    ranges = np.where(np.isfinite(buffers["range"]), buffers["range"], 0)[..., None]
    world = pose.apply(rig, origins + directions * ranges)
    found = np.zeros_like(world)
    for number, body in enumerate(moment.bodies, start=1):
        mask = buffers["instance"] == number
        found[mask] = pose.apply(pose.inverse(body.world_from_body), world[mask])
    return found, buffers["instance"]


def missed_px(middle, there, other, flow, numbers, number) -> np.ndarray:
    """Return how far (n,) the point that a pixel saw is from where it should be; where the neighbours see its body."""
    rows, columns = np.nonzero(numbers == number)
    places = np.stack([columns, rows], axis=-1) + flow[rows, columns]  # in array indices
    whole = np.floor(places).astype(int)
    inside = np.all((whole >= 0) & (whole < np.subtract(SIZE_PX, 1)), axis=-1)
    rows, columns, places, whole = (values[inside] for values in (rows, columns, places, whole))
    x, y = (places - whole).T[..., None]
    left, top = whole.T
    a, b, c, d = (there[top + j, left + i] for j, i in ((0, 0), (0, 1), (1, 0), (1, 1)))
    same = np.all([other[top + j, left + i] == number for j, i in ((0, 0), (0, 1), (1, 0), (1, 1))], axis=0)
    value = (1 - y) * ((1 - x) * a + x * b) + y * ((1 - x) * c + x * d)
    slope = np.stack([(1 - y) * (b - a) + y * (d - c), (1 - x) * (c - a) + x * (d - b)], axis=-1)
    missed = middle[rows, columns] - value
    slope, missed = slope[same], missed[same][..., None]
    turned = np.swapaxes(slope, -1, -2)
    return np.linalg.norm(np.linalg.solve(turned @ slope, turned @ missed)[..., 0], axis=-1)
