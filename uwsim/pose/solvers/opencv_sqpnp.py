"""OpenCV's SQPnP: sequential quadratic programming from several starts, one problem at a time.

Known limit: farther away than about 200 times the size of the target it finds no pose (not ok), noise or not.

Source: Terzakis and Lourakis, ECCV 2020, "A consistently fast and globally optimal solution to the
perspective-n-point problem"; `cv2.solvePnPGeneric` with SOLVEPNP_SQPNP.
"""

import numpy as np

from uwsim.pose.solution import Solution, accept, check_points, spread_out

# three points fit several poses
MINIMUM_POINTS = 4
PLANAR_OK = True
NEEDS = ()


def solve(points_m: np.ndarray, points: np.ndarray) -> Solution:
    """Return camera_from_target for target points (B, n, 3) [m] seen at normalised image points (B, n, 2).

    Of several solutions that have all points before the camera the one with the least reprojection error
    counts. Points on one line, or images in one point: not ok. Fewer than 4 points, NaN or other shapes:
    ValueError.
    """
    points_m, points = check_points(points_m, points, minimum=MINIMUM_POINTS, where="opencv_sqpnp")
    rotation = np.full((len(points_m), 3, 3), np.nan)
    translation_m = np.full((len(points_m), 3), np.nan)
    for index in np.flatnonzero(spread_out(points_m, points)):
        pose = _solve_one(points_m[index], points[index])
        if pose is not None:
            rotation[index], translation_m[index] = pose
    return accept(rotation, translation_m, points_m)


def _solve_one(points_m: np.ndarray, points: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    """Return (rotation, translation [m]) of one problem; None if OpenCV finds no pose before the camera."""
    import cv2

    # centred and scaled to unit size: OpenCV's thresholds are absolute
    centre = points_m.mean(axis=0)
    size_m = np.linalg.norm(points_m - centre, axis=1).max()
    unit = np.ascontiguousarray((points_m - centre) / size_m)
    try:
        _, rotation_vectors, shifts, _ = cv2.solvePnPGeneric(
            unit, np.ascontiguousarray(points), np.eye(3), None, flags=cv2.SOLVEPNP_SQPNP
        )
    except cv2.error:
        return None
    best, best_error = None, np.inf
    for vector, shift in zip(rotation_vectors, shifts, strict=True):
        rotation = cv2.Rodrigues(vector)[0]
        seen = unit @ rotation.T + shift.ravel()
        if not np.all(seen[:, 2] > 0):
            continue
        error = np.sum((seen[:, :2] / seen[:, 2:] - points) ** 2)
        if error < best_error:
            best, best_error = (rotation, size_m * shift.ravel() - rotation @ centre), error
    return best
