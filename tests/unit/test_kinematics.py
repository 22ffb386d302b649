"""Motion in closed form: derivatives, parts of a moving rig, trajectories of arm and vehicle."""

import json

import numpy as np
import pytest
from pydantic import TypeAdapter
from scipy.spatial.transform import Rotation

from uwsim.camera import pose, sea_motion
from uwsim.camera.kinematics import Harmonics, Line, Path, Shuttle
from uwsim.scene.sequence import trajectory_values
from uwsim.scene.trajectories import Motion

START = pose.looking_at((0.2, -0.1, -0.6), (0.3, 1.0, -0.7), roll_deg=12.0)
PART = pose.rotated(pose.from_parts(np.eye(3), (0.05, -0.02, 0.1)), (20.0, -35.0, 70.0))
HOVER = {"kind": "hover", "current": {"drift_m_per_s": [0.02, 0.0, 0.0]}, "heave": {}, "sway": {}, "thrusters": {}}
MOTIONS = {
    "linear": {"kind": "arm_linear", "speed_percent": 60.0, "direction": [1.0, 0.2, 0.0]},
    "swing": {"kind": "arm_swing", "speed_percent": 100.0, "axis": "x"},
    "hover": HOVER,
}


def motion(values: dict):
    return TypeAdapter(Motion).validate_json(json.dumps(values))


def path_of(name: str) -> Path:
    return motion(MOTIONS[name]).path(START, seed=3, frame=5)


@pytest.mark.parametrize("part", [np.eye(4), PART], ids=["rig", "part"])
@pytest.mark.parametrize("name", MOTIONS)
def test_derivatives_are_those_of_the_poses(name, part):
    """Central differences of step h miss by h^2/6 of the third derivative: (2 pi 60/s) x 2 m/s^2 for the vibration."""
    path, times_s, step_s = path_of(name), np.linspace(0.03, 6.3, 101), 1e-5
    here, before, after = (path.states(times_s + shift).mounted(part) for shift in (0.0, -step_s, step_s))
    change = (after.world_from_frame - before.world_from_frame) / (2 * step_s)
    assert change[:, :3, 3] == pytest.approx(here.velocity_m_per_s, abs=1e-7)
    accelerated = (after.velocity_m_per_s - before.velocity_m_per_s) / (2 * step_s)
    assert accelerated == pytest.approx(here.acceleration_m_per_s2, abs=2e-5)
    turn = np.swapaxes(here.world_from_frame[:, :3, :3], 1, 2) @ change[:, :3, :3]
    rate = np.stack([turn[:, 2, 1], turn[:, 0, 2], turn[:, 1, 0]], axis=-1)
    assert rate == pytest.approx(here.angular_rate_rad_per_s, abs=1e-8)
    spin_up = (after.angular_rate_rad_per_s - before.angular_rate_rad_per_s) / (2 * step_s)
    assert spin_up == pytest.approx(here.angular_acceleration_rad_per_s2, abs=1e-7)
    assert np.abs(here.velocity_m_per_s).max() > 1e-2  # it does move


def test_turns_about_three_axes_at_once_have_the_right_rate():
    """Negative control: rates of the angles added up as if the axes stayed."""
    turns = tuple(
        (Harmonics([size], [f], [size]), Line(rate)) for size, f, rate in ((0.7, 0.4, 1), (0.9, 0.3, -2), (1.1, 0.5, 3))
    )
    path, times_s = Path(START, turns=turns, pivot_m=(0.1, 0.0, -0.3)), np.linspace(0, 4, 41)
    here, after = path.states(times_s), path.states(times_s + 1e-6)
    moved = np.swapaxes(here.world_from_frame[:, :3, :3], 1, 2) @ after.world_from_frame[:, :3, :3]
    rate = Rotation.from_matrix(moved).as_rotvec() / 1e-6
    assert rate == pytest.approx(here.angular_rate_rad_per_s, abs=1e-4)
    added = np.stack([sum(turn(times_s)[1] for turn in about) for about in turns], axis=-1)
    assert np.abs(rate - added).max() > 1.0


def test_uniform_circular_motion_has_its_closed_form():
    """A rig that looks outwards from a pivot 0.4 m behind it and turns about its y axis, which points down."""
    level = pose.looking_at((0.0, 0.4, -1.0), (0.0, 1.0, -1.0))
    path = Path(level, turns=((), (Line(0.5),), ()), pivot_m=(0.0, 0.0, -0.4))
    times_s = np.linspace(0, 20, 101)
    states = path.states(times_s)
    angle = np.pi / 2 - 0.5 * times_s  # about the world's z, from x
    outwards = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=-1)
    ahead = np.stack([np.sin(angle), -np.cos(angle), 0 * angle], axis=-1)
    assert states.world_from_frame[:, :3, 3] == pytest.approx(0.4 * outwards - [0, 0, 1], abs=1e-12)
    assert states.velocity_m_per_s == pytest.approx(0.2 * ahead, abs=1e-12)
    assert states.acceleration_m_per_s2 == pytest.approx(-0.1 * outwards, abs=1e-12)
    assert states.angular_rate_rad_per_s == pytest.approx(np.tile([0, 0.5, 0], (101, 1)), abs=1e-12)


