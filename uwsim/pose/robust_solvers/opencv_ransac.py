"""OpenCV's `solvePnPRansac` as it is mostly called: RANSAC with EPnP on five points, least squares on who agrees.

Source: Fischler and Bolles, Communications of the ACM 24(6), 1981; `cv2.solvePnPRansac`.
"""

import numpy as np

from uwsim.pose.one_by_one import Found, solved_one_by_one
from uwsim.pose.solution import Solution

MINIMUM_POINTS = 5
PLANAR_OK = True
NEEDS = ("threshold",)

# its thresholds are in pixels
_FOCAL_PX = 1000.0


def solve(
    points_m: np.ndarray, points: np.ndarray, *, threshold: float, iterations: int = 100, confidence: float = 0.99
) -> Solution:
    """Return camera_from_target for target points (B, n, 3) [m] seen at normalised image points (B, n, 2).

    `threshold`: reprojection error on the plane z = 1 above which a point is an outlier; `iterations`, `confidence`: at
    most so many draws, and how sure to be of a good one; as OpenCV has them unless said otherwise. Fewer than 5 points,
    NaN or other shapes: ValueError.
    """
    import cv2

    K = np.diag([_FOCAL_PX, _FOCAL_PX, 1.0])

    def find(number: int, target_m: np.ndarray, image: np.ndarray) -> Found | None:
        try:
            found, vector, shift, _ = cv2.solvePnPRansac(
                target_m, _FOCAL_PX * image, K, None, reprojectionError=_FOCAL_PX * threshold,
                iterationsCount=iterations, confidence=confidence,
            )  # fmt: skip
        except cv2.error:
            return None
        return (cv2.Rodrigues(vector)[0], shift.ravel()) if found else None

    return solved_one_by_one(points_m, points, find, minimum=MINIMUM_POINTS, where="opencv_ransac")
