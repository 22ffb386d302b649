"""How a rig moves in a sequence: a robot arm, or a vehicle that hovers. All about the pose that the scene gives."""

from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from uwsim import seeds
from uwsim.camera import sea_motion
from uwsim.camera.kinematics import Harmonics, Line, Path, Shuttle
from uwsim.scene.base import NonNegative, Positive, Strict, Vector3

FULL_SPEED_M_PER_S = 0.1
"""Speed of the dissertation's arm at 100 % (chapter 6, speed configuration: 20 % to 100 % of about 0.1 m/s)."""

Percent = Annotated[float, Field(gt=0, le=100)]
_MOST_SWING_DEG = 60.0
_AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}


class _Arm(Strict):
    """A robot arm at a share of its full speed."""

    speed_percent: Percent
    full_speed_m_per_s: Positive = FULL_SPEED_M_PER_S

    @property
    def speed_m_per_s(self) -> float:
        return self.full_speed_m_per_s * self.speed_percent / 100


class ArmLinear(_Arm):
    """An arm that moves the rig to and fro along a straight line, without turning it.

    direction: of the first way, in rig axes. The scene's pose is the middle of the stroke; the motion begins at rest at
    its start. Every way: `rest_s` at rest, `ramp_s` to speed up smoothly (`kinematics.Shuttle`), then constant speed.
    Source: dissertation, chapter 6 (linear motion, speeds); stroke and ramp are this project's choice.
    """

    kind: Literal["arm_linear"]
    direction: Vector3 = (1.0, 0.0, 0.0)
    stroke_m: Positive = 0.2
    ramp_s: Positive = 0.25
    rest_s: NonNegative = 0.0

    @model_validator(mode="after")
    def _usable(self):
        if np.linalg.norm(self.direction) < 1e-9:
            raise ValueError(f"direction: got {self.direction}, allowed: not all 0")
        _ = self._way
        return self

    @property
    def _way(self) -> Shuttle:
        return Shuttle(speed=self.speed_m_per_s, stroke=self.stroke_m, ramp_s=self.ramp_s, rest_s=self.rest_s)

    def path(self, world_from_rig: np.ndarray, *, seed: int, frame: int) -> Path:
        """Return the path about the pose (4, 4); nothing is drawn."""
        direction = world_from_rig[:3, :3] @ (np.asarray(self.direction) / np.linalg.norm(self.direction))
        return Path(world_from_rig, shifts=((direction, self._way),))


class ArmSwing(_Arm):
    """An arm that swings the rig about an axis of its own, as a pendulum, through a point beside it.

    `speed_percent`: the rig's origin moves so fast in the middle of the swing, where the scene's pose is and where the
    motion begins. `pivot_m`: in rig axes.
    Source: dissertation, chapter 6 (swinging motion, speeds); amplitude and pivot are this project's choice.
    """

    kind: Literal["arm_swing"]
    axis: Literal["x", "y", "z"] = "y"
    amplitude_deg: Annotated[float, Field(gt=0, le=_MOST_SWING_DEG)] = 10.0
    pivot_m: Vector3 = (0.0, 0.0, -0.3)

    @model_validator(mode="after")
    def _usable(self):
        if self.radius_m < 1e-3:
            raise ValueError(
                f"pivot_m: got {self.pivot_m}, {self.radius_m:g} m from the rig across axis {self.axis}, "
                "allowed: at least 0.001 m (the speed is that of the rig's origin)"
            )
        return self

    @property
    def radius_m(self) -> float:
        """Distance of the rig's origin from the axis of the swing."""
        return float(np.linalg.norm(np.cross(_AXES[self.axis], self.pivot_m)))

    @property
    def frequency_hz(self) -> float:
        return self.speed_m_per_s / (2 * np.pi * self.radius_m * np.radians(self.amplitude_deg))

    def path(self, world_from_rig: np.ndarray, *, seed: int, frame: int) -> Path:
        """Return the path about the pose (4, 4); nothing is drawn."""
        swing = Harmonics([np.radians(self.amplitude_deg)], [self.frequency_hz], [0.0])
        turns = tuple((swing,) if name == self.axis else () for name in _AXES)
        return Path(world_from_rig, turns=turns, pivot_m=self.pivot_m)


class Current(Strict):
    """Station keeping in a current: wander about the place held (root mean square, world axes) and a steady drift.

    Source: sizes are this project's choice, of the order of a small vehicle that holds its place by sonar or camera.
    """

    wander_rms_m: Vector3 = (0.03, 0.03, 0.015)
    wander_period_s: Positive = 15.0
    drift_m_per_s: Vector3 = (0.0, 0.0, 0.0)


