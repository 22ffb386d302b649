"""Rigid motion as a function of time in closed form: poses with their first and second derivatives.

A path is a pose that shifts along directions in the world and turns about its own x, then y, then z axes. Every
coordinate is a function of time that gives its value and its first and second derivative, (3, n).
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from uwsim.camera import pose

Coordinate = Callable[[np.ndarray], np.ndarray]
_AXES = np.eye(3)


@dataclass(frozen=True)
class Line:
    """offset + rate t."""

    rate: float
    offset: float = 0.0

    def __call__(self, times_s: np.ndarray) -> np.ndarray:
        times_s = np.asarray(times_s, float)
        return np.stack([self.offset + self.rate * times_s, np.full_like(times_s, self.rate), np.zeros_like(times_s)])


@dataclass(frozen=True)
class Harmonics:
    """Sum of amplitude sin(2 pi frequency t + phase) over components (k,)."""

    amplitudes: np.ndarray
    frequencies_hz: np.ndarray
    phases_rad: np.ndarray

    def __call__(self, times_s: np.ndarray) -> np.ndarray:
        per_s = 2 * np.pi * np.asarray(self.frequencies_hz, float)[:, None]
        phase = per_s * np.asarray(times_s, float) + np.asarray(self.phases_rad, float)[:, None]
        size = np.asarray(self.amplitudes, float)[:, None]
        terms = size * np.sin(phase), size * per_s * np.cos(phase), -size * per_s**2 * np.sin(phase)
        return np.stack([term.sum(axis=0) for term in terms])


@dataclass(frozen=True)
class Shuttle:
    """To and fro over `stroke` between -stroke / 2, where it is at time 0, and stroke / 2.

    Every way: at rest for `rest_s`, speeding up for `ramp_s`, constant `speed`, slowing down for `ramp_s`. The
    acceleration of a ramp is speed / ramp_s (1 - cos(2 pi x)), x = 0 to 1, so that it begins and ends at 0.
    Raises ValueError unless speed and ramps are above 0 and the stroke holds the two ramps (speed x ramp_s).
    """

    speed: float
    stroke: float
    ramp_s: float
    rest_s: float = 0.0

    def __post_init__(self):
        if min(self.speed, self.stroke, self.ramp_s) <= 0 or self.rest_s < 0:
            raise ValueError(f"shuttle: got {self}, allowed: speed, stroke, ramp_s > 0 and rest_s >= 0")
        if self.stroke < self.speed * self.ramp_s:
            raise ValueError(
                f"stroke: got {self.stroke:g}, allowed: at least {self.speed * self.ramp_s:g}, "
                f"which speeding up to {self.speed:g} and slowing down in {self.ramp_s:g} s each takes"
            )

    def __call__(self, times_s: np.ndarray) -> np.ndarray:
        moving_s = self.stroke / self.speed + self.ramp_s
        way, rest = np.divmod(np.asarray(times_s, float), moving_s + self.rest_s)
        time_s = np.clip(rest - self.rest_s, 0, moving_s)
        early, late = self._ramp(time_s), self._ramp(moving_s - time_s)
        late = np.stack([self.stroke - late[0], late[1], -late[2]])
        found = np.where(time_s < moving_s / 2, early, late)
        found[0] -= self.stroke / 2
        return np.where(way % 2 == 0, found, -found)

    def _ramp(self, time_s: np.ndarray) -> np.ndarray:
        """Return way, speed and acceleration at a time after the start, without an end."""
        share = np.clip(time_s / self.ramp_s, 0, 1)
        turn = 2 * np.pi * share
        way = self.ramp_s * (share**2 / 2 + (np.cos(turn) - 1) / (4 * np.pi**2)) + np.maximum(time_s - self.ramp_s, 0)
        speed = share - np.sin(turn) / (2 * np.pi)
        acceleration = (1 - np.cos(turn)) / self.ramp_s
        return self.speed * np.stack([way, speed, acceleration])


class States(NamedTuple):
    """A frame in motion at n times: where it is, and its derivatives.

    `world_from_frame` (n, 4, 4) [m]; velocity and acceleration (n, 3) of its origin along the world's axes
    [m/s, m/s^2]; angular rate and its derivative (n, 3) about the frame's own axes [rad/s, rad/s^2].
    """

    world_from_frame: np.ndarray
    velocity_m_per_s: np.ndarray
    acceleration_m_per_s2: np.ndarray
    angular_rate_rad_per_s: np.ndarray
    angular_acceleration_rad_per_s2: np.ndarray

    def mounted(self, frame_from_part: np.ndarray) -> "States":
        """Return the states of a part fixed to the frame at `frame_from_part` (4, 4).

        Source: velocity and acceleration of a point of a rigid body, Goldstein, Poole & Safko 2002, Classical
        Mechanics, section 4.9: v = v_0 + w x r, a = a_0 + w' x r + w x (w x r).
        """
        arm, turn = frame_from_part[:3, 3], frame_from_part[:3, :3]
        rate, spin_up = self.angular_rate_rad_per_s, self.angular_acceleration_rad_per_s2
        sideways = np.cross(rate, arm)
        pull = np.cross(spin_up, arm) + np.cross(rate, sideways)
        to_world = self.world_from_frame[:, :3, :3]
        return States(
            self.world_from_frame @ frame_from_part,
            self.velocity_m_per_s + np.einsum("nij,nj->ni", to_world, sideways),
            self.acceleration_m_per_s2 + np.einsum("nij,nj->ni", to_world, pull),
            rate @ turn,
            spin_up @ turn,
        )


@dataclass(frozen=True)
class Path:
    """A rig that is at `world_from_rig` (4, 4) where all coordinates are 0.

    `shifts`: pairs of a direction in the world (3,) and the way along it [m]. `turns`: coordinates [rad] about the
    rig's x, y and z axes, in the order x, then y, then z as in `pose.rotated`, about the point `pivot_m` (3,) of the
    rig, in its axes.
    """

    world_from_rig: np.ndarray
    shifts: tuple[tuple[np.ndarray, Coordinate], ...] = ()
    turns: tuple[tuple[Coordinate, ...], ...] = ((), (), ())
    pivot_m: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def states(self, times_s: np.ndarray) -> States:
        """Return the states of the rig at times (n,)."""
        times_s = np.asarray(times_s, float)
        angles = [sum((turn(times_s) for turn in about), np.zeros((3, len(times_s)))) for about in self.turns]
        own, rate, spin_up = _turned(angles)
        turn = self.world_from_rig[:3, :3] @ own
        shift = np.zeros((3, len(times_s), 3))
        for direction, way in self.shifts:
            shift += way(times_s)[..., None] * np.asarray(direction, float)
        pivot = pose.apply(self.world_from_rig, np.asarray(self.pivot_m, float))
        world_from_pivot = np.tile(np.eye(4), (len(times_s), 1, 1))
        world_from_pivot[:, :3, :3] = turn
        world_from_pivot[:, :3, 3] = pivot + shift[0]
        at_pivot = States(world_from_pivot, shift[1], shift[2], rate, spin_up)
        return at_pivot.mounted(pose.from_parts(np.eye(3), -np.asarray(self.pivot_m, float)))

    def poses(self, times_s: np.ndarray) -> np.ndarray:
        """Return world_from_rig (n, 4, 4) at times (n,)."""
        return self.states(times_s).world_from_frame


def _turned(angles: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return rotations (n, 3, 3), angular rates and accelerations (n, 3) in the own frame of angles about x, y, z.

    Each of `angles` (3, n): angle, rate, acceleration. R = Rx Ry Rz, and for R = A B with B about a fixed axis e:
    w = B^T w_A + b' e, w' = B^T w_A' + (B^T w_A) x (b' e) + b'' e.
    """
    count = angles[0].shape[1]
    total, rate, spin_up = np.tile(np.eye(3), (count, 1, 1)), np.zeros((count, 3)), np.zeros((count, 3))
    for axis, (angle, first, second) in zip(_AXES, angles, strict=True):
        step = Rotation.from_rotvec(angle[:, None] * axis).as_matrix()
        carried = np.einsum("nji,nj->ni", step, rate)
        own = first[:, None] * axis
        spin_up = np.einsum("nji,nj->ni", step, spin_up) + np.cross(carried, own) + second[:, None] * axis
        rate, total = carried + own, total @ step
    return total, rate, spin_up
