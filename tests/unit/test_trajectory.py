"""Paths on SE(3), what scenes say about them, and where a camera with a rolling shutter sees points."""

import tomllib

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.spatial.transform import Rotation, Slerp

from tests.physics import scenes
from uwsim.camera import pose
from uwsim.camera.lens import Lens
from uwsim.camera.shutter import Shutter, see
from uwsim.scene.models import Scene

TWIST = np.array([0.3, -0.8, 1.1, 0.4, 0.2, -0.5])  # turn [rad], shift [m]
START = pose.looking_at((0.2, -0.1, -1.0), (0.3, 1.0, -0.7))


def generator(twist: np.ndarray) -> np.ndarray:
    (x, y, z), shift = twist[:3], twist[3:]
    matrix = np.zeros((4, 4))
    matrix[:3, :3], matrix[:3, 3] = [[0, -z, y], [z, 0, -x], [-y, x, 0]], shift
    return matrix


@pytest.mark.parametrize("size", [1.0, 1e-2, 1e-5, 1e-9, 0.0])
def test_screw_is_the_matrix_exponential_and_twist_its_inverse(size):
    assert pose.screw(size * TWIST) == pytest.approx(expm(generator(size * TWIST)), abs=1e-14)
    assert pose.twist(pose.screw(size * TWIST)) == pytest.approx(size * TWIST, abs=1e-14)


def test_a_constant_twist_is_reproduced_exactly():
    """Negative control: positions and turns interpolated apart leave the screw."""
    knots, times = np.array([-1.0, -0.2, 0.7, 1.5]), np.linspace(-1.0, 1.5, 41)
    poses = np.stack([START @ expm(t * generator(TWIST)) for t in knots])
    expected = np.stack([START @ expm(t * generator(TWIST)) for t in times])
    found = pose.interpolate(poses, knots_s=knots, times_s=times)
    assert found == pytest.approx(expected, abs=1e-13)

    apart = np.stack([np.interp(times, knots, poses[:, axis, 3]) for axis in range(3)], axis=-1)
    turns = Slerp(knots, Rotation.from_matrix(poses[:, :3, :3]))(times).as_matrix()
    assert turns == pytest.approx(expected[:, :3, :3], abs=1e-12)  # the turn alone is the same
    assert np.abs(apart - expected[:, :3, 3]).max() > 0.02


def test_an_interpolated_path_meets_its_knots_and_refuses_what_lies_beyond():
    knots = np.array([0.0, 0.1, 0.5])
    poses = np.stack([START, START @ pose.screw(TWIST), START @ pose.screw(-0.5 * TWIST)])
    assert pose.interpolate(poses, knots_s=knots, times_s=knots) == pytest.approx(poses, abs=1e-13)
    with pytest.raises(ValueError, match="got times -0.1 to 0 s, allowed: 0 to 0.5 s"):
        pose.interpolate(poses, knots_s=knots, times_s=np.array([-0.1, 0.0]))
    with pytest.raises(ValueError, match="got 0.1 s before 0.05 s"):
        pose.interpolate(poses, knots_s=np.array([0.0, 0.1, 0.05]), times_s=knots[:1])


def scene_on(trajectory=None, readout_s=0.0, **rig) -> Scene:
    values = scenes.wall(distance_m=1.0).model_dump()
    place = {} if trajectory else {"position_m": (0, 0, -100), "look_at_m": (0, 1, -100)}
    rig = {"camera": values["rig"]["camera"], "lamps": values["rig"]["lamps"]} | place | rig
    rig |= {"trajectory": trajectory} if trajectory else {}
    kept = {key: values[key] for key in ("name", "description", "water", "bodies")}
    return Scene.model_validate(kept | {"rig": rig, "exposure": {"time_s": 0.01, "readout_s": readout_s}})


def line(**changes) -> dict:
    return {
        "times_s": (-0.01, 0.02),
        "positions_m": ((-0.01, 0, -100), (0.02, 0, -100)),
        "look_at_m": ((-0.01, 1, -100), (0.02, 1, -100)),
    } | changes