def test_a_shuttle_keeps_its_stroke_and_speed_and_has_no_jump():
    way = Shuttle(speed=0.06, stroke=0.2, ramp_s=0.25, rest_s=0.3)
    times_s = np.linspace(0, 15, 15001)
    place, speed, acceleration = way(times_s)
    assert (place.min(), place.max()) == pytest.approx((-0.1, 0.1), abs=1e-12)
    assert np.abs(speed).max() == pytest.approx(0.06, abs=1e-12)
    assert np.abs(np.diff(speed)).max() < 0.06 / 0.25 * 2 * 1.01e-3
    # of the acceleration: its steepest slope is 2 pi speed / ramp^2
    assert np.abs(np.diff(acceleration)).max() < 2 * np.pi * 0.06 / 0.25**2 * 1.01e-3
    assert np.mean(speed == 0) == pytest.approx(0.3 / (0.3 + 0.2 / 0.06 + 0.25), abs=0.03)
    assert place[0] == -0.1
    with pytest.raises(ValueError, match="stroke: got 0.01, allowed: at least 0.015"):
        Shuttle(speed=0.06, stroke=0.01, ramp_s=0.25)


@pytest.mark.parametrize("percent", [20.0, 60.0, 100.0])
def test_the_arm_moves_at_its_share_of_a_tenth_of_a_metre_per_second(percent):
    for kind in ("arm_linear", "arm_swing"):
        path = motion({"kind": kind, "speed_percent": percent}).path(START, seed=0, frame=0)
        speed = np.linalg.norm(path.states(np.linspace(0, 60, 60001)).velocity_m_per_s, axis=1)
        assert speed.max() == pytest.approx(percent / 1000, rel=1e-6)
    assert path.poses(np.zeros(1))[0] == pytest.approx(START, abs=1e-12)  # a swing begins in its middle


def test_an_irregular_motion_has_its_size_and_its_seed():
    times_s = np.linspace(0, 3000, 60001)
    made = [sea_motion.irregular(rms=0.2, peak_period_s=4.0, rng=np.random.default_rng(seed)) for seed in (1, 1, 2)]
    series = [one(times_s)[0] for one in made]
    assert [one.std() for one in series] == pytest.approx([0.2] * 3, rel=0.03)
    assert np.array_equal(series[0], series[1])
    assert np.corrcoef(series[0], series[2])[0, 1] == pytest.approx(0, abs=0.2)
    frequency_hz, power = np.fft.rfftfreq(60001, 0.05), np.abs(np.fft.rfft(series[0])) ** 2
    below = power[frequency_hz < 0.25].sum() / power.sum()
    assert below == pytest.approx(np.exp(-1.25), abs=0.03)  # of the spectrum's integral up to its peak


def test_waves_die_out_with_depth_and_run_in_circles():
    """A single depth of half the peak's wavelength leaves exp(-pi) of it; control: at the surface all of it."""
    height_m, period_s = 0.4, 3.0
    wavelength_m = 9.80665 * period_s**2 / (2 * np.pi)
    times_s = np.linspace(0, 3000, 60001)
    sizes = []
    for depth_m in (1e-6, wavelength_m / 2):
        forwards, upwards = sea_motion.waves(
            significant_height_m=height_m, peak_period_s=period_s, water_depth_m=depth_m, rng=np.random.default_rng(4)
        )
        sizes.append(upwards(times_s)[0].std())
        assert forwards(times_s)[0].std() == pytest.approx(sizes[-1], rel=0.02)
        # forwards under a crest: velocity along the waves and height go together
        assert np.corrcoef(forwards(times_s)[1], upwards(times_s)[0])[0, 1] > 0.8
    assert sizes[0] == pytest.approx(height_m / 4, rel=0.03)
    assert sizes[1] < sizes[0] * np.exp(-np.pi) * 3


def test_a_vibration_has_its_rms_velocity():
    shake = sea_motion.vibration(velocity_rms_m_per_s=0.0018, shaft_hz=20.0, blades=3, rng=np.random.default_rng(0))
    assert shake(np.arange(10000) / 10007.0)[1].std() == pytest.approx(0.0018, rel=0.01)


@pytest.mark.parametrize("name", MOTIONS)
def test_an_exposure_follows_the_trajectory(name):
    """Negative control: a uniform motion through the exposure leaves the vibration out."""
    path = path_of(name)
    values = trajectory_values(path.poses, middle_s=1.7, half_s=1 / 60, where="test")
    knots = np.array(values["times_s"])
    assert (knots[0], knots[len(knots) // 2], knots[-1]) == (-1 / 60, 0.0, 1 / 60)
    turns = Rotation.from_quat(values["quaternions_xyzw"]).as_matrix()
    poses = np.stack([pose.from_parts(turn, at) for turn, at in zip(turns, values["positions_m"], strict=True)])
    times_s = np.linspace(-1 / 60, 1 / 60, 333)

    def missed(kept):
        found = pose.interpolate(poses[kept], knots_s=knots[kept], times_s=times_s)
        return np.abs(pose.twist(pose.inverse(path.poses(1.7 + times_s)) @ found)).max()

    assert missed(slice(None)) < 2e-6
    if name == "hover":
        assert missed([0, -1]) > 5e-6


@pytest.mark.parametrize(
    ("values", "part"),
    [
        ({"kind": "arm_linear", "speed_percent": 120.0}, "less than or equal to 100"),
        ({"kind": "arm_linear", "speed_percent": 100.0, "direction": [0, 0, 0]}, "not all 0"),
        ({"kind": "arm_swing", "speed_percent": 50.0, "axis": "z"}, "at least 0.001 m"),
        ({"kind": "hover", "sway": {"rms_deg": [1.0, -1.0, 1.0]}}, "allowed: >= 0"),
    ],
)
def test_a_trajectory_that_is_none_is_refused(values, part):
    with pytest.raises(ValueError, match=part):
        motion(values)
