"""The scene description: strict, frozen models filled from TOML. Lengths in metres, angles in degrees.

World: z up, water surface at z = 0. Rig: x right, y down, z forward. Body: x right, y up, z out of its face.
"""

from typing import Annotated

import numpy as np
from pydantic import Field, model_validator

from uwsim.camera import pose
from uwsim.camera.lens import Lens
from uwsim.camera.shutter import Shutter
from uwsim.scene.base import Strict, Vector3
from uwsim.scene.blur_motion import AnyMotion, BlurMotion
from uwsim.scene.bodies import Body, CharucoBoard, MarkerBoard
from uwsim.scene.camera import Camera, Trajectory
from uwsim.scene.daylight import Daylight
from uwsim.scene.lamp import Lamp
from uwsim.scene.plumes import AddedWater, merged
from uwsim.scene.sensor import Exposure, Sensor
from uwsim.scene.sight import first_range_m
from uwsim.scene.water import NamedWater, TabulatedWater, TurbidWater

LEAST_LAMP_DISTANCE_M = 1e-3


class Rig(Strict):
    """Camera and lamps mounted together and moved as one: at a position, in uniform `motion`, or on a `trajectory`.

    `motion` says how fast, or how long and in which direction the blur is; a validated scene holds the former.
    """

    position_m: Vector3 | None = None
    look_at_m: Vector3 | None = None
    roll_deg: float = 0.0
    camera: Camera
    lamps: tuple[Lamp, ...] = ()
    motion: AnyMotion | None = None
    trajectory: Trajectory | None = None

    @model_validator(mode="after")
    def _usable(self):
        self._check_place()
        for lamp in self.lamps:
            apart_m = float(np.linalg.norm(lamp.position_m))
            if apart_m < LEAST_LAMP_DISTANCE_M:
                raise ValueError(
                    f"lamp {lamp.name} is {apart_m:g} m from the camera's pinhole, allowed: at least "
                    f"{LEAST_LAMP_DISTANCE_M:g} m (the light scattered in between is infinite)"
                )
        names = [lamp.name for lamp in self.lamps]
        if len(set(names)) != len(names):
            raise ValueError(f"lamp names {names} are not unique")
        return self

    def _check_place(self) -> None:
        given = [name for name in ("position_m", "look_at_m", "motion") if getattr(self, name) is not None]
        if self.trajectory is not None and (given or self.roll_deg):
            raise ValueError(f"got a trajectory and {', '.join(given or ['roll_deg'])}, allowed: one way to say where")
        if self.trajectory is None and not {"position_m", "look_at_m"} <= set(given):
            raise ValueError(f"got {given or 'nothing'} for the place, allowed: position_m, look_at_m; or trajectory")
        places = self.trajectory.positions_m if self.trajectory else (self.position_m,)
        for place in places:
            if place[2] >= 0:
                raise ValueError(f"position_m has z = {place[2]:g} m, allowed: below the water surface (z < 0)")
        _ = self.world_from_rig

    @property
    def world_from_rig(self) -> np.ndarray:
        """Pose (4, 4) in the middle of the exposure. [m]"""
        return self.poses_at(np.zeros(1))[0]

    def poses_at(self, times_s: np.ndarray) -> np.ndarray:
        """Return world_from_rig (n, 4, 4) at times (n,) relative to the middle of the exposure."""
        if self.trajectory is not None:
            return self.trajectory.at(times_s)
        still = pose.looking_at(self.position_m, self.look_at_m, roll_deg=self.roll_deg, where="look_at_m")
        if isinstance(self.motion, BlurMotion) and np.any(times_s):
            raise ValueError("rig.motion: a blur says nothing of a rig alone, allowed: in a scene")
        if self.motion is None or isinstance(self.motion, BlurMotion):
            return np.tile(still, (len(times_s), 1, 1))
        return pose.through_exposure(
            still, velocity_m_per_s=self.motion.velocity_m_per_s, rotation_deg_per_s=self.motion.rotation_deg_per_s,
            times_s=times_s,
        )  # fmt: skip


