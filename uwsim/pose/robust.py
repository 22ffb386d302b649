"""A pose from points some of which are wrong: random samples find who agrees, `best` the pose of those."""

from numbers import Integral, Real
from typing import Literal, NamedTuple, get_args

import numpy as np

from uwsim.pose.solution import Solution, Status, accept, check_points
from uwsim.pose.solvers import best

Method = Literal["magsac", "msac", "ransac"]
LEAST_INLIERS = 5
"""Three points fit a pose exactly, whatever they are: two more have to agree with it."""
_ROUNDS = 10
# the pose of a sample is rougher than that of all who agree with it
_FIRST_FACTOR = 2.0
# OpenCV's thresholds are in pixels
_FOCAL_PX = 1000.0


class RobustSolution(NamedTuple):
    """`solution`: the pose of one problem, a batch of 1; `inliers` (n,) bool: the points it was found from.

    Where no pose is found `solution.status` says why, and no point is an inlier.
    """

    solution: Solution
    inliers: np.ndarray


def solve_robust(
    points_m: np.ndarray, points: np.ndarray, *, threshold: float, method: Method = "magsac",
    least_inliers: int = LEAST_INLIERS, confidence: float = 0.999, iterations: int = 5000, seed: int = 0,
) -> RobustSolution:  # fmt: skip
    """Return camera_from_target for points (n, 3) [m] seen at normalised image points (n, 2), with outliers among them.

    `threshold`: reprojection error on the plane z = 1 (pixels by focal length) above which a point is an outlier;
    about 3 standard deviations of the noise. The pose found by consensus is refined by `best` on its inliers, and these
    are taken anew, until they stay the same. Same `seed`, same result. Fewer than `least_inliers` that agree, or such
    that leave the pose open: not ok. ValueError for other shapes, NaN, fewer points than `least_inliers`, other
    methods and options out of range.

    Valid: outliers that do not agree on another pose, up to 60 % of 20 points, 50 % of 12, one of 6: there near the
    bound of the good points.
    Source: Barath and others, CVPR 2020 (MAGSAC++); Torr and Zisserman 2000 (MSAC); OpenCV's USAC, by name.
    """
    _check_options(threshold, method, least_inliers, confidence, iterations, seed)
    points_m, points = np.asarray(points_m, float), np.asarray(points, float)
    if points_m.ndim != 2 or points.ndim != 2:
        raise ValueError(f"robust: got shapes {points_m.shape} and {points.shape}, allowed: (n, 3) and (n, 2)")
    given_m, given = check_points(points_m[None], points[None], minimum=least_inliers, where="robust")
    start = _consensus(given_m[0], given[0], threshold, method, confidence, iterations, seed)
    if start is None:
        return _nothing(given_m, Status.NO_POSE)
    inliers = _agreeing(*start, given_m[0], given[0], _FIRST_FACTOR * threshold)
    for _ in range(_ROUNDS):
        if np.count_nonzero(inliers) < least_inliers:
            return _nothing(given_m, Status.NO_POSE)
        solution = best.solve(given_m[:, inliers], given[:, inliers])
        if not solution.ok[0]:
            return _nothing(given_m, solution.status[0])
        again = _agreeing(solution.rotation[0], solution.translation_m[0], given_m[0], given[0], threshold)
        if np.array_equal(again, inliers):
            return RobustSolution(solution, inliers)
        inliers, used = again, inliers
    # points on the threshold that come and go: those of the pose returned
    return RobustSolution(solution, used)


def _consensus(
    target_m: np.ndarray, image: np.ndarray, threshold: float, method: str, confidence: float, iterations: int,
    seed: int,
) -> tuple[np.ndarray, np.ndarray] | None:  # fmt: skip
    """Return the rotation and translation [m] that most points agree on, by OpenCV; None where it finds none."""
    import cv2

    centre_m = target_m.mean(axis=0)
    size_m = np.sqrt(np.mean(np.sum((target_m - centre_m) ** 2, axis=1)))
    if size_m == 0:
        return None
    params = cv2.UsacParams()
    params.score = getattr(cv2, f"SCORE_METHOD_{method.upper()}")
    params.loMethod = cv2.LOCAL_OPTIM_SIGMA if method == "magsac" else cv2.LOCAL_OPTIM_INNER_AND_ITER_LO
    params.threshold, params.confidence = _FOCAL_PX * threshold, confidence
    params.maxIterations, params.randomGeneratorState = iterations, seed
    K = np.diag([_FOCAL_PX, _FOCAL_PX, 1.0])
    try:
        found, _, vector, shift, _ = cv2.solvePnPRansac(
            (target_m - centre_m) / size_m, _FOCAL_PX * image, K, None, params=params
        )
    except cv2.error:
        return None
    if not found or not (np.all(np.isfinite(vector)) and np.all(np.isfinite(shift))):
        return None
    rotation = cv2.Rodrigues(vector)[0]
    return rotation, size_m * shift.ravel() - rotation @ centre_m


def _agreeing(
    rotation: np.ndarray, translation_m: np.ndarray, target_m: np.ndarray, image: np.ndarray, threshold: float
) -> np.ndarray:
    """Return which points (n,) lie before the camera and are seen within the threshold."""
    camera_m = target_m @ rotation.T + translation_m
    before = camera_m[:, 2] > 0
    seen = camera_m[:, :2] / np.where(before, camera_m[:, 2], np.nan)[:, None]
    return np.linalg.norm(seen - image, axis=1) <= threshold


def _nothing(points_m: np.ndarray, status: int) -> RobustSolution:
    none = accept(np.full((1, 3, 3), np.nan), np.full((1, 3), np.nan), points_m, status=np.array([status]))
    return RobustSolution(none, np.zeros(points_m.shape[1], bool))


def _check_options(
    threshold: float, method: str, least_inliers: int, confidence: float, iterations: int, seed: int
) -> None:
    if method not in get_args(Method):
        raise ValueError(f"robust: method is {method!r}, allowed: {', '.join(get_args(Method))}")
    for name, value, whole, low, high, allowed in (
        ("threshold", threshold, False, 0, np.inf, "above 0, finite"),
        ("least_inliers", least_inliers, True, 3, np.inf, "4 and above"),
        ("confidence", confidence, False, 0, 1, "between 0 and 1"),
        ("iterations", iterations, True, 0, 2**31, "1 to 2147483647"),
        ("seed", seed, True, -1, 2**31, "0 to 2147483647"),
    ):
        kind = Integral if whole else Real
        if not (isinstance(value, kind) and low < value < high):
            raise ValueError(f"robust: {name} is {value!r}, allowed: {'whole, ' if whole else ''}{allowed}")
