"""Camera, its port and housing, and its motion in a scene."""

from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator
from scipy.spatial.transform import Rotation

from uwsim.camera import distortion, dome_port, flat_port, pinhole, pose
from uwsim.camera.lens import Lens
from uwsim.optics import sources
from uwsim.optics.refractive_index import glass_nbk7
from uwsim.scene.base import NonNegative, Positive, Strict, Vector3
from uwsim.scene.housing import Housing

N_BK7_INDEX = round(float(glass_nbk7(550.0)), 4)
"""Refractive index of N-BK7 glass at 550 nm, relative to air."""

Index = Annotated[float, Field(ge=1, le=3)]
_UNIT_WITHIN = 1e-3  # lengths of quaternions given with few digits
_LARGEST_TURN_DEG = 175.0


class FlatPort(Strict):
    """Flat window before the lens in air; tilted from the camera's axis towards x (azimuth 0) or y (azimuth 90)."""

    kind: Literal["flat"]
    gap_m: NonNegative
    thickness_m: NonNegative
    n_glass: Index = N_BK7_INDEX
    tilt_deg: Annotated[float, Field(ge=0, lt=90)] = 0.0
    azimuth_deg: float = 0.0
    glass_absorption_per_m: NonNegative = 0.0

    def optical(self, *, n_water: float) -> flat_port.FlatPort:
        normal = flat_port.tilted_normal(
            tilt_rad=float(np.radians(self.tilt_deg)), azimuth_rad=float(np.radians(self.azimuth_deg))
        )
        return flat_port.FlatPort(
            gap_m=self.gap_m, thickness_m=self.thickness_m, n_glass=self.n_glass, n_water=n_water,
            normal=normal, glass_absorption_per_m=self.glass_absorption_per_m,
        )  # fmt: skip

    @property
    def rig_from_front(self) -> np.ndarray:
        """Frame (4, 4) of the outer face: origin where the port's axis meets it, z into the water."""
        port = self.optical(n_water=1.0)
        turn = Rotation.from_euler("ZYZ", [self.azimuth_deg, self.tilt_deg, -self.azimuth_deg], degrees=True)
        return pose.from_parts(_upper(turn), port.depth_m * port.axis)


class DomePort(Strict):
    """Spherical dome before the lens in air; `decentring_m`: the pinhole as seen from the centre of the spheres."""

    kind: Literal["dome"]
    inner_radius_m: Positive
    thickness_m: NonNegative
    n_glass: Index = N_BK7_INDEX
    decentring_m: Vector3 = (0.0, 0.0, 0.0)
    glass_absorption_per_m: NonNegative = 0.0

    def optical(self, *, n_water: float) -> dome_port.DomePort:
        return dome_port.DomePort(
            inner_radius_m=self.inner_radius_m, thickness_m=self.thickness_m, n_glass=self.n_glass, n_water=n_water,
            decentring_m=self.decentring_m, glass_absorption_per_m=self.glass_absorption_per_m,
        )  # fmt: skip

    @property
    def rig_from_front(self) -> np.ndarray:
        """Frame (4, 4) of the plane through the centre of the dome, out of which it stands; z along the camera's."""
        return pose.from_parts(np.eye(3), -np.asarray(self.decentring_m))


Port = Annotated[FlatPort | DomePort, Field(discriminator="kind")]


def _upper(turn: Rotation) -> np.ndarray:
    """Return a rotation matrix (3, 3), exact for no turn at all."""
    return np.eye(3) if turn.magnitude() == 0 else turn.as_matrix()


