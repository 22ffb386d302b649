"""Motion given as blur at the image's centre, the range that it is meant for, and the kernel along a path."""

import copy

import numpy as np
import pytest

from uwsim.camera import pose
from uwsim.camera.streak import streak
from uwsim.motion_blur.kernels import kernel, kernel_of_path
from uwsim.scene.blur_motion import BlurMotion
from uwsim.scene.load import scene_values
from uwsim.scene.models import Scene
from uwsim.validation import validated

PORT = {"kind": "flat", "gap_m": 0.02, "thickness_m": 0.01, "tilt_deg": 6.0}


def scene(motion: dict | None, *, name: str = "tank_usaf", bodies=None, camera=None, exposure=None) -> Scene:
    values = copy.deepcopy(scene_values(name)[0])
    values["rig"] |= {} if motion is None else {"motion": motion}
    values["rig"]["camera"] |= camera or {}
    values["exposure"] |= exposure or {}
    values |= {} if bodies is None else {"bodies": bodies}
    return validated(Scene, values, where="test")


def blur(length_px: float, angle_deg: float, **more) -> dict:
    return {"blur_length_px": length_px, "blur_angle_deg": angle_deg} | more


def test_behind_no_port_the_rig_moves_by_the_range_over_the_focal_length_against_the_blur():
    found = scene(blur(20.0, 30.0, range_m=0.8))
    K, time_s = found.rig.camera.K, found.exposure.time_s
    speed = 20.0 * 0.8 / K[0, 0] / time_s  # the picture moves right and up, the rig left and down
    expected = (-speed * np.cos(np.pi / 6), speed * np.sin(np.pi / 6), 0.0)
    assert found.rig.motion.velocity_m_per_s == pytest.approx(expected, rel=1e-6)
    assert validated(Scene, found.model_dump(), where="test") == found  # it says velocities now, and stays as it is


@pytest.mark.parametrize("port", [None, PORT])
@pytest.mark.parametrize("turn", [(0.0, 0.0, 0.0), (40.0, -100.0, 300.0)])
@pytest.mark.parametrize("angle_deg", [0.0, 60.0, 135.0, 240.0])
def test_the_point_in_the_middle_moves_as_asked(port, turn, angle_deg):
    """Expected: projected at both ends of the exposure, what the centre sees is as far apart as asked, 1e-5 px.
    Negative control: another range."""
    asked = blur(12.0, angle_deg, range_m=0.7, rotation_deg_per_s=turn)
    found = scene(asked, camera={"port": port, "distortion": (-0.1, 0.02, 0.0, 0.0)})
    half_s, lens = found.exposure.time_s / 2, found.lens

    def chord(range_m):
        origin, direction = lens.rays(np.array([320.0, 240.0]))
        point = pose.apply(found.rig.world_from_rig, origin + range_m * direction)
        start, end = found.rig.poses_at(np.array([-half_s, half_s]))
        ends = [lens.project(pose.apply(pose.inverse(at), point))[0] for at in (start, end)]
        return ends[1] - ends[0]

    angle = np.radians(angle_deg)
    assert chord(0.7) == pytest.approx(12.0 * np.array([np.cos(angle), -np.sin(angle)]), abs=1e-5)
    assert np.linalg.norm(chord(0.9) - chord(0.7)) > 1.0


def test_without_a_range_it_is_that_of_what_the_middle_sees():
    """Expected: the chart's plane at 1 m, the relief's where the ray meets it, the star's; and no blur is no motion."""
    assert scene(blur(20.0, 30.0)).rig.motion == scene(blur(20.0, 30.0, range_m=1.0)).rig.motion
    star = {"name": "star", "kind": "siemens_star", "width_m": 0.3, "diameter_m": 0.2, "position_m": (0.0, 0.5, -0.6),
            "towards_m": (0.0, 0.0, -0.6), "rotation_deg": (30.0, 0.0, 0.0)}  # fmt: skip
    turned = scene(blur(20.0, 30.0), bodies=[star]).rig.motion
    assert turned == scene(blur(20.0, 30.0, range_m=0.5), bodies=[star]).rig.motion
    relief = scene(blur(20.0, 30.0), name="tank_relief")
    K, shift_m = relief.rig.camera.K, np.linalg.norm(relief.rig.motion.velocity_m_per_s) * relief.exposure.time_s
    range_m = shift_m * K[0, 0] / 20.0
    heights = relief.bodies[0].heights_m
    assert 1.2 - heights.max() - 1e-6 <= range_m <= 1.2 and range_m != pytest.approx(1.5)
    assert not scene(blur(0.0, 0.0)).moves


@pytest.mark.parametrize(
    ("motion", "changes", "message"),
    [
        ({"blur_length_px": 5.0}, {}, "rig.motion.blur_angle_deg: missing"),
        (blur(5.0, 360.0), {}, "rig.motion.blur_angle_deg: got 360.0, allowed: < 360"),
        (blur(-5.0, 0.0), {}, "rig.motion.blur_length_px: got -5.0, allowed: >= 0"),
        (blur(5.0, 0.0, velocity_m_per_s=(0.0, 0.0, 0.0)), {}, "velocity_m_per_s: unknown key"),
        ({"velocity": (0.0, 0.0, 0.0)}, {}, "rig.motion.velocity: unknown key, allowed: velocity_m_per_s"),
        (blur(5.0, 0.0, range_m=0.0), {}, "rig.motion.range_m: got 0.0, allowed: > 0"),
        (
            blur(5.0, 0.0),
            {"bodies": [{"name": "aside", "kind": "rectangle", "width_m": 0.1, "height_m": 0.1, "reflectance": 0.5,
                         "position_m": (1.0, 1.0, -0.6), "towards_m": (0.0, 0.0, -0.6)}]},
            "rig.motion.range_m: missing, and the image's centre sees no body",
        ),
        (blur(5.0, 0.0, rotation_deg_per_s=(0.0, 60_000.0, 0.0)), {}, "no sideways motion blurs by 5 px"),
    ],
)  # fmt: skip
def test_refusals(motion, changes, message):
    with pytest.raises(ValueError, match=message):
        scene(motion, **changes)


