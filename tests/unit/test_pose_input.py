"""What the pose solvers are given: pixels, covariances and noise that are none."""

import re

import numpy as np
import pytest

from uwsim.bench.task import pinhole_points
from uwsim.camera.flat_port import FlatPort
from uwsim.camera.lens import Lens
from uwsim.metrics.pose import rotation_error_deg
from uwsim.pose import problems
from uwsim.pose.bound import bound
from uwsim.pose.refine import refine
from uwsim.pose.robust import solve_robust
from uwsim.pose.solvers import best, port_refined

K = np.array([[351.0, 0, 240], [0, 351.0, 180], [0, 0, 1]])
LENS = Lens(K=K, port=FlatPort(gap_m=0.03, thickness_m=0.012, n_glass=1.49, n_water=1.333))
TARGET_M = problems.layout("bi6", edge_m=0.08)
ROTATION = problems.random_rotations(3, rng=np.random.default_rng(0))
PLACE_M = np.array([[0, 0, 0.4], [0.05, 0, 0.5], [0, 0.05, 0.6]])
PIXELS = LENS.project(TARGET_M @ ROTATION.mT + PLACE_M[:, None])[0]
POINTS = np.stack([pinhole_points(one, LENS) for one in PIXELS])
UNIT = np.tile(np.eye(2), (3, 6, 1, 1))


def with_one(values, place, value):
    changed = np.array(values, float)
    changed[place] = value
    return changed


def octahedra(count, *, noise_px=0.0, seed=1, scale=1.0):
    rng = np.random.default_rng(seed)
    placed = problems.in_box(problems.layout("bi6", edge_m=0.1), count=count, rng=rng)
    points = problems.images(placed, focal_px=1300, noise_px=noise_px, rng=rng)
    return problems.Placed(scale * placed.points_m, placed.rotation, scale * placed.translation_m), points


BAD_PIXELS = [
    (with_one(PIXELS, (1, 0, 0), np.nan), "refine: pixels holds 1 NaN or infinite values, allowed: none"),
    (with_one(PIXELS, (1, 0), np.inf), "refine: pixels holds 2 NaN or infinite values, allowed: none"),
    (PIXELS[:2], "refine: pixels has shape (2, 6, 2), allowed: (3, 6, 2)"),
    (PIXELS[:, :5], "refine: pixels has shape (3, 5, 2), allowed: (3, 6, 2)"),
    (PIXELS[0], "refine: pixels has shape (6, 2), allowed: (3, 6, 2)"),
    (None, "refine: pixels has shape (), allowed: (3, 6, 2)"),
    ("none", "refine: pixels holds no numbers (str), allowed: an array"),
]
BAD_COVARIANCES = [
    (with_one(UNIT, (1, 0, 0, 0), np.nan), "holds 1 NaN or infinite values, allowed: none"),
    (with_one(UNIT, (2, 5, 1, 1), np.inf), "holds 1 NaN or infinite values, allowed: none"),
    (with_one(UNIT, (1, 2, 0, 1), 0.5), "holds 1 matrices that are not symmetric, the first at (1, 2) "),
    (with_one(UNIT, (0, 3), [[1, 2], [2, 1]]), "holds 1 matrices that are not positive definite, the first at (0, 3) "),
    (with_one(UNIT, (0, 3), 1.0), "holds 1 matrices that are not positive definite, the first at (0, 3) "),
    (0 * UNIT, "holds 18 matrices that are not positive definite, the first at (0, 0) "),
    (-UNIT, "holds 18 matrices that are not positive definite, the first at (0, 0) "),
]


class TestPixels:
    def target(self):
        return np.tile(TARGET_M, (3, 1, 1))

    @pytest.mark.parametrize("pixels, what", BAD_PIXELS)
    def test_what_is_no_pixels_is_refused(self, pixels, what):
        with pytest.raises(ValueError, match=re.escape(what)):
            port_refined.solve(self.target(), POINTS, pixels=pixels, lens=LENS)

    @pytest.mark.parametrize("covariance, what", BAD_COVARIANCES)
    def test_what_is_no_covariance_is_refused(self, covariance, what):
        with pytest.raises(ValueError, match=re.escape(f"refine: covariance_px2 {what}")):
            port_refined.solve(self.target(), POINTS, pixels=PIXELS, lens=LENS, covariance_px2=covariance)
        with pytest.raises(ValueError, match=re.escape(f"bound: noise_px {what}")):
            bound(TARGET_M, ROTATION, PLACE_M, K=K, noise_px=covariance)

    def test_other_shapes_are_refused(self):
        with pytest.raises(ValueError, match=re.escape("covariance_px2 has shape (6, 2, 2), allowed: (3, 6, 2, 2)")):
            port_refined.solve(self.target(), POINTS, pixels=PIXELS, lens=LENS, covariance_px2=UNIT[0])
        start = best.solve(self.target(), POINTS)
        with pytest.raises(ValueError, match=re.escape("refine: got points (6, 3), allowed: (3, n, 3)")):
            refine(start, TARGET_M, PIXELS, lens=LENS)
        with pytest.raises(ValueError, match=re.escape("refine: points_m holds 1 NaN")):
            refine(start, with_one(self.target(), (0, 0, 0), np.nan), PIXELS, lens=LENS)

    def test_covariances_that_round_off_made_unsymmetric_are_some(self):
        """Control: what goes beyond it is refused above. Errors by their covariance: the mean of two kinds."""
        turn = np.array([[0.8, -0.6], [0.6, 0.8]])
        covariance = UNIT.copy()
        covariance[:] = turn @ np.diag([0.01, 4.0]) @ turn.T * (1 + 1e-9 * np.array([[0, 1], [0, 0]]))
        found = port_refined.solve(self.target(), POINTS, pixels=PIXELS, lens=LENS, covariance_px2=covariance)
        assert rotation_error_deg(found.rotation, ROTATION).max() < 1e-4
        plain = bound(TARGET_M, ROTATION, PLACE_M, K=K, noise_px=np.sqrt([0.01, 4.0])[0])
        least = bound(TARGET_M, ROTATION, PLACE_M, K=K, noise_px=covariance)
        assert np.all(least.rotation_deg > plain.rotation_deg) and np.all(least.rotation_deg < 20 * plain.rotation_deg)