class Scene(Strict):
    """One scene: water, what is added to it, rig, bodies, daylight, exposure and sensor.

    With `daylight` the water ends at a flat surface at z = 0, which also reflects; without it there is no surface.
    """

    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9_-]+$")]
    description: str
    water: NamedWater | TurbidWater | TabulatedWater
    rig: Rig
    bodies: Annotated[tuple[Body, ...], Field(min_length=1)]
    exposure: Exposure
    sensor: Sensor = Sensor()
    daylight: Daylight | None = None
    added_water: tuple[AddedWater, ...] = ()

    @model_validator(mode="after")
    def _usable(self):
        if not self.rig.lamps and (self.daylight is None or self.daylight.is_dark):
            raise ValueError("no light: give rig.lamps or daylight with a sun or a sky")
        self._check_added_water()
        names = [body.name for body in self.bodies]
        if len(set(names)) != len(names):
            raise ValueError(f"bodies: names {names} are not unique")
        boards = [body for body in self.bodies if isinstance(body, (MarkerBoard, CharucoBoard))]
        marks = [(board.dictionary, marker_id) for board in boards for marker_id in board.ids]
        if len(set(marks)) != len(marks):
            names = [board.name for board in boards]
            raise ValueError(f"bodies: boards {names} share marker ids, allowed: each marker once (first_id)")
        _ = self.lens
        self._check_times()
        for lamp in self.rig.lamps:
            poses = self.rig.world_from_rig[None] if self.rig.trajectory is None else self.rig.trajectory.poses
            height = (poses @ lamp.rig_from_lamp)[:, 2, 3].max()
            if height >= 0:
                raise ValueError(f"lamp {lamp.name} is at z = {height:.3g} m, allowed: below the water surface (z < 0)")
        return self

    @model_validator(mode="after")
    def _in_motion(self):
        """Replace a blur that was asked for by the motion that makes it."""
        asked = self.rig.motion
        if not isinstance(asked, BlurMotion):
            return self
        width_px, range_m = self.rig.camera.width_px, asked.range_m
        if range_m is None:
            origin, direction = self.lens.rays(np.array([width_px, self.rig.camera.height_px]) / 2)
            world = self.rig.world_from_rig
            range_m = first_range_m(
                self.bodies, origin_m=pose.apply(world, origin), direction=world[:3, :3] @ direction
            )
            if range_m is None:
                raise ValueError("rig.motion.range_m: missing, and the image's centre sees no body; give range_m")
        motion = asked.motion(lens=self.lens, shutter=self.shutter, width_px=width_px, range_m=range_m)
        return self.model_copy(update={"rig": self.rig.model_copy(update={"motion": motion})})

    @property
    def lens(self) -> Lens:
        """The camera's lens with its port, in this water."""
        return self.rig.camera.lens(n_water=self.water.refractive_index)

    @property
    def shutter(self) -> Shutter:
        """When the rows of the image are exposed."""
        return Shutter(
            height_px=self.rig.camera.height_px, exposure_s=self.exposure.time_s, readout_s=self.exposure.readout_s
        )

    def _check_added_water(self) -> None:
        names = [added.name for added in self.added_water]
        if len(set(names)) != len(names):
            raise ValueError(f"added_water: names {names} are not unique")
        if self.added_water:
            merged(self.added_water)

    @property
    def moving_bodies(self) -> tuple[Body, ...]:
        """The bodies that move, particles among them."""
        return tuple(body for body in self.bodies if body.moves)

    @property
    def moves(self) -> bool:
        """Whether the rig or a body moves during the exposure, readout included."""
        if self.moving_bodies:
            return True
        motion, trajectory = self.rig.motion, self.rig.trajectory
        if trajectory is None:
            return motion is not None and any((*motion.velocity_m_per_s, *motion.rotation_deg_per_s))
        half_s = self.shutter.span_s / 2
        times_s = np.array([-half_s, *(time for time in trajectory.times_s if abs(time) < half_s), half_s])
        poses = trajectory.at(times_s)
        return not np.allclose(poses, poses[0], rtol=0, atol=1e-12)

    def _check_times(self) -> None:
        moving = self.moving_bodies
        if moving and self.shutter.readout_s > 0:
            raise ValueError(
                f"bodies: {moving[0].name} moves and exposure.readout_s is {self.shutter.readout_s:g} s, "
                "allowed: bodies in motion before a global shutter (readout_s = 0)"
            )
        half_s = self.shutter.span_s / 2
        paths = [("trajectory", self.rig.trajectory)]
        paths += [(f"body {body.name}: trajectory", getattr(body, "trajectory", None)) for body in self.bodies]
        for where, path in paths:
            if path is not None and (path.times_s[0] > -half_s or path.times_s[-1] < half_s):
                raise ValueError(
                    f"{where}: times_s {path.times_s[0]:g} to {path.times_s[-1]:g} s do not cover the exposure "
                    f"with its readout, {-half_s:g} to {half_s:g} s"
                )
