"""Pinhole camera. Pixel centres lie at integer + 0.5 (OpenCV: at integers)."""

import math

import numpy as np


def camera_matrix(*, width_px: int, height_px: int, horizontal_fov_deg: float) -> np.ndarray:
    """Return K (3, 3) [px] with square pixels and the principal point in the middle of the image."""
    focal_px = width_px / 2 / math.tan(math.radians(horizontal_fov_deg) / 2)
    return np.array([[focal_px, 0, width_px / 2], [0, focal_px, height_px / 2], [0, 0, 1.0]])


def project(points_camera_m: np.ndarray, K: np.ndarray) -> np.ndarray:
    """Return pixel coordinates (..., 2) of points (..., 3) in the camera frame; NaN behind the camera."""
    points = np.asarray(points_camera_m, float)
    depth = np.where(points[..., 2:] > 0, points[..., 2:], np.nan)
    homogeneous = (points / depth) @ K.T
    return homogeneous[..., :2]


def ray_directions(K: np.ndarray, *, width_px: int, height_px: int) -> np.ndarray:
    """Return unit rays through the pixel centres in the camera frame, (H, W, 3)."""
    rows, columns = np.mgrid[0:height_px, 0:width_px] + 0.5
    pixels = np.stack([columns, rows, np.ones_like(rows)], axis=-1)
    directions = pixels @ np.linalg.inv(K).T
    return directions / np.linalg.norm(directions, axis=-1, keepdims=True)