class Camera(Strict):
    """Camera in the rig's origin: field of view, or K as (fx, fy, cx, cy) [px], of its lens.

    Without a port the lens is a pinhole in the water. With one it lies in air: K, field of view and `distortion`
    (0, 4, 5 or 8 coefficients of OpenCV) are those in air.
    """

    width_px: Annotated[int, Field(ge=1, le=16384)]
    height_px: Annotated[int, Field(ge=1, le=16384)]
    horizontal_fov_deg: Annotated[float, Field(gt=0, lt=170)] | None = None
    K_px: tuple[Positive, Positive, float, float] | None = None
    response: str = "Nikon 5100 (NPL)"
    distortion: tuple[float, ...] = ()
    port: Port | None = None
    housing: Housing | None = None

    @model_validator(mode="after")
    def _one_way(self):
        if (self.horizontal_fov_deg is None) == (self.K_px is None):
            raise ValueError("give either horizontal_fov_deg or K_px = [fx, fy, cx, cy]")
        sources.camera_response(self.response)
        distortion.checked(self.distortion)
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

    def lens(self, *, n_water: float) -> Lens:
        """Return the lens in water of index `n_water`. Raises ValueError if the housing cuts off rays of the image."""
        port = None if self.port is None else self.port.optical(n_water=n_water)
        lens = Lens(K=self.K, coefficients=self.distortion, port=port)
        self._check_housing(lens)
        return lens

    @property
    def rig_from_front(self) -> np.ndarray:
        """Frame (4, 4) of the housing's front face: origin in its middle, z into the water."""
        return np.eye(4) if self.port is None else self.port.rig_from_front

    def _check_housing(self, lens: Lens) -> None:
        if self.housing is None:
            return
        origins, directions = lens.rays(_edge(self.width_px, self.height_px))
        origins = pose.apply(pose.inverse(self.rig_from_front), origins)
        radius_m = float(np.nanmax(np.linalg.norm(origins[:, :2], axis=-1), initial=0.0))
        if radius_m > self.housing.radius_m:
            raise ValueError(
                f"housing.radius_m: got {self.housing.radius_m:g} m, allowed: at least {radius_m:.4g} m "
                "(where the rays of the image's edge leave the port)"
            )
        forward = directions @ self.rig_from_front[:3, 2]
        if np.any(origins[:, 2] < -1e-9) or np.any(forward <= 0):
            raise ValueError("housing: got rays of the image's edge that leave the port backwards, allowed: forwards")


def _edge(width_px: int, height_px: int) -> np.ndarray:
    """Return points along the edge of the image, (n, 2) [px]."""
    x, y = np.linspace(0, width_px, min(width_px, 256) + 1), np.linspace(0, height_px, min(height_px, 256) + 1)
    sides = [(x, 0 * x), (x, 0 * x + height_px), (0 * y, y), (0 * y + width_px, y)]
    return np.concatenate([np.stack(side, axis=-1) for side in sides])


class Motion(Strict):
    """Uniform motion of the rig during the exposure, along and about the rig's own axes."""

    velocity_m_per_s: Vector3 = (0.0, 0.0, 0.0)
    rotation_deg_per_s: Vector3 = (0.0, 0.0, 0.0)


class Trajectory(Strict):
    """Poses of the rig at times relative to the middle of the exposure, joined by screw motions of constant twist.

    Orientation as unit quaternions world_from_rig (x, y, z, w), or as points that the rig looks at.
    """

    times_s: Annotated[tuple[float, ...], Field(min_length=2)]
    positions_m: tuple[Vector3, ...]
    quaternions_xyzw: tuple[tuple[float, float, float, float], ...] | None = None
    look_at_m: tuple[Vector3, ...] | None = None

    @model_validator(mode="after")
    def _usable(self):
        pose.check_increasing(self.times_s, where="times_s")
        if (self.quaternions_xyzw is None) == (self.look_at_m is None):
            raise ValueError("give either quaternions_xyzw or look_at_m")
        given = self.quaternions_xyzw if self.look_at_m is None else self.look_at_m
        if not len(self.times_s) == len(self.positions_m) == len(given):
            counts = len(self.times_s), len(self.positions_m), len(given)
            raise ValueError(f"got {counts} times, positions and orientations, allowed: one of each per time")
        for quaternion in self.quaternions_xyzw or ():
            if abs(np.linalg.norm(quaternion) - 1) > _UNIT_WITHIN:
                raise ValueError(
                    f"quaternions_xyzw: got {quaternion} of length {np.linalg.norm(quaternion):.4g}, allowed: 1"
                )
        turns = np.degrees(np.linalg.norm(pose.twist(pose.inverse(self.poses[:-1]) @ self.poses[1:])[:, :3], axis=-1))
        for index in np.flatnonzero(turns > _LARGEST_TURN_DEG)[:1]:
            raise ValueError(
                f"turn of {turns[index]:.4g} deg from {self.times_s[index]:g} to {self.times_s[index + 1]:g} s, "
                f"allowed: up to {_LARGEST_TURN_DEG:g} deg (the way round is ambiguous)"
            )
        return self

    @property
    def poses(self) -> np.ndarray:
        """World_from_rig (k, 4, 4) at `times_s`."""
        if self.look_at_m is not None:
            pairs = zip(self.positions_m, self.look_at_m, strict=True)
            return np.stack([pose.looking_at(at, target, where="look_at_m") for at, target in pairs])
        turns = Rotation.from_quat(self.quaternions_xyzw).as_matrix()
        return np.stack([pose.from_parts(turn, at) for turn, at in zip(turns, self.positions_m, strict=True)])

    def at(self, times_s: np.ndarray) -> np.ndarray:
        """Return world_from_rig (n, 4, 4) at `times_s` (n,); ValueError outside the times given."""
        return pose.interpolate(self.poses, knots_s=np.asarray(self.times_s), times_s=times_s)
