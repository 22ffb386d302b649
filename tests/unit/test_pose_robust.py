"""Poses from points with outliers among them: found, refined on the inliers, or refused."""

import re

import numpy as np
import pytest

from uwsim.metrics.pose import rotation_error_deg
from uwsim.pose import bound, problems, robust
from uwsim.pose.robust import solve_robust
from uwsim.pose.solution import Status
from uwsim.pose.solvers import best, paraperspective_lm

FOCAL_PX, NOISE_PX = 1300.0, 0.5
THRESHOLD = 3 * NOISE_PX / FOCAL_PX
K = np.diag([FOCAL_PX, FOCAL_PX, 1.0])


def spoilt(share, *, points=40, seed=0, flat=False):
    """Return (placed, images (n, 2), outliers (n,)): a share of the images drawn anew over the picture."""
    rng = np.random.default_rng(seed)
    if flat:
        target_m = np.column_stack([rng.uniform(-0.3, 0.3, (points, 2)), np.zeros(points)])
        placed = problems.in_box(target_m, count=1, rng=rng)
    else:
        placed = problems.random_points(points=points, count=1, rng=rng)
    image = problems.images(placed, focal_px=FOCAL_PX, noise_px=NOISE_PX, rng=rng)[0]
    wrong = np.zeros(points, bool)
    wrong[rng.permutation(points)[: round(share * points)]] = True
    image[wrong] = rng.uniform(-0.5, 0.5, (wrong.sum(), 2))
    return placed, image, wrong


@pytest.mark.parametrize("method", ["magsac", "msac", "ransac"])
@pytest.mark.parametrize(("share", "flat"), [(0.3, False), (0.3, True), (0.6, False), (0.6, True)])
def test_outliers_are_found_and_the_pose_is_that_of_the_inliers(share, flat, method):
    """Root mean square of five by the bound of the good points. Control: least squares of all points is far off."""
    excess = []
    for seed in range(5):
        placed, image, wrong = spoilt(share, seed=seed, flat=flat)
        found = solve_robust(placed.points_m[0], image, threshold=THRESHOLD, method=method)
        assert found.solution.ok[0] and found.solution.status[0] == Status.OK
        assert not np.any(found.inliers & wrong)
        # 1 % of good points lie beyond 3 standard deviations
        assert np.mean(found.inliers[~wrong]) > 0.85
        only = best.solve(placed.points_m[:, found.inliers], image[None, found.inliers])
        np.testing.assert_array_equal(only.rotation, found.solution.rotation)
        good = placed.points_m[0, ~wrong]
        least = bound.bound(good, placed.rotation, placed.translation_m, K=K, noise_px=NOISE_PX)
        error_deg = rotation_error_deg(found.solution.rotation, placed.rotation)
        excess.append(error_deg[0] / least.rotation_deg[0])
    assert np.sqrt(np.mean(np.square(excess))) < 1.7
    everyone = paraperspective_lm.solve(placed.points_m, image[None])
    assert rotation_error_deg(everyone.rotation, placed.rotation)[0] > 20 * least.rotation_deg[0]


@pytest.mark.parametrize(("points", "bad", "flat"), [(6, 1, False), (8, 2, True), (12, 6, False)])
def test_few_points_with_outliers(points, bad, flat):
    """No wrong pose, hardly a problem without one. Five points are enough to refuse a sixth."""
    found = []
    for seed in range(10):
        placed, image, wrong = spoilt(bad / points, points=points, seed=seed, flat=flat)
        pose = solve_robust(placed.points_m[0], image, threshold=1.3 * THRESHOLD)
        assert not np.any(pose.inliers & wrong)
        if pose.solution.ok[0]:
            good = placed.points_m[0, ~wrong]
            least = bound.bound(good, placed.rotation, placed.translation_m, K=K, noise_px=NOISE_PX)
            found.append(rotation_error_deg(pose.solution.rotation, placed.rotation)[0] / least.rotation_deg[0])
    assert len(found) >= 9 and max(found) < 4


def test_without_outliers_nearly_all_points_agree():
    placed, image, _ = spoilt(0)
    found = solve_robust(placed.points_m[0], image, threshold=1.5 * THRESHOLD)
    assert found.inliers.all()
    np.testing.assert_array_equal(found.solution.rotation, best.solve(placed.points_m, image[None]).rotation)
    assert found.solution.freedom == 74
    assert np.all(np.isfinite(found.solution.covariance()))


def test_nothing_but_outliers_gives_no_pose():
    for seed in range(5):
        placed, image, _ = spoilt(1.0, points=25, seed=seed)
        found = solve_robust(placed.points_m[0], image, threshold=THRESHOLD)
        assert not found.solution.ok[0] and found.solution.status[0] == Status.NO_POSE
        assert not found.inliers.any() and np.isnan(found.solution.translation_m).all()


def test_fewer_agreeing_points_than_asked_for_give_no_pose():
    placed, image, wrong = spoilt(0.6, points=20, seed=2)
    good = np.count_nonzero(~wrong)
    assert solve_robust(placed.points_m[0], image, threshold=2 * THRESHOLD, least_inliers=good).solution.ok[0]
    refused = solve_robust(placed.points_m[0], image, threshold=2 * THRESHOLD, least_inliers=good + 1)
    assert refused.solution.status[0] == Status.NO_POSE


