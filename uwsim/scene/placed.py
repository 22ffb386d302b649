"""Where a body of a scene is and how it moves, and the reflectance of its surface."""

from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import AfterValidator, Field, model_validator
from scipy.spatial.transform import Rotation

from uwsim.camera import pose
from uwsim.images import decode
from uwsim.optics.spectrum import WAVELENGTHS_NM
from uwsim.optics.surfaces import material_names, material_reflectance
from uwsim.scene.base import Strict, Table, Vector3
from uwsim.scene.camera import Trajectory


def _known(name: str) -> str:
    if name not in material_names():
        raise ValueError(f"got {name!r}, allowed: a number or a table, or a material ({', '.join(material_names())})")
    return name


Material = Annotated[str, AfterValidator(_known)]
Reflectance = Annotated[float, Field(ge=0, le=1)] | Table | Material
File = Annotated[Path, Field(strict=False)]  # from text
Name = Annotated[str, Field(pattern=r"^[A-Za-z0-9_-]+$")]
_BODY_FROM_CAMERA = np.diag([-1.0, -1.0, 1.0, 1.0])  # x right, y up against x right, y down, seen from the front


def reflectance_on_grid(reflectance: float | Table | str, *, where: str) -> np.ndarray:
    """Return a diffuse reflectance over wavelength, (61,): of a number, a table or a named material."""
    if isinstance(reflectance, str):
        return material_reflectance(reflectance)
    if isinstance(reflectance, Table):
        values = reflectance.on_grid(where=where)
        if values.max() > 1:
            raise ValueError(f"{where} reaches {values.max():g}, allowed: 0 to 1")
        return values
    return np.full(len(WAVELENGTHS_NM), float(reflectance))


class BodyMotion(Strict):
    """Uniform motion of a body along the **world's** axes, and turn about axes through its origin parallel to them.

    The pose that the body is given is that in the middle of the exposure.
    """

    velocity_m_per_s: Vector3 = (0.0, 0.0, 0.0)
    rotation_deg_per_s: Vector3 = (0.0, 0.0, 0.0)

    @property
    def moves(self) -> bool:
        return any((*self.velocity_m_per_s, *self.rotation_deg_per_s))

    def poses(self, still: np.ndarray, times_s: np.ndarray) -> np.ndarray:
        """Return world_from_body (n, 4, 4) at times (n,) of a body that is at `still` (4, 4) at time 0."""
        times_s = np.asarray(times_s, float)
        turns = np.radians(np.asarray(self.rotation_deg_per_s)) * times_s[:, None]
        found = np.tile(still, (len(times_s), 1, 1))
        if np.any(turns):
            found[:, :3, :3] = Rotation.from_rotvec(turns).as_matrix() @ still[:3, :3]
        found[:, :3, 3] += np.asarray(self.velocity_m_per_s) * times_s[:, None]
        return found


class BodyTrajectory(Trajectory):
    """Poses of a body at times relative to the middle of the exposure, joined by screw motions of constant twist.

    Orientation as unit quaternions world_from_body (x, y, z, w), or as points that the body's face looks at.
    """

    @property
    def poses(self) -> np.ndarray:
        """World_from_body (k, 4, 4) at `times_s`."""
        found = super().poses
        return found if self.look_at_m is None else found @ _BODY_FROM_CAMERA


class Placed(Strict):
    """Where a body is. With `towards_m` its face looks at that point, else its axes are the world's.

    `rotation_deg` then turns it about its own x, y, z axes. At rest, in uniform `motion`, or on a `trajectory` in place
    of position and `towards_m`. Bodies other than particles are numbered from 1 in order.
    """

    name: Name
    position_m: Vector3 | None = None
    towards_m: Vector3 | None = None
    rotation_deg: Vector3 = (0.0, 0.0, 0.0)
    motion: BodyMotion | None = None
    trajectory: BodyTrajectory | None = None

    @model_validator(mode="after")
    def _placeable(self):
        given = [name for name in ("position_m", "towards_m", "motion") if getattr(self, name) is not None]
        if self.trajectory is not None and given:
            raise ValueError(f"got a trajectory and {', '.join(given)}, allowed: one way to say where")
        if self.trajectory is None and self.position_m is None:
            raise ValueError("position_m: missing, allowed: position_m or trajectory")
        _ = self.world_from_body
        return self

    @property
    def world_from_body(self) -> np.ndarray:
        """Pose (4, 4) in the middle of the exposure. [m]"""
        return self.poses_at(np.zeros(1))[0]

    @property
    def moves(self) -> bool:
        """Whether it is given anything but rest."""
        if self.trajectory is not None:
            return not np.allclose(self.trajectory.poses, self.trajectory.poses[0], rtol=0, atol=1e-12)
        return self.motion is not None and self.motion.moves

    def poses_at(self, times_s: np.ndarray) -> np.ndarray:
        """Return world_from_body (n, 4, 4) at times (n,) relative to the middle of the exposure."""
        if self.trajectory is not None:
            return np.stack([pose.rotated(at, self.rotation_deg) for at in self.trajectory.at(times_s)])
        if self.towards_m is None:
            base = pose.from_parts(np.eye(3), self.position_m)
        else:
            base = pose.facing(self.position_m, self.towards_m, where=f"body {self.name}")
        still = pose.rotated(base, self.rotation_deg)
        return still[None].repeat(len(times_s), axis=0) if self.motion is None else self.motion.poses(still, times_s)


class Plain(Placed):
    """A body of one reflectance."""

    reflectance: Reflectance

    @model_validator(mode="after")
    def _reflects(self):
        _ = self.spectrum
        return self

    @property
    def spectrum(self) -> np.ndarray:
        return reflectance_on_grid(self.reflectance, where=f"body {self.name}: reflectance")


def read_grey(path: Path) -> np.ndarray:
    """Read an image file as grey values in [0, 1], (H, W) float; 8 or 16 bit, taken as linear.

    Raises ValueError in one line if it is missing or no image.
    """
    import cv2

    if not path.is_file():
        raise ValueError(f"file: {path} does not exist")
    image = decode(path, cv2.IMREAD_GRAYSCALE | cv2.IMREAD_ANYDEPTH)
    if image is None or min(image.shape) < 2:
        raise ValueError(f"file: {path} is not an image of at least 2 x 2 pixels")
    return image / float(np.iinfo(image.dtype).max)