@pytest.mark.parametrize(
    "changed, what",
    [
        ({"points_m": np.nan * TARGET_M}, "bound: points_m holds 18 NaN or infinite values, allowed: none"),
        ({"rotation": np.nan * ROTATION}, "bound: rotation holds 27 NaN or infinite values, allowed: none"),
        ({"translation_m": np.full_like(PLACE_M, np.inf)}, "bound: translation_m holds 9 NaN or infinite"),
        ({"rotation": 2 * ROTATION}, "allowed: rotation matrices"),
        ({"rotation": -ROTATION}, "bound: rotation 0 is "),
        ({"translation_m": PLACE_M[0]}, "bound: got poses (3, 3, 3), (3,), allowed: (B, 3, 3) and (B, 3)"),
        ({"K": with_one(K, (0, 2), np.nan)}, "allowed: 3 x 3, finite"),
        ({"noise_px": np.nan}, "bound: noise_px is nan, allowed: above 0 px"),
    ],
)
def test_what_is_no_pose_has_no_bound(changed, what):
    given = {"points_m": TARGET_M, "rotation": ROTATION, "translation_m": PLACE_M, "K": K, "noise_px": 0.5}
    assert np.all(np.isfinite(bound(**given).rotation_deg))
    with pytest.raises(ValueError, match=re.escape(what)):
        bound(**given | changed)


@pytest.mark.parametrize(
    "noise, what",
    [
        (np.ones(2), "noise has shape (2,), allowed: a number or (3,)"),
        (np.ones((3, 1)), "noise has shape (3, 1), allowed: a number or (3,)"),
        (np.nan, "noise is nan, allowed: 0 and above, finite"),
        ([1.0, np.inf, 1.0], "noise is inf, allowed: 0 and above, finite"),
        (-1.0, "noise is -1, allowed: 0 and above, finite"),
        ("loud", "noise is 'loud', allowed: a number, or one of each problem"),
    ],
)
def test_noise_that_is_none_is_refused(noise, what):
    placed, points = octahedra(3)
    solution = best.solve(placed.points_m, points)
    one, each = solution.covariance(noise=2.0), solution.covariance(noise=np.array([2.0, 2.0, 4.0]))
    np.testing.assert_allclose(each[:2], one[:2])
    np.testing.assert_allclose(each[2], 4 * one[2])
    with pytest.raises(ValueError, match=re.escape(f"covariance: {what}")):
        solution.covariance(noise=noise)


@pytest.mark.parametrize(
    "options, what",
    [
        ({"seed": -1}, "seed is -1, allowed: whole, 0 to 2147483647"),
        ({"seed": 2**40}, "seed is 1099511627776, allowed"),
        ({"seed": 1.5}, "seed is 1.5, allowed: whole"),
        ({"iterations": 10**12}, "iterations is 1000000000000, allowed: whole, 1 to 2147483647"),
        ({"least_inliers": 5.5}, "least_inliers is 5.5, allowed: whole, 4 and above"),
        ({"threshold": "a"}, "threshold is 'a', allowed: above 0, finite"),
        ({"threshold": np.inf}, "threshold is inf, allowed: above 0, finite"),
        ({"confidence": np.nan}, "confidence is nan, allowed: between 0 and 1"),
    ],
)
def test_options_of_the_robust_search_out_of_range(options, what):
    placed, points = octahedra(1)
    assert solve_robust(placed.points_m[0], points[0], threshold=1e-3, least_inliers=np.int64(5)).solution.ok[0]
    with pytest.raises(ValueError, match=re.escape(f"robust: {what}")):
        solve_robust(placed.points_m[0], points[0], **{"threshold": 1e-3} | options)
    with pytest.raises(ValueError, match=re.escape("robust: got shapes (1, 6, 3) and (1, 6, 2), allowed: (n, 3)")):
        solve_robust(placed.points_m, points, threshold=1e-3)