def test_a_rig_alone_does_not_know_how_a_blur_moves_it():
    with pytest.raises(ValueError, match="allowed: in a scene"):
        type(scene(None).rig).model_validate(scene(None).rig.model_dump() | {"motion": blur(5.0, 0.0)}).poses_at(
            np.ones(1)
        )


# ---- path and kernel ----


def camera_entry(found: Scene, *, times: int = 17) -> dict:
    """Return the `camera` entry of a frame.json as far as a path needs it."""
    from uwsim.camera.lens import port_record

    half_s = found.shutter.span_s / 2
    times_s = np.linspace(-half_s, half_s, times)
    camera = found.rig.camera
    return {
        "width_px": camera.width_px, "height_px": camera.height_px, "K": camera.K.tolist(),
        "distortion": camera.distortion, "port": port_record(found.lens.port), "readout_s": found.exposure.readout_s,
        "times_s": times_s.tolist(), "world_from_camera_through_exposure": found.rig.poses_at(times_s).tolist(),
    }  # fmt: skip


@pytest.mark.parametrize("readout_s", [0.0, 0.003])
def test_the_path_of_the_centre_is_the_blur_asked_for(readout_s):
    found = scene(blur(16.0, 60.0, range_m=0.8), camera={"port": PORT}, exposure={"readout_s": readout_s})
    path = streak(
        camera_entry(found), exposure_s=found.exposure.time_s, pixels_px=np.array([320.0, 240.0]), range_m=np.array(0.8)
    )
    assert path.shape == (65, 2) and np.abs(path[32]).max() < 1e-6
    assert path[-1] - path[0] == pytest.approx((8.0, -16.0 * np.sqrt(3) / 2), abs=1e-4)
    kind = BlurMotion(**blur(16.0, 60.0))
    assert kernel_of_path(33, path) == pytest.approx(
        kernel(33, length_px=kind.blur_length_px, angle_deg=kind.blur_angle_deg), abs=1e-3
    )
    # a millimetre per frame at rest
    still = camera_entry(scene(None), times=1)
    at_rest = streak(still, exposure_s=0.01, pixels_px=np.full((2, 3, 2), 50.0), range_m=np.ones((2, 3)), times=3)
    assert at_rest.shape == (3, 2, 3, 2) and np.abs(at_rest).max() < 1e-6


def test_a_moving_body_carries_its_points():
    """Setup: rig at rest, a body that moves sideways at 1 m. Expected: its points move by f v t / Z; the path of the
    same points at rest has no length."""
    found = scene(None)
    camera = camera_entry(found)
    K, time_s = found.rig.camera.K, found.exposure.time_s
    poses = np.tile(np.eye(4), (17, 1, 1))
    poses[:, 0, 3] = 2.0 * np.asarray(camera["times_s"])
    body = {"name": "it", "world_from_body_through_exposure": poses.tolist()}
    at = {"exposure_s": time_s, "pixels_px": np.array([100.0, 50.0]), "range_m": np.array(1.0)}
    moved = streak(camera, **at, body=body)
    direction = np.linalg.inv(K) @ (100.0, 50.0, 1.0)
    z_m = 1.0 / np.linalg.norm(direction)
    assert moved[-1] - moved[0] == pytest.approx((K[0, 0] * 2.0 * time_s / z_m, 0.0), abs=1e-6)
    assert np.abs(streak(camera, **at)).max() < 1e-9
    with pytest.raises(ValueError, match="rolling shutter"):
        streak(camera | {"readout_s": 0.01}, **at, body=body)
    with pytest.raises(ValueError, match="not finite"):
        streak(camera, **at | {"range_m": np.array(np.inf)})


def test_the_kernel_of_a_path_has_its_time_where_the_path_is():
    """Expected: sum 1; centroid and variances are those of the path, the latter wider by a pixel's 1/12; the kernel of
    a uniform line is `kernel`'s. Negative control: the path run backwards in space."""
    times = np.linspace(-0.5, 0.5, 201)
    path = np.stack([9 * times + 6 * times**2, -4 * times], axis=-1)  # uneven, not centred
    found = kernel_of_path(33, path)
    rows, columns = np.mgrid[:33, :33] - 16
    mean = np.array([np.sum(found * columns), np.sum(found * rows)])
    assert found.sum() == pytest.approx(1)
    assert mean == pytest.approx(path.mean(axis=0), abs=0.02)
    assert np.sum(found * (columns - mean[0]) ** 2) == pytest.approx(path[:, 0].var() + 1 / 12, abs=0.1)
    assert np.abs(kernel_of_path(33, -path) - found).sum() > 0.5
    line = np.linspace(-0.5, 0.5, 2)[:, None] * (10 * np.cos(np.radians(40)), -10 * np.sin(np.radians(40)))
    assert kernel_of_path(15, line) == pytest.approx(kernel(15, length_px=10, angle_deg=40), abs=1e-12)
    assert kernel_of_path(3, np.zeros((2, 2)))[1, 1] == 1
    with pytest.raises(ValueError, match="odd and at least 9.959"):
        kernel_of_path(9, 1.3 * line)
    with pytest.raises(ValueError, match="odd"):
        kernel_of_path(14, line)
    with pytest.raises(ValueError, match="n >= 2"):
        kernel_of_path(15, np.zeros((1, 2)))
