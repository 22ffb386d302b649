"""What an IMU says of a known motion, integrated back to it, and the size of its errors.

Setup: an IMU off the rig's origin and turned against it, on a circle and on a hovering vehicle.
Expected: the closed form of circular motion; position and attitude from integrating angular rate and specific force.
Tolerance: round-off for the closed form; for the integral the error of the trapezoidal rule, which falls by 4 when the
step is halved; for noise the spread of a variance over 60 000 samples (0.6 %).
"""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.unit.test_kinematics import START, path_of
from uwsim.camera import imu, pose
from uwsim.camera.kinematics import Line, Path
from uwsim.scene.sequence import Imu, Sequence

G = imu.STANDARD_GRAVITY_M_PER_S2
RIG_FROM_IMU = Imu(position_m=(0.05, -0.02, 0.1), rotation_deg=(20.0, -35.0, 70.0)).rig_from_imu


def circle() -> Path:
    """A level rig on a circle of 0.4 m at 0.5 rad/s, turning about its y axis, which points down."""
    level = pose.looking_at((0.0, 0.4, -1.0), (0.0, 1.0, -1.0))
    return Path(level, turns=((), (Line(0.5),), ()), pivot_m=(0.0, 0.0, -0.4))


def integrated(states, rates, forces, *, step_s: float, gravity_m_per_s2: float = G) -> tuple[np.ndarray, np.ndarray]:
    """Return positions (n, 3) and attitudes (n, 3, 3) from the first state on, by the trapezoidal rule."""
    turns = Rotation.from_rotvec(step_s / 2 * (rates[1:] + rates[:-1])).as_matrix()
    attitude = [states.world_from_frame[0, :3, :3]]
    for turn in turns:
        attitude.append(attitude[-1] @ turn)
    attitude = np.stack(attitude)
    acceleration = np.einsum("nij,nj->ni", attitude, forces) - [0, 0, gravity_m_per_s2]

    def summed(first, rate):
        return first + np.concatenate([np.zeros((1, 3)), np.cumsum(step_s / 2 * (rate[1:] + rate[:-1]), axis=0)])

    velocity = summed(states.velocity_m_per_s[0], acceleration)
    return summed(states.world_from_frame[0, :3, 3], velocity), attitude


def missed(
    path: Path, *, step_s: float, duration_s: float = 5.0, change=lambda rates, forces: (rates, forces), **options
):
    """Return the largest errors of position [m] and attitude of an integral over a path."""
    times_s = np.arange(round(duration_s / step_s) + 1) * step_s
    states = path.states(times_s).mounted(RIG_FROM_IMU)
    positions, attitudes = integrated(states, *change(*imu.ideal(states)), step_s=step_s, **options)
    truth = states.world_from_frame
    return np.abs(positions - truth[:, :3, 3]).max(), np.abs(attitudes - truth[:, :3, :3]).max()


def test_at_rest_it_shows_gravity_upwards():
    rate, force = imu.ideal(Path(START).states(np.zeros(2)).mounted(RIG_FROM_IMU))
    up = (START @ RIG_FROM_IMU)[2, :3]  # of the world, along the IMU's axes
    assert np.all(rate == 0)
    assert force == pytest.approx(np.tile(G * up, (2, 1)), abs=1e-12)


def test_on_a_circle_it_shows_the_closed_form():
    """Rig axes: x ahead, y down, z outwards; f = -w^2 r outwards and g upwards. The IMU sits 0.1 m further out."""
    mounted = Imu(position_m=(0.0, 0.0, 0.1)).rig_from_imu
    rate, force = imu.ideal(circle().states(np.linspace(0, 9, 10)).mounted(mounted))
    assert rate == pytest.approx(np.tile([0, 0.5, 0], (10, 1)), abs=1e-12)
    assert force == pytest.approx(np.tile([0, -G, -(0.5**2) * 0.5], (10, 1)), abs=1e-12)


