"""An inertial measurement unit: what its gyroscope and accelerometer say on a moving rig, with noise and drift.

World: z up. A gyroscope measures the angular rate of the IMU's frame about its own axes [rad/s], an accelerometer the
specific force along them [m/s^2], f = R^T (a - g) with R = world_from_imu and g = (0, 0, -9.80665) m/s^2: at rest it
shows +9.80665 m/s^2 upwards. The turn of the earth (7.3e-5 rad/s) is left out.
"""

from dataclasses import dataclass

import numpy as np

from uwsim.camera.kinematics import States

STANDARD_GRAVITY_M_PER_S2 = 9.80665
"""Standard acceleration of free fall (CGPM 1901)."""


def ideal(states: States, *, gravity_m_per_s2: float = STANDARD_GRAVITY_M_PER_S2) -> tuple[np.ndarray, np.ndarray]:
    """Return angular rate [rad/s] and specific force [m/s^2], (n, 3) each, in the frame whose `states` these are."""
    felt = states.acceleration_m_per_s2 + np.array([0.0, 0.0, gravity_m_per_s2])
    return states.angular_rate_rad_per_s, np.einsum("nji,nj->ni", states.world_from_frame[:, :3, :3], felt)


@dataclass(frozen=True)
class Errors:
    """White noise and bias of a sensor of three axes, (n, 3) each, in its unit: measured = ideal + bias + white."""

    white: np.ndarray
    bias: np.ndarray


def errors(
    count: int, *, rate_hz: float, noise_density: float, random_walk: float, first_bias, rng: np.random.Generator
) -> Errors:
    """Return the errors of `count` samples at `rate_hz` of a sensor of unit u (rad/s or m/s^2).

    noise_density: white noise, square root of its (two-sided) power spectral density [u / sqrt(Hz)]; a sample has the
    standard deviation noise_density sqrt(rate). random_walk: of the bias [u / s / sqrt(Hz)]; from sample to sample it
    changes by random_walk / sqrt(rate). first_bias (3,) [u]: at the first sample.
    Source: the IMU noise model of Kalibr (github.com/ethz-asl/kalibr/wiki/IMU-Noise-Model); Crassidis 2006,
    doi:10.1109/TAES.2006.1642588.
    Valid: noise filtered to half the sampling rate before sampling (the motion is not: it is sampled at points); bias
    instability, scale and misalignment left out.
    """
    if count < 1 or rate_hz <= 0 or noise_density < 0 or random_walk < 0:
        raise ValueError(
            f"imu errors: got {count} samples at {rate_hz:g} Hz, densities {noise_density:g} and {random_walk:g}, "
            "allowed: at least one sample, a rate above 0, densities >= 0"
        )
    white = noise_density * np.sqrt(rate_hz) * rng.standard_normal((count, 3))
    steps = random_walk / np.sqrt(rate_hz) * rng.standard_normal((count, 3))
    steps[0] = 0.0
    return Errors(white=white, bias=np.asarray(first_bias, float) + np.cumsum(steps, axis=0))
