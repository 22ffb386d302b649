"""Poses by least reprojection error through a lens with its distortion and its port."""

import numpy as np

from uwsim.camera.lens import Lens
from uwsim.camera.port import Status
from uwsim.pose.solution import Solution, accept

_TOLERANCE = 1e-14
_UNSEEN_PX = 1e4  # stands for the error of a point that a pose takes out of the lens's sight


def refine(start: Solution, points_m: np.ndarray, pixels: np.ndarray, *, lens: Lens) -> Solution:
    """Return camera_from_target that projects points (B, n, 3) [m] nearest to `pixels` (B, n, 2) [px], from `start`.

    Least squares over rotation vector and translation; where `start` has no pose there is none. Exact for exact pixels.
    Source: Levenberg-Marquardt as in `scipy.optimize.least_squares`.
    """
    rotation, translation_m = start.rotation.copy(), start.translation_m.copy()
    for index in np.flatnonzero(start.ok):
        rotation[index], translation_m[index] = _refined(
            rotation[index], translation_m[index], points_m[index], pixels[index], lens
        )
    rotation[~start.ok] = np.nan
    return accept(rotation, translation_m, points_m)


def _refined(
    rotation: np.ndarray, translation_m: np.ndarray, points_m: np.ndarray, pixels: np.ndarray, lens: Lens
) -> tuple[np.ndarray, np.ndarray]:
    from scipy.optimize import least_squares
    from scipy.spatial.transform import Rotation

    start = Rotation.from_matrix(rotation)
    # all six unknowns of the size of 1: turns about the camera's axes, shifts in shares of the distance
    distance_m = np.linalg.norm(translation_m)

    def pose(unknowns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        turn = Rotation.from_rotvec(unknowns[:3]) * start
        return turn.as_matrix(), translation_m + distance_m * unknowns[3:]

    def errors(unknowns: np.ndarray) -> np.ndarray:
        turn, shift_m = pose(unknowns)
        seen, status = lens.project(points_m @ turn.T + shift_m)
        return np.where((status == Status.SEEN)[:, None], seen - pixels, _UNSEEN_PX).ravel()

    found = least_squares(
        errors, np.zeros(6), jac="3-point", method="lm", xtol=_TOLERANCE, ftol=_TOLERANCE, gtol=_TOLERANCE
    )
    return pose(found.x)
