"""The outline of a sphere through a lens and its port: its shape, and how far its middle is from the centre's image.

A pinhole sees a sphere as an ellipse, longer away from the axis, whose middle lies farther out than the image of the
sphere's centre: by sin^2(a) / (cos^2(t) - sin^2(a)) of that image's distance from the principal point, a the angular
radius and t the angle to the axis. A port adds to that. Here the outline is followed point by point through the lens.
"""

import numpy as np

from uwsim.camera.lens import Lens

_AROUND = 48
_STEP = 1e-4
_FAR_M = 1.0


def local_map(lens: Lens, centre_px: np.ndarray) -> np.ndarray | None:
    """Return d pixel / d angle (2, 2) [px / rad] at a pixel (2,), the angles across its ray; None without a ray."""
    origin, direction = (part.reshape(3) for part in lens.rays(np.asarray(centre_px, float)))
    if not np.all(np.isfinite(direction)):
        return None
    across = _across(direction)
    ends = origin + _FAR_M * (direction + _STEP * np.concatenate([across, -across]))
    pixels, _ = lens.project(ends)
    slope = (pixels[:2] - pixels[2:]).T / (2 * _STEP)
    return slope if np.all(np.isfinite(slope)) else None


def shape_of(slope: np.ndarray) -> np.ndarray:
    """Return the symmetric (2, 2) of determinant 1 that makes circles to outlines, of a `local_map`."""
    return shape_of_moments(slope @ slope.T)


def shape_of_moments(moments: np.ndarray) -> np.ndarray:
    """Return the symmetric (2, 2) of determinant 1 that makes circles to ellipses of these second moments (2, 2)."""
    values, vectors = np.linalg.eigh(moments)
    return (vectors * np.sqrt(values / np.sqrt(values.prod()))) @ vectors.T


def middle_off_px(lens: Lens, centre_px: np.ndarray, radius_px: float, *, radius_m: float | None = None) -> np.ndarray:
    """Return the middle of an outline less the image of the sphere's centre, (2,) [px], near a pixel.

    `radius_px`: that of the circle of the outline's area. `radius_m` of the sphere, for a port, whose effect hangs on
    the distance; left out: as if 1 m away. NaN without rays.
    """
    slope = local_map(lens, centre_px)
    if slope is None:
        return np.full(2, np.nan)
    sine = np.sin(radius_px / np.sqrt(abs(np.linalg.det(slope))))
    distance_m = _FAR_M if radius_m is None else radius_m / sine
    origin, direction = (part.reshape(3) for part in lens.rays(np.asarray(centre_px, float)))
    turn = np.arange(_AROUND) * 2 * np.pi / _AROUND
    rim = np.column_stack([np.cos(turn), np.sin(turn)]) @ _across(direction)
    # where rays through the origin touch the sphere
    points = origin + distance_m * np.sqrt(1 - sine**2) * (np.sqrt(1 - sine**2) * direction + sine * rim)
    outline, _ = lens.project(points)
    return _centroid(outline) - lens.project(origin + distance_m * direction)[0]


def _across(direction: np.ndarray) -> np.ndarray:
    """Return two unit vectors (2, 3) at right angles to a direction and to each other."""
    first = np.cross(direction, np.eye(3)[np.argmin(np.abs(direction))])
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(direction, first)])


def _centroid(corners: np.ndarray) -> np.ndarray:
    """Return the centroid of the area of a polygon (n, 2)."""
    middle = corners.mean(axis=0)
    first = corners - middle
    second = np.roll(first, -1, axis=0)
    cross = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
    return middle + ((first + second) * cross[:, None]).sum(axis=0) / (3 * cross.sum())