def test_a_straight_trajectory_is_a_uniform_motion():
    times_s = np.linspace(-0.005, 0.005, 11)
    by_motion = scene_on(motion={"velocity_m_per_s": (1.0, 0.0, 0.0)})
    assert scene_on(line()).rig.poses_at(times_s) == pytest.approx(by_motion.rig.poses_at(times_s), abs=1e-12)
    # a turn about the rig's own axes
    still = pose.looking_at((0, 0, -100), (0, 1, -100))
    ends = np.stack([still @ pose.screw(np.array([0, 0.3 * t, 0.2 * t, 0, 0, 0])) for t in (-1, 1)])
    turned = line(
        times_s=(-1.0, 1.0), positions_m=((0, 0, -100),) * 2, look_at_m=None,
        quaternions_xyzw=tuple(map(tuple, Rotation.from_matrix(ends[:, :3, :3]).as_quat().tolist())),
    )  # fmt: skip
    by_motion = scene_on(motion={"rotation_deg_per_s": (0.0, float(np.degrees(0.3)), float(np.degrees(0.2)))})
    assert scene_on(turned).rig.poses_at(times_s) == pytest.approx(by_motion.rig.poses_at(times_s), abs=1e-12)


@pytest.mark.parametrize(
    ("trajectory", "rig", "message"),
    [
        (line(times_s=(0.02, -0.01)), {}, "got 0.02 s before -0.01 s"),
        (line(times_s=(0.0, 0.0)), {}, "got 0 s before 0 s"),
        (line(times_s=(-0.001, 0.02)), {}, "-0.001 to 0.02 s do not cover .* -0.005 to 0.005 s"),
        (line(look_at_m=None), {}, "either quaternions_xyzw or look_at_m"),
        (line(look_at_m=((0, 1, -100),)), {}, "one of each"),
        (line(look_at_m=None, quaternions_xyzw=((0, 0, 0, 0.5),) * 2), {}, "length 0.5"),
        (line(look_at_m=None, quaternions_xyzw=((0, 0, 0, 1.0), (0, 0, 1.0, 0))), {}, "turn of 180 deg"),
        (line(positions_m=((0, 0, -1), (0, 0, 0.5))), {}, "below the water surface"),
        (line(), {"position_m": (0, 0, -1)}, "one way to say where"),
        (line(), {"motion": {}}, "one way to say where"),
        (line(), {"roll_deg": 5.0}, "one way to say where"),
        (None, {"look_at_m": None}, "position_m, look_at_m; or trajectory"),
    ],
)
def test_trajectories_that_cannot_be_are_refused(trajectory, rig, message):
    with pytest.raises(ValueError, match=message):
        scene_on(trajectory, **rig)


def test_a_trajectory_must_cover_the_readout_too():
    scene_on(line(), readout_s=0.009)
    with pytest.raises(ValueError, match="do not cover"):
        scene_on(line(), readout_s=0.02)


def test_what_moves_and_what_rests():
    assert not scene_on().moves and not scene_on(motion={}).moves
    assert scene_on(line()).moves and scene_on(motion={"rotation_deg_per_s": (0, 1.0, 0)}).moves
    rests = line(positions_m=((0, 0, -100),) * 2, look_at_m=((0, 1, -100),) * 2)
    assert not scene_on(rests).moves
    later = {
        "times_s": (-1.0, 0.5, 1.0),
        "positions_m": ((0, 0, -100), (0, 0, -100), (1.0, 0, -100)),
        "look_at_m": ((0, 1, -100), (0, 1, -100), (1.0, 1, -100)),
    }
    assert not scene_on(later).moves


LENS = Lens(K=np.array([[300.0, 0, 40], [0, 300, 30], [0, 0, 1]]))
DOWNWARDS = np.array([0.0, 1.0, 0.0])  # [m/s]


def falling(times_s):
    """A camera that moves down: points at 1 m rise by 300 px/s."""
    return np.stack([pose.from_parts(np.eye(3), DOWNWARDS * time) for time in times_s])