@pytest.mark.parametrize("path", [circle(), path_of("hover"), path_of("linear")], ids=["circle", "hover", "linear"])
def test_integrated_it_gives_the_trajectory_back(path):
    """Thrusters at 60 Hz, 1.8 mm/s, set the error of the rule: a velocity of 1.8 mm/s (w h)^2 / 12 = 5e-6 m/s."""
    coarse, fine = missed(path, step_s=1e-3), missed(path, step_s=5e-4)
    assert fine[0] < 5e-5 and fine[1] < 1e-6
    for before, after in zip(coarse, fine, strict=True):
        assert after < 0.3 * before or after < 1e-11


@pytest.mark.parametrize(
    ("wrong", "least_m"),
    [
        ({"gravity_m_per_s2": -G}, 200.0),  # g t^2
        ({"change": lambda rates, forces: (rates, -forces)}, 200.0),
        ({"change": lambda rates, forces: (-rates, forces)}, 1.0),
        ({"change": lambda rates, forces: (rates, forces @ RIG_FROM_IMU[:3, :3].T)}, 1.0),  # in the rig's axes
    ],
)
def test_control_a_wrong_sign_or_frame_leaves_the_circle(wrong, least_m):
    assert missed(circle(), step_s=1e-3, **wrong)[0] > least_m


def test_control_without_the_lever_arm_it_leaves_the_circle():
    path, times_s = circle(), np.arange(5001) * 1e-3
    turned = RIG_FROM_IMU.copy()
    turned[:3, 3] = 0
    rate, force = imu.ideal(path.states(times_s).mounted(turned))
    states = path.states(times_s).mounted(RIG_FROM_IMU)
    found, _ = integrated(states, rate, force, step_s=1e-3)
    assert np.abs(found - states.world_from_frame[:, :3, 3]).max() > 0.01


@pytest.mark.parametrize("rate_hz", [100.0, 400.0])
def test_errors_have_their_densities_at_any_rate(rate_hz):
    """Negative control: a density taken for the deviation of a sample is off by the square root of the rate."""
    made = imu.errors(
        60_000, rate_hz=rate_hz, noise_density=2e-3, random_walk=3e-3, first_bias=(0.1, 0.0, -0.1),
        rng=np.random.default_rng(5),
    )  # fmt: skip
    assert made.white.std(axis=0) == pytest.approx([2e-3 * np.sqrt(rate_hz)] * 3, rel=0.02)
    steps = np.diff(made.bias, axis=0)
    assert steps.std(axis=0) == pytest.approx([3e-3 / np.sqrt(rate_hz)] * 3, rel=0.02)
    assert made.bias[0] == pytest.approx([0.1, 0.0, -0.1])
    # means over one second: white noise has its density there, whatever the rate
    means = made.white[: 60_000 // int(rate_hz) * int(rate_hz)].reshape(-1, int(rate_hz), 3).mean(axis=1)
    assert means.std() == pytest.approx(2e-3, rel=0.15)
    assert abs(made.white.std() - 2e-3) > 0.9 * made.white.std() * 0.9


def test_samples_are_ideal_plus_bias_plus_noise_and_seeded():
    trajectory = {"kind": "arm_swing", "speed_percent": 100.0}
    sequence = Sequence.model_validate({"frames": 60, "trajectory": trajectory, "imu": {}})
    path = sequence.trajectory.path(START, seed=1, frame=0)
    times_s = sequence.sample_times_ns() * 1e-9
    assert len(times_s) == 401 and times_s[-1] == 2.0
    made, again, other = (sequence.imu.sampled(path, times_s, seed=seed, frame=0) for seed in (1, 1, 2))
    assert all(np.array_equal(made[name], again[name]) for name in made)
    assert not np.array_equal(made["specific_force_m_per_s2"], other["specific_force_m_per_s2"])
    rate, force = imu.ideal(path.states(times_s))
    left = made["angular_rate_rad_per_s"] - rate - made["gyroscope_bias_rad_per_s"]
    assert left.std() == pytest.approx(1.6968e-4 * np.sqrt(200), rel=0.1)
    left = made["specific_force_m_per_s2"] - force - made["accelerometer_bias_m_per_s2"]
    assert left.std() == pytest.approx(2e-3 * np.sqrt(200), rel=0.1)
    silent = {key: 0.0 for key in Imu.model_fields if "noise" in key or "walk" in key}
    quiet = Imu(**silent).sampled(path, times_s, seed=1, frame=0)
    assert np.array_equal(quiet["specific_force_m_per_s2"], force)
