"""Points through a camera: into its frame, onto the image and back to normalised coordinates.

Pixel centres lie at integer + 0.5; subtract 0.5 for OpenCV. `project(points_camera_m, K)` is the pinhole of
`uwsim.camera`: pixels (..., 2), NaN behind the camera.
"""

import numpy as np

from uwsim.camera.pinhole import project

__all__ = ["normalise", "project", "transform"]


def transform(rotation: np.ndarray, translation_m: np.ndarray, points_m: np.ndarray) -> np.ndarray:
    """Return rotation @ p + translation of points (..., n, 3) [m]; (..., 3, 3) and (..., 3)."""
    return points_m @ np.swapaxes(rotation, -1, -2) + np.asarray(translation_m)[..., None, :]


def normalise(points_px: np.ndarray, K: np.ndarray) -> np.ndarray:
    """Return pixels (..., 2) as points on the plane z = 1 of the camera, x = K^-1 p; undoes `project`."""
    points_px = np.asarray(points_px, dtype=float)
    homogeneous = np.concatenate([points_px, np.ones((*points_px.shape[:-1], 1))], axis=-1)
    rays = homogeneous @ np.linalg.inv(K).T
    return rays[..., :2] / rays[..., 2:]
