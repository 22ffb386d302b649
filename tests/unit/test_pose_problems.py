"""Generated pose problems: layouts, places, noise."""

import numpy as np
import pytest

from uwsim.pose import problems


def generator():
    return np.random.default_rng(0)


def distances(points_m):
    return np.linalg.norm(points_m[:, None] - points_m[None], axis=2)


@pytest.mark.parametrize(
    "name, points, edges, rank", [("bi6", 6, 12, 3), ("py5", 5, 8, 3), ("st4", 4, 5, 3), ("pl4", 4, 4, 2)]
)
def test_layouts_have_edges_of_one_length(name, points, edges, rank):
    """An octahedron has 12, a square pyramid 8; two adjacent base corners and both apices 5, a square 4."""
    target_m = problems.layout(name, edge_m=0.1)
    assert target_m.shape == (points, 3)
    assert np.sum(np.isclose(distances(target_m), 0.1)) == 2 * edges
    assert np.linalg.matrix_rank(target_m - target_m.mean(axis=0), tol=1e-9) == rank


def test_two_opposite_corners_and_both_apices_would_be_flat():
    octahedron = problems.layout("bi6", edge_m=1.0)
    assert np.linalg.matrix_rank(octahedron[[0, 2, 4, 5]]) == 2


def test_poses_stand_where_they_should():
    target_m = problems.layout("bi6", edge_m=0.1)
    placed = problems.in_box(target_m, count=500, rng=generator())
    np.testing.assert_allclose(
        placed.rotation @ np.swapaxes(placed.rotation, 1, 2), np.tile(np.eye(3), (500, 1, 1)), atol=1e-12
    )
    assert np.all(placed.translation_m >= problems.BOX_M[0]) and np.all(placed.translation_m <= problems.BOX_M[1])
    np.testing.assert_allclose(placed.translation_m.mean(axis=0), problems.BOX_M.mean(axis=0), atol=0.06)
    near = problems.at_depth(target_m, depth_m=0.08, count=300, rng=generator(), nearest_m=0.02)
    depth_m = np.einsum("bj,bnj->bn", near.rotation[:, 2], near.points_m) + near.translation_m[:, 2, None]
    assert depth_m.min() >= 0.02
    assert np.abs(near.translation_m[:, :2]).max() <= 0.4 * 0.08
    tilted = problems.at_angle(problems.layout("pl4", edge_m=0.1), angle_deg=30, depth_m=0.5, count=9, rng=generator())
    np.testing.assert_allclose(tilted.rotation[:, 2, 2], np.cos(np.radians(30)))
    np.testing.assert_array_equal(tilted.translation_m, np.tile([0, 0, 0.5], (9, 1)))


def test_random_points_lie_in_the_box_of_the_camera():
    placed = problems.random_points(points=10, count=50, rng=generator())
    camera_m = placed.points_m @ np.swapaxes(placed.rotation, 1, 2) + placed.translation_m[:, None]
    assert camera_m.shape == (50, 10, 3)
    assert np.all(camera_m >= problems.BOX_M[0] - 1e-12) and np.all(camera_m <= problems.BOX_M[1] + 1e-12)


def test_noise_is_a_standard_deviation_in_pixels():
    """Not a variance: 2 px are 2 px. Monte Carlo of 24,000 values: 0.5 %, tolerance 2 %."""
    placed = problems.in_box(problems.layout("bi6", edge_m=0.1), count=2000, rng=generator())
    exact = problems.images(placed, focal_px=800, noise_px=0, rng=generator())
    noisy = problems.images(placed, focal_px=800, noise_px=2, rng=np.random.default_rng(1))
    assert 800 * np.std(noisy - exact) == pytest.approx(2, rel=0.02)


def test_euler_angles_are_of_the_corrected_matrix():
    """5.33 as printed lacks a term in two entries and is no rotation."""
    alpha, beta, theta = 0.4, 0.7, -0.3
    sa, ca, sb, cb, st, ct = (f(x) for x in (alpha, beta, theta) for f in (np.sin, np.cos))
    printed = np.array(
        [
            [-sa * cb * st + ca * ct, -sa * cb * ct, sa * sb],
            [ca * cb * st + sa * ct, ca * cb * ct, -ca * sb],
            [sb * st, sb * ct, cb],
        ]
    )
    corrected = printed.copy()
    corrected[0, 1] -= ca * st
    corrected[1, 1] -= sa * st
    np.testing.assert_allclose(problems.rotation_zxz([alpha, beta, theta]), corrected, atol=1e-14)
    assert np.abs(printed @ printed.T - np.eye(3)).max() > 0.05
    assert problems.random_euler_rotations(7, rng=generator()).shape == (7, 3, 3)


def test_seeds_repeat():
    target_m = problems.layout("py5", edge_m=0.1)
    first, second = (problems.in_box(target_m, count=3, rng=generator()) for _ in range(2))
    np.testing.assert_array_equal(first.translation_m, second.translation_m)


def test_refusals():
    with pytest.raises(ValueError, match="layout: got 'ring', allowed: bi6"):
        problems.layout("ring", edge_m=1)
    with pytest.raises(ValueError, match="edge_m is 0"):
        problems.layout("bi6", edge_m=0)
    with pytest.raises(ValueError, match="keep a point nearer than 1 m"):
        problems.at_depth(problems.layout("bi6", edge_m=0.1), depth_m=0.5, count=2, rng=generator(), nearest_m=1)
    behind = problems.Placed(np.zeros((1, 4, 3)), np.eye(3)[None], np.array([[0, 0, -1.0]]))
    with pytest.raises(ValueError, match="4 points behind the camera"):
        problems.images(behind, focal_px=1, noise_px=0, rng=generator())
