"""A camera behind a port: pixel -> ray in the water, point in the water -> pixel.

Camera frame: pinhole (entrance pupil) at the origin, x right, y down, z forward; pixel centres at integer + 0.5.
The lens is a pinhole K with the distortion of `uwsim.camera.distortion`; the port is a `FlatPort` or a `DomePort`.
Every ray keeps to the plane that holds the port's axis, so that it meets the axis: the port is an axial camera, with
one centre only for a dome around the pinhole.
Source: Snell's law at each face; Agrawal et al., CVPR 2012, for the axial camera.
"""

from enum import IntEnum
from typing import Protocol

import numpy as np

from uwsim.camera import distortion
from uwsim.camera.refraction import Rays, dot
from uwsim.optics.checks import require, require_index


class Status(IntEnum):
    """Why a point has no pixel."""

    SEEN = 0
    NOT_IN_WATER = 1
    """The point is not finite or not beyond the port's outer face."""
    NO_PATH = 2
    """No ray from the pinhole reaches the point: outside the cone of refraction of a flat port without a gap."""
    NO_PIXEL = 3
    """The ray reaches the pinhole from behind the camera, or beyond the fold of the lens distortion."""


class Port(Protocol):
    """What both ports know; directions (..., 3) in air of any length, points (..., 3) [m] in the camera frame."""

    axis: np.ndarray
    """Unit vector (3,) of the axis through the pinhole on which the rays in the water meet."""
    paraxial_crossing_m: float
    """Where rays next to the axis meet it, from the pinhole along the axis. [m]"""

    def water_rays(self, directions: np.ndarray) -> Rays:
        """Return origins on the outer face and unit directions in the water; NaN where a ray does not get out."""

    def air_directions(self, points_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return unit directions (..., 3) from the pinhole towards points in the water, and `Status` (...)."""

    def paraxial_magnification(self, distance_m: np.ndarray) -> np.ndarray:
        """Return image size over that without port and water, of small things on the axis at a distance [m]."""

    def transmittance(self, directions: np.ndarray) -> np.ndarray:
        """Return the share of power (...) that passes the port along a ray, for unpolarised light."""


def check_port(*, where: str, n_air: float, n_glass: float, n_water: float, **not_negative: float) -> None:
    """Raise ValueError unless air has the smallest index, >= 1, and the other numbers are finite and >= 0."""
    require_index(where, n_air=n_air)
    for name, value in {"n_glass": n_glass, "n_water": n_water}.items():
        require(f"{where} {name}", value, least=n_air)
    for name, value in not_negative.items():
        require(f"{where} {name}", value, least=0)


def unit_vectors(directions: np.ndarray) -> np.ndarray:
    """Return directions (..., 3) at length 1; NaN for those of length 0."""
    directions = np.asarray(directions, float)
    length = np.linalg.norm(directions, axis=-1, keepdims=True)
    return directions / np.where(length > 0, length, np.nan)


def rays(pixels_px: np.ndarray, *, port: Port, K: np.ndarray, coefficients=()) -> Rays:
    """Return the rays in the water of pixels (..., 2): origins on the outer face [m] and unit directions, (..., 3).

    `K` (3, 3) [px] in air; `coefficients` of the lens distortion. NaN where the lens or the port has no ray.
    """
    return port.water_rays(distortion.directions(pixels_px, K, coefficients=coefficients))


def project(
    points_camera_m: np.ndarray, *, port: Port, K: np.ndarray, coefficients=()
) -> tuple[np.ndarray, np.ndarray]:
    """Return pixels (..., 2) of points in the water (..., 3) [m], and `Status` (...) as int8; NaN unless SEEN.

    The inverse of `rays` for points along them, within 1e-9 px. Raises ValueError unless the last axis holds 3.
    Valid: flat ports tilted by up to about 40 degrees, or by any angle with an air gap (without one 2.7e-8 px at 52
    degrees).
    """
    if np.shape(points_camera_m)[-1:] != (3,):
        raise ValueError(f"port points_camera_m: got shape {np.shape(points_camera_m)}, allowed: (..., 3)")
    directions, status = port.air_directions(points_camera_m)
    pixels = distortion.project(directions, K, coefficients=coefficients)
    missing = (status == Status.SEEN) & ~np.all(np.isfinite(pixels), axis=-1)
    return pixels, np.where(missing, np.int8(Status.NO_PIXEL), status)


def transmittance(pixels_px: np.ndarray, *, port: Port, K: np.ndarray, coefficients=()) -> np.ndarray:
    """Return the share of power (...) that the port lets pass to pixels (..., 2), unpolarised; NaN without a ray.

    Radiance also changes with the index: L_air = T (n_air / n_water)^2 L_water.
    """
    return port.transmittance(distortion.directions(pixels_px, K, coefficients=coefficients))


def effective_focal_px(distance_m: np.ndarray, *, port: Port, focal_px: float) -> np.ndarray:
    """Return pixels per unit of (offset from the axis / distance) for points next to the port's axis. [px]

    `distance_m` (...): from the pinhole along the axis; infinity is allowed.
    """
    return focal_px * port.paraxial_magnification(distance_m)


def axis_crossing_m(directions: np.ndarray, *, port: Port) -> np.ndarray:
    """Return where the rays in the water, extended back, meet the port's axis, (...) from the pinhole [m].

    Zero for all rays only if the camera is central. `directions` (..., 3) in air. The axis is the sagittal caustic.
    """
    directions = np.asarray(directions, float)
    origins, outside = port.water_rays(directions)
    across = outside - dot(outside, port.axis) * port.axis
    off_axis = origins - dot(origins, port.axis) * port.axis
    squared = dot(across, across)
    is_on_axis = squared < 1e-16
    back = -dot(off_axis, across) / np.where(is_on_axis, 1.0, squared)
    crossing = dot(origins, port.axis) + back * dot(outside, port.axis)
    limit = np.where(np.isfinite(crossing), port.paraxial_crossing_m, np.nan)
    return np.where(is_on_axis, limit, crossing)[..., 0]
