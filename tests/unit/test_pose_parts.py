"""What the pose solvers share: derivatives, roots, minimisation, chosen candidates."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from uwsim.pose import batches, control_points, levenberg, polynomials
from uwsim.pose.affine_printed import mean_depth
from uwsim.pose.object_space import form_of, translation_of
from uwsim.pose.opencv import opencv_core
from uwsim.pose.reprojection import batch_last, cost_and_information, cost_of, errors


def generator():
    return np.random.default_rng(0)


def some_problems(count=5, points=7):
    rng = generator()
    target = rng.standard_normal((count, points, 3))
    target -= target.mean(axis=1, keepdims=True)
    rotation = Rotation.from_quat(rng.standard_normal((count, 4))).as_matrix()
    translation = np.column_stack([rng.uniform(-1, 1, (count, 2)), rng.uniform(5, 7, count)])
    camera = target @ np.swapaxes(rotation, 1, 2) + translation[:, None]
    image = camera[..., :2] / camera[..., 2:] + 0.01 * rng.standard_normal((count, points, 2))
    return rotation, translation, target, image


def test_gradient_and_information_are_derivatives():
    """Central differences of the cost: 1e-6. The gradient is half that of the sum of squares."""
    rotation, translation, target, image = some_problems()
    given = [batch_last(part) for part in (rotation, translation)]
    seen = [batch_last(np.swapaxes(part, 1, 2)) for part in (target, image)]
    found = errors(*given, *seen, translation[:, 2])

    def cost(step):
        turned = Rotation.from_rotvec(step[:3]).as_matrix() @ rotation
        return cost_of(turned, translation + translation[:, 2:] * step[3:], target, image)

    for unknown in range(6):
        step = np.zeros(6)
        step[unknown] = 1e-5
        slope = (cost(step) - cost(-step)) / 2e-5
        np.testing.assert_allclose(2 * found.gradient[unknown], slope, rtol=1e-5, atol=1e-8)
    np.testing.assert_allclose(found.cost, cost(np.zeros(6)), rtol=1e-12)
    # exact images: second derivatives are those of Gauss-Newton
    camera = target @ np.swapaxes(rotation, 1, 2) + translation[:, None]
    image[:] = camera[..., :2] / camera[..., 2:]
    _, information = cost_and_information(rotation, translation, target, image)
    step = np.array([1e-4, 0, 0, 0, 0, 0])
    np.testing.assert_allclose(cost(step) / 1e-8, information[:, 0, 0], rtol=1e-2)


def test_points_behind_the_camera_cost_without_end():
    rotation, translation, target, image = some_problems()
    translation[1, 2] = 0.1
    assert np.isinf(cost_of(rotation, translation, target, image)).tolist() == [False, True, False, False, False]
    translation[1] = np.nan
    assert np.isinf(cost_of(rotation, translation, target, image))[1]


def test_exponential_is_that_of_rotation_vectors():
    turns = np.concatenate([generator().standard_normal((6, 3)), np.zeros((1, 3)), [[1e-9, 0, 0]]])
    expected = Rotation.from_rotvec(turns).as_matrix()
    np.testing.assert_allclose(np.moveaxis(levenberg.exponential(turns.T), -1, 0), expected, atol=1e-14)


def test_problems_stop_on_their_own():
    """A start with a point behind the camera stays as it is, its neighbours are solved."""
    rotation, translation, target, image = some_problems()
    moved = translation + [0.1, 0.1, 0.5]
    moved[2, 2] = -3
    _, found, cost = levenberg.least_reprojection(rotation, moved, target, image)
    np.testing.assert_array_equal(found[2], moved[2])
    assert np.isinf(cost).tolist() == [False, False, True, False, False]
    others = [0, 1, 3, 4]
    assert np.all(cost[others] <= cost_of(rotation, translation, target, image)[others])


class TestPolynomials:
    def test_roots_are_those_of_numpy(self):
        coefficients = generator().standard_normal((20, 8))
        found = np.sort_complex(polynomials.roots(coefficients))
        for one, row in zip(found, coefficients, strict=True):
            np.testing.assert_allclose(one, np.sort_complex(np.roots(row[::-1])), atol=1e-8)

    def test_a_vanishing_leading_coefficient_leaves_the_other_roots(self):
        found = polynomials.roots(np.array([[2.0, -3, 1, 0]]))[0]
        assert np.allclose(np.sort(found.real)[:2], [1, 2]) or np.allclose(np.sort(found.real)[1:], [1, 2])
        assert np.all(np.isnan(polynomials.roots(np.zeros((1, 4)))))

    def test_product_derivative_and_value(self):
        first, second = np.array([[1.0, 2, 3]]), np.array([[4.0, 5]])
        np.testing.assert_allclose(polynomials.multiplied(first, second), [[4, 13, 22, 15]])
        np.testing.assert_allclose(polynomials.derivative(first), [[2, 6]])
        np.testing.assert_allclose(polynomials.value(first, np.array([[0.0, 2]])), [[1, 17]])


def test_object_space_form_is_the_sum_of_distances():
    """r^T Omega r against the sum over points at the best shift. Control: at another shift it is more."""
    rotation, _, target, image = some_problems()
    form = form_of(batches.Centred(target, image, np.zeros((5, 3)), False))
    shift = translation_of(form, rotation)
    sight = np.concatenate([image, np.ones((5, 7, 1))], axis=2)
    sight /= np.linalg.norm(sight, axis=2, keepdims=True)

    def total(place):
        camera = target @ np.swapaxes(rotation, 1, 2) + place[:, None]
        return ((camera - (camera * sight).sum(axis=2, keepdims=True) * sight) ** 2).sum(axis=(1, 2))

    entries = rotation.reshape(5, 9)
    np.testing.assert_allclose(np.einsum("bi,bij,bj->b", entries, form.omega, entries), total(shift), rtol=1e-9)
    assert np.all(total(shift + [0.01, 0, 0]) > total(shift))


@pytest.mark.parametrize("flat", [False, True])
def test_points_are_weighted_means_of_control_points(flat):
    _, _, target, image = some_problems()
    if flat:
        target = target * [1, 1, 0]
        # their own axes, as a core gets them
        axes = np.linalg.eigh(np.swapaxes(target, 1, 2) @ target)[1][..., ::-1]
        target = target @ axes
    controls = control_points.control_points(batches.Centred(target, image, np.zeros((5, 3)), flat))
    assert controls.points.shape[1] == (3 if flat else 4)
    np.testing.assert_allclose(controls.weights @ controls.points, target, atol=1e-12)
    np.testing.assert_allclose(controls.weights.sum(axis=2), 1)


def test_the_image_is_in_the_null_space():
    """M x = 0 for exact images; 1 dimension for 7 points, and for 4 as many as control points."""
    rotation, translation, target, _ = some_problems()
    camera = target @ np.swapaxes(rotation, 1, 2) + translation[:, None]
    for points, dimensions in ((7, 1), (5, 2), (4, 4)):
        kept, seen = target[:, :points], camera[:, :points, :2] / camera[:, :points, 2:]
        kept = kept - kept.mean(axis=1, keepdims=True)
        centred = batches.Centred(kept, seen, np.zeros((5, 3)), False)
        controls = control_points.control_points(centred)
        values = control_points.eigenvectors(controls.weights, seen)[0]
        assert np.all(np.sum(values < 1e-12 * values[:, -1:], axis=1) == dimensions)


def test_of_candidates_the_least_and_the_next_different_one():
    rotation = np.stack([np.eye(3), np.eye(3), np.diag([1.0, -1, -1])])[:, None]
    candidates = batches.Poses(rotation, np.arange(9.0).reshape(3, 1, 3))
    found = batches.least_of(candidates, np.array([[2.0], [1.0], [5.0]]), flat=True)
    np.testing.assert_array_equal(found.translation, [[3, 4, 5]])
    np.testing.assert_array_equal(found.twin_translation, [[6, 7, 8]])
    assert batches.least_of(candidates, np.array([[2.0], [1.0], [5.0]]), flat=False).twin_rotation is None
    assert np.all(np.isnan(batches.least_of(candidates, np.full((3, 1), np.inf), flat=True).rotation))


def test_printed_mean_depth_uses_one_row_twice():
    first, second = np.array([[0.5, 0, 0]]), np.array([[0, 0.25, 0]])
    assert mean_depth(first, second, np.zeros((1, 2)))[0] == pytest.approx(3)
    assert mean_depth(first, second, np.zeros((1, 2)), misprint=True)[0] == pytest.approx(2)


def test_flags_of_opencv_go_by_name():
    """SOLVEPNP_DLS and SOLVEPNP_UPNP are gone in OpenCV 5, in OpenCV 4 they are EPnP under another name."""
    with pytest.raises(ValueError, match="got SOLVEPNP_NEVER, allowed: .*SOLVEPNP_SQPNP"):
        opencv_core("SOLVEPNP_NEVER")
