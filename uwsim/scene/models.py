"""The scene description: strict, frozen models filled from TOML. Lengths in metres, angles in degrees.

World: z up, water surface at z = 0. Rig: x right, y down, z forward. Body: x right, y up, z out of its face.
"""

from typing import Annotated

import numpy as np
from pydantic import Field, model_validator

from uwsim.camera import pose
from uwsim.scene.base import Strict, Vector3
from uwsim.scene.bodies import Body, MarkerBoard
from uwsim.scene.camera import Camera, Motion
from uwsim.scene.lamp import Lamp
from uwsim.scene.sensor import Exposure, Sensor
from uwsim.scene.water import NamedWater, TabulatedWater, TurbidWater

LEAST_LAMP_DISTANCE_M = 1e-3


class Rig(Strict):
    """Camera and lamps mounted together and moved as one."""

    position_m: Vector3
    look_at_m: Vector3
    roll_deg: float = 0.0
    camera: Camera
    lamps: Annotated[tuple[Lamp, ...], Field(min_length=1)]
    motion: Motion | None = None

    @model_validator(mode="after")
    def _usable(self):
        if self.position_m[2] >= 0:
            raise ValueError(f"position_m has z = {self.position_m[2]:g} m, allowed: below the water surface (z < 0)")
        _ = self.world_from_rig
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

    @property
    def world_from_rig(self) -> np.ndarray:
        return pose.looking_at(self.position_m, self.look_at_m, roll_deg=self.roll_deg, where="look_at_m")


class Scene(Strict):
    """One scene: water, rig, bodies, exposure and sensor."""

    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9_-]+$")]
    description: str
    water: NamedWater | TurbidWater | TabulatedWater
    rig: Rig
    bodies: Annotated[tuple[Body, ...], Field(min_length=1)]
    exposure: Exposure
    sensor: Sensor = Sensor()

    @model_validator(mode="after")
    def _usable(self):
        names = [body.name for body in self.bodies]
        if len(set(names)) != len(names):
            raise ValueError(f"bodies: names {names} are not unique")
        boards = [body for body in self.bodies if isinstance(body, MarkerBoard)]
        marks = [(board.dictionary, marker_id) for board in boards for marker_id in board.ids]
        if len(set(marks)) != len(marks):
            names = [board.name for board in boards]
            raise ValueError(f"bodies: boards {names} share marker ids, allowed: each marker once (first_id)")
        for lamp in self.rig.lamps:
            height = (self.rig.world_from_rig @ lamp.rig_from_lamp)[2, 3]
            if height >= 0:
                raise ValueError(f"lamp {lamp.name} is at z = {height:.3g} m, allowed: below the water surface (z < 0)")
        return self