class Heave(Strict):
    """Waves above: the vehicle takes `response` times the water's motion at its depth, see `sea_motion.waves`.

    direction_deg: into which the waves run, from world x towards y.
    """

    significant_height_m: NonNegative = 0.1
    peak_period_s: Positive = 3.0
    direction_deg: float = 0.0
    response: Annotated[float, Field(ge=0, le=1)] = 1.0


class Sway(Strict):
    """Turns of the vehicle, root mean square about the rig's x (pitch), y (yaw) and z (roll) axes.

    Source: sizes are this project's choice; the period is of the order of a small vehicle's natural one.
    """

    rms_deg: Vector3 = (1.0, 1.5, 1.0)
    peak_period_s: Positive = 4.0


class Thrusters(Strict):
    """Vibration along each rig axis, half of its power at the shaft's frequency, half at that of the blades.

    Source: 1.8 mm/s rms is where small machines cease to be satisfactory, ISO 10816-1:1995, table B.1, class I, limit
    of zones B and C; 20 Hz and 3 blades: a small vehicle's thruster that holds its place (this project's choice).
    """

    velocity_rms_m_per_s: NonNegative = 0.0018
    shaft_hz: Annotated[float, Field(gt=0, le=200)] = 20.0
    blades: Annotated[int, Field(ge=1, le=8)] = 3


class Hover(Strict):
    """A vehicle that holds its place: current, heave, sway and thrusters add up; leave one out to have none of it.

    `pivot_m`: point of the vehicle, in rig axes, about which it turns. Phases are drawn from the seed.
    Valid: small angles and a vehicle that is small against the waves; no dynamics of the vehicle are solved.
    """

    kind: Literal["hover"]
    current: Current | None = None
    heave: Heave | None = None
    sway: Sway | None = None
    thrusters: Thrusters | None = None
    pivot_m: Vector3 = (0.0, 0.0, -0.2)

    @model_validator(mode="after")
    def _usable(self):
        for name, sizes in (
            ("current.wander_rms_m", self.current and self.current.wander_rms_m),
            ("sway.rms_deg", self.sway and self.sway.rms_deg),
        ):
            if sizes and min(sizes) < 0:
                raise ValueError(f"{name}: got {sizes}, allowed: >= 0")
        return self

    def path(self, world_from_rig: np.ndarray, *, seed: int, frame: int) -> Path:
        """Return the path about the pose (4, 4); (seed, frame) name the random streams."""
        shifts, turns = [], ((), (), ())
        if self.current is not None:
            shifts += self._wander(seeds.generator(seed, frame, "trajectory current"))
        if self.heave is not None:
            rng = seeds.generator(seed, frame, "trajectory heave")
            shifts += self._heave(-float(world_from_rig[2, 3]), rng)
        if self.thrusters is not None:
            rng, asked = seeds.generator(seed, frame, "trajectory thrusters"), self.thrusters.model_dump()
            shifts += [(axis, sea_motion.vibration(**asked, rng=rng)) for axis in world_from_rig[:3, :3].T]
        if self.sway is not None:
            rng, period_s = seeds.generator(seed, frame, "trajectory sway"), self.sway.peak_period_s
            turns = tuple(
                (sea_motion.irregular(rms=float(np.radians(rms)), peak_period_s=period_s, rng=rng),)
                for rms in self.sway.rms_deg
            )
        return Path(world_from_rig, shifts=tuple(shifts), turns=turns, pivot_m=self.pivot_m)

    def _wander(self, rng: np.random.Generator) -> list:
        ways = [
            (axis, sea_motion.irregular(rms=rms, peak_period_s=self.current.wander_period_s, rng=rng))
            for axis, rms in zip(np.eye(3), self.current.wander_rms_m, strict=True)
        ]
        return [*ways, (self.current.drift_m_per_s, Line(rate=1.0))]

    def _heave(self, water_depth_m: float, rng: np.random.Generator) -> list:
        forwards, upwards = sea_motion.waves(
            significant_height_m=self.heave.significant_height_m, peak_period_s=self.heave.peak_period_s,
            water_depth_m=water_depth_m, rng=rng,
        )  # fmt: skip
        azimuth_rad = np.radians(self.heave.direction_deg)
        along = self.heave.response * np.array([np.cos(azimuth_rad), np.sin(azimuth_rad), 0.0])
        return [(along, forwards), (self.heave.response * np.array([0.0, 0.0, 1.0]), upwards)]


Motion = Annotated[ArmLinear | ArmSwing | Hover, Field(discriminator="kind")]
