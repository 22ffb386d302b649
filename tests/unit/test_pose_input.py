"""What the pose solvers are given: numbers out of range, pixels and covariances that are none; and what ok says."""

import re
import warnings

import numpy as np
import pytest
from scipy.stats import chi2

from uwsim.bench.task import pinhole_points
from uwsim.camera.flat_port import FlatPort
from uwsim.camera.lens import Lens
from uwsim.discovery import discover, missing_packages
from uwsim.metrics.pose import rotation_error_deg
from uwsim.pose import problems, solvers
from uwsim.pose.bound import bound
from uwsim.pose.refine import refine
from uwsim.pose.solution import Status, accept
from uwsim.pose.solvers import best, port_refined

FOUND = {
    name: module for name, module in discover(solvers).items() if not module.NEEDS and not missing_packages(module)
}
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


class TestMagnitudes:
    @pytest.mark.parametrize("name", sorted(FOUND))
    @pytest.mark.parametrize("which", ["points_m", "points"])
    def test_a_number_beyond_all_measure_is_named(self, name, which):
        """One coordinate of 1e160 in problem 2. Control: one of 1e60, whose squares are finite, ends no batch."""
        placed, points = octahedra(4)
        given = {"points_m": placed.points_m, "points": points}
        what = f"{name}: {which} holds 1 values of magnitude above 1e+75, the first in problem 2, allowed: up to that"
        with pytest.raises(ValueError, match=re.escape(what)):
            FOUND[name].solve(**given | {which: with_one(given[which], (2, 1, 0), 1e160)})
        if not getattr(FOUND[name], "SOLID_OK", True):
            return
        plain = FOUND[name].solve(**given)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)
            solution = FOUND[name].solve(**given | {which: with_one(given[which], (2, 1, 0), 1e60)})
        assert plain.ok.all() and solution.ok[[0, 1, 3]].all()
        np.testing.assert_allclose(solution.rotation[[0, 1, 3]], plain.rotation[[0, 1, 3]], atol=1e-6)

    @pytest.mark.parametrize("scale", [1e-8, 1e10])
    def test_units_do_not_matter(self, scale):
        """Octahedra of 1e-9 m and 1e9 m. Expected: the poses of those of 0.1 m, times the scale."""
        placed, points = octahedra(20, noise_px=0.5)
        scaled, _ = octahedra(20, noise_px=0.5, scale=scale)
        for name, module in FOUND.items():
            if not getattr(module, "SOLID_OK", True):
                continue
            here, there = module.solve(placed.points_m, points), module.solve(scaled.points_m, points)
            np.testing.assert_array_equal(here.ok, there.ok)
            np.testing.assert_allclose(there.rotation, here.rotation, atol=1e-5, err_msg=name)
            np.testing.assert_allclose(there.translation_m / scale, here.translation_m, rtol=1e-4, err_msg=name)

    def test_a_pose_of_endless_cost_is_none(self):
        """The square of an image at 1e200 is infinite. Control: at 1e100, and the other problem, it is not."""
        placed, points = octahedra(2)
        pose = placed.rotation, placed.translation_m, placed.points_m
        with np.errstate(over="ignore", invalid="ignore"):
            found = accept(*pose, with_one(points, (0, 0, 0), 1e200))
        assert found.status.tolist() == [Status.NO_POSE, Status.OK] and found.ok.tolist() == [False, True]
        np.testing.assert_array_equal(found.rotation[0], np.eye(3))
        assert np.all(np.isnan(found.translation_m[0])) and np.isnan(found.cost[0])
        assert np.all(np.isnan(found.information[0])) and np.all(np.isfinite(found.information[1]))
        assert accept(*pose, with_one(points, (0, 0, 0), 1e100)).ok.all()


def test_ok_is_no_fit_and_the_cost_says_so():
    """What `Status` states of the cost: chi-squared for the stated noise. Expected: 1 in 100 octahedra above its 99 %
    quantile, to 4 standard errors of 2000. Negative control: with two names swapped they are ok, all above it, and the
    noise they would need is 20 times the stated one in the median."""
    noise_px, focal_px = 0.5, 1300.0
    placed, points = octahedra(2000, noise_px=noise_px)
    variance = (noise_px / focal_px) ** 2
    right = best.solve(placed.points_m, points)
    limit = variance * chi2.ppf(0.99, right.freedom)
    assert right.ok.all() and np.mean(right.cost > limit) == pytest.approx(0.01, abs=4 * np.sqrt(0.0099 / 2000))
    swapped = best.solve(placed.points_m[:100], points[:100, [1, 0, 2, 3, 4, 5]])
    assert swapped.ok.mean() > 0.95 and np.all(swapped.cost[swapped.ok] > limit)
    needed_px = focal_px * np.sqrt(swapped.cost[swapped.ok] / swapped.freedom)
    assert np.median(needed_px) > 20 * noise_px
