"""A sequence: frames at a steady rate along a trajectory, an IMU on the rig, and the rig's cameras."""

from collections.abc import Callable
from typing import Annotated

import numpy as np
from pydantic import Field, model_validator
from scipy.spatial.transform import Rotation

from uwsim import seeds
from uwsim.camera import imu, pose
from uwsim.camera.kinematics import Path
from uwsim.scene.base import NonNegative, Positive, Strict, Vector3
from uwsim.scene.placed import Name
from uwsim.scene.trajectories import Motion

_MOST_KNOTS = 1025
_WITHIN = 1e-6  # [m], [rad]: 0.001 px at f = 763 px, 0.004 px of something 0.2 m away
_PLAIN_SAMPLES_PER_FRAME = 10
_GOLDEN = (np.sqrt(5) - 1) / 2


class Imu(Strict):
    """An IMU on the rig, at `position_m` in rig axes, turned by `rotation_deg` about its own x, then y, then z.

    Terms and units of Kalibr, see `uwsim.camera.imu.errors`; biases are those at the sequence's start.
    Source: densities and random walks: ADIS16448 of the EuRoC datasets, Burri et al. 2016,
    doi:10.1177/0278364915620033 (mav0/imu0/sensor.yaml).
    """

    rate_hz: Annotated[float, Field(ge=1, le=10_000)] = 200.0
    position_m: Vector3 = (0.0, 0.0, 0.0)
    rotation_deg: Vector3 = (0.0, 0.0, 0.0)
    gravity_m_per_s2: Positive = imu.STANDARD_GRAVITY_M_PER_S2
    gyroscope_noise_density_rad_per_s_per_sqrt_hz: NonNegative = 1.6968e-4
    gyroscope_random_walk_rad_per_s2_per_sqrt_hz: NonNegative = 1.9393e-5
    gyroscope_bias_rad_per_s: Vector3 = (0.0, 0.0, 0.0)
    accelerometer_noise_density_m_per_s2_per_sqrt_hz: NonNegative = 2.0e-3
    accelerometer_random_walk_m_per_s3_per_sqrt_hz: NonNegative = 3.0e-3
    accelerometer_bias_m_per_s2: Vector3 = (0.0, 0.0, 0.0)

    @property
    def rig_from_imu(self) -> np.ndarray:
        """Pose (4, 4) on the rig. [m]"""
        return pose.rotated(pose.from_parts(np.eye(3), self.position_m), self.rotation_deg)

    def sampled(self, path: Path, times_s: np.ndarray, *, seed: int, frame: int) -> dict[str, np.ndarray]:
        """Return what the IMU says at times (n,) a period apart, (n, 3) each, in its own frame.

        `angular_rate_rad_per_s` and `specific_force_m_per_s2` as measured, and the biases in them.
        """
        rate, force = imu.ideal(path.states(times_s).mounted(self.rig_from_imu), gravity_m_per_s2=self.gravity_m_per_s2)
        gyroscope, accelerometer = (
            imu.errors(
                len(times_s), rate_hz=self.rate_hz, noise_density=density, random_walk=walk, first_bias=bias,
                rng=seeds.generator(seed, frame, f"imu {name}"),
            )
            for name, density, walk, bias in (
                (
                    "gyroscope", self.gyroscope_noise_density_rad_per_s_per_sqrt_hz,
                    self.gyroscope_random_walk_rad_per_s2_per_sqrt_hz, self.gyroscope_bias_rad_per_s,
                ),
                (
                    "accelerometer", self.accelerometer_noise_density_m_per_s2_per_sqrt_hz,
                    self.accelerometer_random_walk_m_per_s3_per_sqrt_hz, self.accelerometer_bias_m_per_s2,
                ),
            )
        )  # fmt: skip
        return {
            "angular_rate_rad_per_s": rate + gyroscope.bias + gyroscope.white,
            "specific_force_m_per_s2": force + accelerometer.bias + accelerometer.white,
            "gyroscope_bias_rad_per_s": gyroscope.bias,
            "accelerometer_bias_m_per_s2": accelerometer.bias,
        }


