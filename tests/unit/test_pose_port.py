"""Poses through a port: exact with its refraction, off without; covariances of points used and handed on."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from uwsim.bench.task import pinhole_points
from uwsim.camera.flat_port import FlatPort
from uwsim.camera.lens import Lens
from uwsim.metrics.pose import rotation_error_deg, translation_error_percent
from uwsim.pose import problems
from uwsim.pose.refine import refine
from uwsim.pose.solution import Status
from uwsim.pose.solvers import best, pinhole_ignoring_port, port_refined

LENS = Lens(
    K=np.array([[351.0, 0, 240], [0, 351.0, 180], [0, 0, 1]]),
    port=FlatPort(gap_m=0.03, thickness_m=0.012, n_glass=1.49, n_water=1.333),
)
TARGET_M = problems.layout("bi6", edge_m=0.08)


def views(count, *, target_m=TARGET_M, seed=1):
    """Return rotations, translations [m] and exact pixels through the port, from 0.3 to 0.8 m, up to 0.1 m aside."""
    rng = np.random.default_rng(seed)
    rotation = Rotation.random(count, random_state=seed).as_matrix()
    shift_m = rng.uniform([-0.1, -0.06, 0.3], [0.1, 0.06, 0.8], (count, 3))
    pixels, _ = LENS.project(target_m @ np.swapaxes(rotation, 1, 2) + shift_m[:, None])
    return rotation, shift_m, pixels


def solved(module, pixels, target_m=TARGET_M, **inputs):
    target = np.tile(target_m, (len(pixels), 1, 1))
    points = np.stack([pinhole_points(one, LENS) for one in pixels])
    given = {"pixels": pixels, "lens": LENS} if module is not best else {}
    return module.solve(target, points, **given, **inputs)


def errors(solution, rotation, shift_m):
    assert solution.ok.all()
    return rotation_error_deg(solution.rotation, rotation), translation_error_percent(solution.translation_m, shift_m)


def test_the_pose_through_the_port_is_exact():
    """Expected: to 1e-6 rad and 1e-6 of the distance. Negative controls: the paraxial pinhole in water is off by
    tenths of a percent, the pinhole in air, the port forgotten, by a fifth of the distance and more."""
    rotation, shift_m, pixels = views(12)
    turned, moved = errors(solved(port_refined, pixels), rotation, shift_m)
    assert np.radians(turned).max() < 1e-6 and moved.max() < 1e-4
    _, by_pinhole = errors(solved(best, pixels), rotation, shift_m)
    assert by_pinhole.min() > 0.05 and np.median(by_pinhole) > 0.3
    turned, ignoring = errors(solved(pinhole_ignoring_port, pixels), rotation, shift_m)
    assert 15 < np.median(ignoring) < 40
    assert np.median(turned) > 0.1


def test_without_a_port_all_three_are_one():
    lens = Lens(K=LENS.K)
    rotation, shift_m, _ = views(4)
    target = np.tile(TARGET_M, (4, 1, 1))
    pixels = lens.project(TARGET_M @ np.swapaxes(rotation, 1, 2) + shift_m[:, None])[0]
    points = np.stack([pinhole_points(one, lens) for one in pixels])
    for module in (port_refined, pinhole_ignoring_port):
        found = module.solve(target, points, pixels=pixels, lens=lens)
        assert found.rotation == pytest.approx(rotation, abs=1e-6)


def test_a_flat_target_keeps_the_better_of_its_two_poses():
    rotation, shift_m, pixels = views(8, target_m=problems.layout("pl4", edge_m=0.1), seed=3)
    turned, _ = errors(solved(port_refined, pixels, problems.layout("pl4", edge_m=0.1)), rotation, shift_m)
    assert np.radians(turned).max() < 1e-5


def test_points_count_by_their_covariance():
    """Expected: the covariance of the pose is what repeated noise gives, 30 times, to 45 %; a point that is said to
    be bad does no harm. Negative control: taken for good it does."""
    rotation, shift_m, pixels = views(1, seed=5)
    sd = np.array([0.05, 0.05, 0.05, 0.05, 0.4, 0.4])
    covariance = (sd**2)[None, :, None, None] * np.eye(2)
    rng = np.random.default_rng(6)
    start = solved(port_refined, pixels)
    shifts, stated = [], None
    for _ in range(30):
        noisy = pixels + sd[:, None] * rng.normal(size=pixels.shape)
        found = refine(start, TARGET_M[None], noisy, lens=LENS, covariance_px2=covariance)
        shifts.append(found.translation_m[0] - shift_m[0])
        stated = found.covariance(noise=1.0)[0, 3:, 3:]
    measured = np.std(shifts, axis=0)
    assert measured == pytest.approx(np.sqrt(np.diag(stated)), rel=0.45)
    bad = pixels.copy()
    bad[0, 5] += 5.0
    loose = np.tile(1e-4 * np.eye(2), (1, 6, 1, 1))
    loose[0, 5] = 1e4 * np.eye(2)
    _, moved = errors(solved(port_refined, bad, covariance_px2=loose), rotation, shift_m)
    assert moved[0] < 0.01
    _, moved = errors(solved(port_refined, bad), rotation, shift_m)
    assert moved[0] > 0.1


def test_status_and_the_other_pose_are_handed_on():
    """Expected: a line is degenerate; a flat target's second pose costs more and is a minimum. Control: solid targets
    have none."""
    line_m = np.linspace(-0.05, 0.05, 6)[:, None] * [1.0, 2, 3]
    pixels, _ = LENS.project(line_m @ Rotation.random(random_state=2).as_matrix().T + [0, 0, 0.5])
    assert solved(port_refined, pixels[None], line_m).status.tolist() == [Status.DEGENERATE]
    flat_m = problems.layout("pl4", edge_m=0.1)
    rotation, _, pixels = views(8, target_m=flat_m, seed=3)
    found = solved(port_refined, pixels, flat_m)
    known = np.isfinite(found.twin.cost_ratio)
    assert known.sum() >= 4 and np.all(found.twin.cost_ratio[known] > 1)
    again = found._replace(rotation=np.where(known[:, None, None], found.twin.rotation, np.eye(3)),
                           translation_m=found.twin.translation_m, ok=known, twin=None)  # fmt: skip
    stayed = refine(again, np.tile(flat_m, (8, 1, 1)), pixels, lens=LENS)
    assert rotation_error_deg(stayed.rotation[known], found.twin.rotation[known]).max() < 1e-3
    _, _, pixels = views(3)
    assert np.all(np.isnan(solved(port_refined, pixels).twin.cost_ratio))


def test_the_covariance_does_not_depend_on_the_start():
    """From starts 0, 20 and 60 degrees off. Expected: the same information, that of `best` where there is no port."""
    lens = Lens(K=LENS.K)
    rotation, shift_m, _ = views(1)
    pixels = lens.project(TARGET_M @ np.swapaxes(rotation, 1, 2) + shift_m[:, None])[0]
    points = np.stack([pinhole_points(one, lens) for one in pixels])
    plain = best.solve(TARGET_M[None], points)
    expected = plain.information[0] * lens.K[0, 0] ** 2
    for angle_deg in (0, 20, 60):
        turn = Rotation.from_rotvec(np.radians(angle_deg) * np.array([0.6, 0.64, 0.48])).as_matrix()
        found = refine(plain._replace(rotation=turn @ plain.rotation), TARGET_M[None], pixels, lens=lens)
        assert found.information[0] == pytest.approx(expected, rel=1e-4, abs=1e-5 * np.abs(expected).max())


def test_wrong_covariances_are_refused():
    _, _, pixels = views(1)
    with pytest.raises(ValueError, match="noise is -1, allowed: 0 and above"):
        solved(best, pixels).covariance(noise=-1)
    with pytest.raises(ValueError, match="covariance_px2 has shape"):
        solved(port_refined, pixels, covariance_px2=np.eye(2))
    with pytest.raises(ValueError, match="matrices that are not positive definite"):
        solved(port_refined, pixels, covariance_px2=np.tile(-np.eye(2), (1, 6, 1, 1)))