def test_a_rolling_shutter_sees_a_rising_point_where_scan_and_point_meet():
    """y = y0 - 300 t and t = readout (y / H - 1/2) + phase x exposure, solved for y.

    Negative control: as if all rows were exposed at once."""
    shutter = Shutter(height_px=60, exposure_s=0.02, readout_s=0.05)
    points = np.array([[0.01, (y - 30) / 300, 1.0] for y in (12.0, 30.0, 50.0)])
    for phase in (-0.5, 0.0, 0.5):
        pixels, local = see(points, lens=LENS, poses_at=falling, shutter=shutter, phase=phase)
        expected = (np.array([12.0, 30.0, 50.0]) + 300 * (0.025 - phase * 0.02)) / (1 + 300 * 0.05 / 60)
        assert pixels[:, 1] == pytest.approx(expected, abs=1e-6)
        assert pixels == pytest.approx(LENS.project(local)[0], abs=1e-9)
        at_once = see(points, lens=LENS, poses_at=falling, shutter=Shutter(height_px=60, exposure_s=0.02), phase=phase)[
            0
        ]
        assert np.abs(at_once[[0, 2], 1] - expected[[0, 2]]).min() > 1


def test_an_image_that_outruns_the_readout_is_refused():
    shutter = Shutter(height_px=60, exposure_s=0.02, readout_s=0.25)  # 75 rows in the time of 60
    with pytest.raises(ValueError, match="less than 60 px in 0.25 s"):
        see(np.array([[0, 0.01, 1.0]]), lens=LENS, poses_at=falling, shutter=shutter)


def test_rows_start_one_after_the_other_around_the_middle():
    shutter = Shutter(height_px=4, exposure_s=0.01, readout_s=0.04)
    assert shutter.row_middles_s() == pytest.approx([-0.015, -0.005, 0.005, 0.015])
    assert shutter.span_s == pytest.approx(0.05)
    assert shutter.step_times_s(5) == pytest.approx([-0.02, -0.01, 0, 0.01, 0.02])


def test_port_trajectory_and_readout_as_a_file_has_them():
    text = """
    name = "moving"
    description = "port, path and readout"
    water = {name = "tank_clear", refractive_index = 1.34}
    exposure = {time_s = 0.01, readout_s = 0.02}
    [rig.camera]
    width_px = 64
    height_px = 48
    horizontal_fov_deg = 60
    distortion = [-0.1, 0.01, 0, 0]
    housing = {radius_m = 0.06, length_m = 0.2}
    [rig.camera.port]
    kind = "dome"
    inner_radius_m = 0.05
    thickness_m = 0.004
    decentring_m = [0, 0, 0.005]
    [rig.trajectory]
    times_s = [-1, 0, 1]
    positions_m = [[-1, 0, -1], [0, 0, -1], [1, 0, -1]]
    quaternions_xyzw = [[0.7071, 0, 0, -0.7071], [0.7071, 0, 0, -0.7071], [0.7071, 0, 0, -0.7071]]
    [[rig.lamps]]
    position_m = [0.3, 0, 0]
    look_at_m = [0, 0, 1]
    radiant_intensity_w_per_sr = 1.0
    half_angle_deg = 40
    spectrum = "E"
    [[bodies]]
    name = "wall"
    kind = "rectangle"
    width_m = 5
    height_m = 5
    reflectance = 0.5
    position_m = [0, 1, -1]
    towards_m = [0, 0, -1]
    """
    scene = Scene.model_validate(tomllib.loads(text))
    assert scene.rig.poses_at(np.array([0.5]))[0, :3, 3] == pytest.approx([0.5, 0, -1])
    assert scene.rig.world_from_rig[:3, 2] == pytest.approx([0, 1, 0], abs=1e-12)  # looks along world y
    assert scene.lens.port.n_water == 1.34 and scene.shutter.readout_s == 0.02
    again = Scene.model_validate(scene.model_dump())
    assert again == scene