class RigCamera(Strict):
    """One of a rig's cameras, all of the kind that the scene gives: where it is on the rig, in rig axes.

    Turned by `rotation_deg` about its own x, then y, then z.
    """

    name: Name
    position_m: Vector3 = (0.0, 0.0, 0.0)
    rotation_deg: Vector3 = (0.0, 0.0, 0.0)

    @property
    def rig_from_camera(self) -> np.ndarray:
        """Pose (4, 4) on the rig. [m]"""
        return pose.rotated(pose.from_parts(np.eye(3), self.position_m), self.rotation_deg)


class Sequence(Strict):
    """Frames at `fps` along a trajectory: `frames` of them, or as many as fit into `duration_s`.

    Frame k is exposed about the middle of its period, at start_s + (k + 1/2) / fps on the trajectory; so the exposure
    may be as long as the period. The IMU has samples from start_s until the last period is over.
    """

    fps: Annotated[float, Field(gt=0, le=10_000)] = 30.0
    frames: Annotated[int, Field(ge=1, le=1_000_000)] | None = None
    duration_s: Positive | None = None
    start_s: NonNegative = 0.0
    trajectory: Motion
    imu: Imu | None = None

    @model_validator(mode="after")
    def _counted(self):
        if (self.frames is None) == (self.duration_s is None):
            raise ValueError("give either frames or duration_s")
        if self.count < 1:
            raise ValueError(f"duration_s: got {self.duration_s:g}, allowed: at least {1 / self.fps:g}, one frame")
        return self

    @property
    def count(self) -> int:
        """Number of frames, of each camera."""
        return self.frames if self.frames is not None else int(self.duration_s * self.fps + 1e-6)

    def frame_time_ns(self, frame: int) -> int:
        """Return the middle of the exposure of a frame, on the trajectory."""
        return round((self.start_s + (frame + 0.5) / self.fps) * 1e9)

    def sample_times_ns(self) -> np.ndarray:
        """Return the times of the IMU's samples, int64; without one, ten for each frame."""
        rate_hz = self.imu.rate_hz if self.imu is not None else _PLAIN_SAMPLES_PER_FRAME * self.fps
        number = int(np.ceil(self.count / self.fps * rate_hz - 1e-6)) + 1
        return np.round((self.start_s + np.arange(number) / rate_hz) * 1e9).astype(np.int64)

    def check_exposure(self, exposure, *, where: object) -> None:
        """Raise ValueError if exposure or readout of a scene take longer than the period of the frames."""
        for key in ("time_s", "readout_s"):
            if getattr(exposure, key) > 1 / self.fps * (1 + 1e-9):
                raise ValueError(
                    f"{where}: exposure.{key}: got {getattr(exposure, key):g} s, allowed: at most {1 / self.fps:.6g} s "
                    f"at {self.fps:g} frames per second"
                )


def trajectory_values(poses_at: Callable, *, middle_s: float, half_s: float, where: object) -> dict:
    """Return the TOML table of a rig's `trajectory` that follows `poses_at` within an exposure, 1e-6 m and rad.

    poses_at: times (n,) -> world_from_rig (n, 4, 4). Times in the table are relative to `middle_s`.
    Raises ValueError if that takes too many knots.
    """
    intervals = 2
    while intervals < _MOST_KNOTS:
        times_s = half_s * (np.arange(intervals + 1) / (intervals / 2) - 1)
        # golden section: no vibration is sampled at the same phase everywhere
        between_s = half_s * (2 * np.mod(np.arange(1, max(64, 2 * intervals)) * _GOLDEN, 1.0) - 1)
        knots = poses_at(middle_s + times_s)
        found = pose.interpolate(knots, knots_s=times_s, times_s=between_s)
        missed = pose.inverse(poses_at(middle_s + between_s)) @ found
        if np.abs(pose.twist(missed)).max() <= _WITHIN:
            return {
                "times_s": times_s.tolist(),
                "positions_m": knots[:, :3, 3].tolist(),
                "quaternions_xyzw": Rotation.from_matrix(knots[:, :3, :3]).as_quat().tolist(),
            }
        intervals *= 2
    raise ValueError(
        f"{where}: the trajectory needs more than {_MOST_KNOTS} poses within an exposure of {2 * half_s:g} s, "
        "allowed: a shorter exposure or a slower motion"
    )
