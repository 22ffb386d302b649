"""Camera and its motion in a scene."""

from typing import Annotated

import numpy as np
from pydantic import Field, model_validator

from uwsim.camera import pinhole
from uwsim.optics import sources
from uwsim.scene.base import Positive, Strict, Vector3


class Camera(Strict):
    """Pinhole camera in the rig's origin: field of view, or K as (fx, fy, cx, cy) [px]."""

    width_px: Annotated[int, Field(ge=1, le=16384)]
    height_px: Annotated[int, Field(ge=1, le=16384)]
    horizontal_fov_deg: Annotated[float, Field(gt=0, lt=170)] | None = None
    K_px: tuple[Positive, Positive, float, float] | None = None
    response: str = "Nikon 5100 (NPL)"

    @model_validator(mode="after")
    def _one_way(self):
        if (self.horizontal_fov_deg is None) == (self.K_px is None):
            raise ValueError("give either horizontal_fov_deg or K_px = [fx, fy, cx, cy]")
        sources.camera_response(self.response)
        return self

    @property
    def K(self) -> np.ndarray:
        """Camera matrix (3, 3), pixel centres at integer + 0.5. [px]"""
        if self.K_px is None:
            return pinhole.camera_matrix(
                width_px=self.width_px, height_px=self.height_px, horizontal_fov_deg=self.horizontal_fov_deg
            )
        fx, fy, cx, cy = self.K_px
        return np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1.0]])


class Motion(Strict):
    """Uniform motion of the rig during the exposure, along and about the rig's own axes."""

    velocity_m_per_s: Vector3 = (0.0, 0.0, 0.0)
    rotation_deg_per_s: Vector3 = (0.0, 0.0, 0.0)