@pytest.mark.parametrize("target", [np.linspace(-1, 1, 12)[:, None] * [1.0, 2, 0.5], np.ones((12, 3))])
def test_degenerate_targets_give_no_pose(target):
    image = np.random.default_rng(0).uniform(-0.5, 0.5, (12, 2))
    found = solve_robust(target, image, threshold=THRESHOLD)
    assert not found.solution.ok[0] and found.solution.status[0] != Status.OK


def test_the_same_seed_gives_the_same_result():
    placed, image, _ = spoilt(0.5)
    results = [solve_robust(placed.points_m[0], image, threshold=THRESHOLD, seed=7) for _ in range(2)]
    np.testing.assert_array_equal(results[0].solution.rotation, results[1].solution.rotation)
    np.testing.assert_array_equal(results[0].inliers, results[1].inliers)


@pytest.mark.parametrize(
    ("options", "what"),
    [
        ({"threshold": 0.0}, "threshold is 0.0, allowed: a number above 0"),
        ({"threshold": -1e-3}, "threshold is -0.001, allowed: a number above 0"),
        ({"threshold": np.nan}, "threshold is nan, allowed: a number above 0"),
        ({"threshold": np.inf}, "threshold is inf"),
        ({"threshold": None}, "threshold is None"),
        ({"threshold": "1e-3"}, "threshold is '1e-3'"),
        ({"threshold": True}, "threshold is True"),
        ({"threshold": np.ones((9, 2))}, "threshold is array"),
        ({"method": "lmeds"}, "method is 'lmeds', allowed: magsac, msac, ransac"),
        ({"least_inliers": 3}, "least_inliers is 3, allowed: a whole number, 4 and above"),
        ({"least_inliers": 5.5}, "least_inliers is 5.5, allowed: a whole number, 4 and above"),
        ({"least_inliers": None}, "least_inliers is None"),
        ({"confidence": 1.0}, "confidence is 1.0, allowed: a number between 0 and 1"),
        ({"confidence": np.nan}, "confidence is nan"),
        ({"confidence": "high"}, "confidence is 'high'"),
        ({"iterations": 0}, "iterations is 0, allowed: a whole number, 1 to 2147483647"),
        ({"iterations": 2.5}, "iterations is 2.5, allowed: a whole number"),
        ({"iterations": 2**40}, "iterations is 1099511627776"),
        ({"seed": 2**40}, "seed is 1099511627776, allowed: a whole number, 0 to 2147483647"),
        ({"seed": -1}, "seed is -1"),
        ({"seed": 0.5}, "seed is 0.5"),
        ({"seed": None}, "seed is None"),
        ({"least_inliers": 41}, "got 40 points, allowed: at least 41"),
    ],
)
def test_misuse_is_refused(options, what):
    """In one line that names the place. Control: numbers of NumPy's types, and the largest seed, are taken."""
    placed, image, _ = spoilt(0)
    with pytest.raises(ValueError, match=f"^robust: {re.escape(what)}") as caught:
        solve_robust(placed.points_m[0], image, **{"threshold": THRESHOLD, **options})
    assert "\n" not in str(caught.value)
    numbers = {"threshold": np.float32(2 * THRESHOLD), "least_inliers": np.int64(5), "iterations": np.int32(900)}
    assert solve_robust(placed.points_m[0], image, seed=2**31 - 1, **numbers).solution.ok[0]


@pytest.mark.parametrize(
    ("change", "what"),
    [
        (lambda target, image: (target, image[1:]), "got 40 points_m and 39 points, allowed: as many of each"),
        (lambda target, image: (target[None], image[None]), "points_m has shape (1, 40, 3), allowed: (n, 3), one"),
        (lambda target, image: (target[:, :2], image), "points_m has shape (40, 2), allowed: (n, 3)"),
        (lambda target, image: (target.ravel(), image), "points_m has shape (120,)"),
        (lambda target, image: (target, target), "points has shape (40, 3), allowed: (n, 2)"),
        (lambda target, image: (target, image.T), "points has shape (2, 40)"),
        (lambda target, image: (target[:0], image[:0]), "got 0 points, allowed: at least 5"),
        (lambda target, image: (1.0, image), "points_m has shape ()"),
        (lambda target, image: ("points", image), "points_m is a str that is no array of numbers, allowed: (n, 3)"),
        (lambda target, image: ([[1, 2, 3], [1, 2]], image), "points_m is a list that is no array of numbers"),
        (lambda target, image: (target, image + 1j), "points is a ndarray that is no array of numbers"),
        (lambda target, image: (target, np.full_like(image, np.nan)), "points holds 80 NaN or infinite values"),
        (lambda target, image: (target * np.inf, image), "points_m holds 120 NaN or infinite values"),
    ],
)  # fmt: skip
def test_what_is_no_problem_is_refused(change, what):
    """In one line that says what the function takes. Control: the same points as lists are taken."""
    placed, image, _ = spoilt(0)
    with pytest.raises(ValueError, match=f"^robust: {re.escape(what)}") as caught:
        solve_robust(*change(placed.points_m[0], image), threshold=THRESHOLD)
    assert "\n" not in str(caught.value)
    assert solve_robust(placed.points_m[0].tolist(), image.tolist(), threshold=THRESHOLD).solution.ok[0]


def test_five_inliers_are_the_least_unless_said_otherwise():
    assert robust.LEAST_INLIERS == 5
