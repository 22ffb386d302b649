"""What noise in the image does to segments and poses: formulas against finite differences and Monte Carlo."""

import numpy as np
import pytest
from scipy.optimize import minimize_scalar
from scipy.spatial.transform import Rotation

from uwsim.camera.pinhole import project
from uwsim.metrics.pose import rotation_error_deg, translation_error_percent
from uwsim.pose import bound, error_model, plane_errors, problems
from uwsim.pose.error_model import Segments, segments
from uwsim.pose.geometry import transform
from uwsim.pose.levenberg import exponential, least_reprojection
from uwsim.pose.reprojection import cost_and_information

K = np.array([[1300.0, 0, 653], [0, 1300, 508], [0, 0, 1]])
SQUARE_K = np.array([[500.0, 0, 0], [0, 500, 0], [0, 0, 1]])
BEST_TILT_DEG = 54.7356


def some_segments(*, count=200, short=0.05, seed=0):
    rng = np.random.default_rng(seed)
    origin_m = np.column_stack([rng.uniform(-0.5, 0.5, (count, 2)), np.full(count, 1.0)])
    along_m = rng.standard_normal((count, 3))
    return Segments(origin_m, short * along_m / np.linalg.norm(along_m, axis=1, keepdims=True))


def on_axis(angle_rad, *, length_m=0.025, depth_m=0.5):
    angle_rad = np.atleast_1d(angle_rad)
    along = np.stack([np.sin(angle_rad), np.zeros_like(angle_rad), np.cos(angle_rad)], axis=-1)
    return Segments(np.tile([0, 0, depth_m], (len(angle_rad), 1)), length_m * along)


def seen_angle_and_length(ends, origins, found, *, solve_for):
    """Return the angle at a known length, or the length at a known direction, that images of both ends show."""
    depth_m = found.depth_m[:, None]
    if solve_for == "length":
        direction = found.along_m / found.length_m[:, None]
        base = direction[:, :2] - origins * direction[:, 2:]
        image = depth_m * (ends - origins)
        return np.sum(image * base, axis=1) / np.sum(base**2, axis=1)
    # along_xy = depth (end - origin) + origin along_z, |along| = length: a quadratic in along_z, the root nearest
    shift = depth_m * (ends - origins)
    a, b = 1 + np.sum(origins**2, axis=1), np.sum(shift * origins, axis=1)
    root = np.sqrt(np.maximum(b**2 - a * (np.sum(shift**2, axis=1) - found.length_m**2), 0))
    along_z = np.stack([(-b + root) / a, (-b - root) / a])
    nearest = np.argmin(np.abs(along_z - found.along_m[:, 2]), axis=0)
    along_z = along_z[nearest, np.arange(len(a))]
    return np.arccos(along_z / found.length_m)


def test_segment_images_are_those_of_paraperspective_5_25_and_5_26_is_an_identity():
    found = some_segments()
    error = []
    for share in (1, 0.5):
        part = Segments(found.origin_m, share * found.along_m)
        exact = (part.origin_m + part.along_m)[:, :2] / (part.origin_m + part.along_m)[:, 2:]
        error.append(np.sqrt(np.mean((part.origin + part.image - exact) ** 2)))
    assert error[0] / error[1] == pytest.approx(4, rel=0.05)  # second order in the segment
    z, along = found.depth_m, found.along_m[:, 2]
    square = z**2 * np.sum(found.image**2, axis=1) + np.sum(found.origin**2, axis=1) * along**2
    mixed = 2 * np.sum(found.image * found.origin, axis=1) * z * along
    across = (found.length_m * np.sin(found.angle_rad)) ** 2
    np.testing.assert_allclose(square + mixed, across, atol=1e-15)
    assert np.abs(square - across).max() > 1e-4  # control: without the mixed term it is none


@pytest.mark.parametrize("what", ["angle", "length"])
def test_rates_are_the_derivatives_by_both_images(what):
    found = some_segments()
    ends, step = found.origin + found.image, 1e-7
    gradients = []
    for which in range(2):
        by_axis = []
        for axis in range(2):
            moved = [[ends, found.origin], [ends, found.origin]]
            for side, sign in zip(moved, (1, -1), strict=True):
                side[which] = side[which] + sign * step * np.eye(2)[axis]
            values = [seen_angle_and_length(*side, found, solve_for=what) for side in moved]
            by_axis.append((values[0] - values[1]) / (2 * step))
        gradients.append(np.hypot(*by_axis))
    rate, printed = error_model.rates(found), error_model.rates(found, form="as_printed")
    unit = "_rad" if what == "angle" else "_m"
    # not where the angle is open, for a segment across the line of sight
    kept = rate.angle_by_image_rad < 500
    assert kept.mean() > 0.9
    for name, numeric in zip(("image", "origin"), gradients, strict=True):
        found_rate = getattr(rate, f"{what}_by_{name}{unit}")
        np.testing.assert_allclose(found_rate[kept], numeric[kept], rtol=1e-4)
        far_off = np.abs(getattr(printed, f"{what}_by_{name}{unit}") / numeric - 1)[kept]
        assert np.median(far_off) > 0.05  # control: the printed rates are not


def test_printed_and_corrected_numbers_at_the_angle_of_the_text():
    """20 = depth by length. Finite difference of the exact relation m = d sin b / z."""
    angle = np.radians(BEST_TILT_DEG)
    found = on_axis(angle)
    step = 1e-6
    image = [on_axis(angle + side).image[0, 0] for side in (step, -step)]
    assert 2 * step / (image[0] - image[1]) == pytest.approx(34.64, abs=5e-3)
    assert error_model.rates(found).angle_by_image_rad[0] == pytest.approx(34.64, abs=5e-3)
    assert error_model.rates(found, form="as_printed").angle_by_image_rad[0] == pytest.approx(26.32, abs=5e-3)
    length = [error_model.rates(found, form=form).length_by_image_m[0] for form in ("corrected", "as_printed")]
    assert length[0] == pytest.approx(length[1], rel=1e-12)  # 5.28, first line, is right on the axis
    assert error_model.rates(found).length_by_angle_m[0] == pytest.approx(0.025 / np.tan(angle), rel=1e-12)


def test_the_angle_of_least_error_belongs_to_the_misprinted_function():
    least = minimize_scalar(
        lambda angle: error_model.angle_factor(angle, form="as_printed"), bounds=(0.1, 1.5), method="bounded",
        options={"xatol": 1e-9},
    )  # fmt: skip
    assert np.degrees(least.x) == pytest.approx(BEST_TILT_DEG, abs=1e-4)
    assert least.fun == pytest.approx(1.611855, abs=1e-6)
    angles = np.radians(np.linspace(1, 89, 100))
    assert np.all(np.diff(error_model.angle_factor(angles)) > 0)
    np.testing.assert_allclose(
        error_model.rates(on_axis(angles)).angle_by_image_rad, 20 * error_model.angle_factor(angles), rtol=1e-12
    )


def test_the_origins_image_counts_as_much_as_the_far_ends():
    """Against the text after 5.28 and 5.29: z' / z, near 1 for short segments, whatever the way off the axis."""
    rate = error_model.rates(some_segments(short=0.01))
    np.testing.assert_allclose(rate.angle_by_origin_rad / rate.angle_by_image_rad, 1, atol=0.011)
    printed = error_model.rates(some_segments(short=0.01), form="as_printed")
    assert np.median(printed.angle_by_origin_rad / printed.angle_by_image_rad) < 0.01


def test_errors_and_weights_are_those_of_noisy_images():
    noise, count = 2e-5, 4000
    found = some_segments(count=20, short=0.1, seed=3)
    rng = np.random.default_rng(4)
    many = Segments(*(np.repeat(part, count, axis=0) for part in found))
    ends = many.origin + many.image + noise * rng.standard_normal((len(many.origin_m), 2))
    origins = many.origin + noise * rng.standard_normal(ends.shape)
    angle, length_m = (seen_angle_and_length(ends, origins, many, solve_for=what) for what in ("angle", "length"))
    length_error_m, angle_error = error_model.errors(found, noise=noise)
    linear = angle_error < 0.004
    assert linear.sum() > 12
    scatter = 3.5 / np.sqrt(2 * count)
    np.testing.assert_allclose(angle.reshape(20, -1).std(axis=1)[linear], angle_error[linear], rtol=scatter)
    seen = length_error_m < 0.02 * found.length_m
    assert seen.sum() > 12
    np.testing.assert_allclose(length_m.reshape(20, -1).std(axis=1)[seen], length_error_m[seen], rtol=scatter)
    variance = (length_m**2).reshape(20, -1).var(axis=1)[seen] / noise**2
    np.testing.assert_allclose(variance * error_model.weights(found)[seen], 1, rtol=2 * scatter)
    printed = error_model.weights(found, form="as_printed")[seen] * variance
    assert printed.max() / printed.min() > 3  # control: the printed weights are no inverse variances


def test_misuse_of_the_error_model_is_refused():
    with pytest.raises(ValueError, match="form is 'exact', allowed: corrected, as_printed"):
        error_model.rates(some_segments(), form="exact")
    with pytest.raises(ValueError, match="noise is -1"):
        error_model.errors(some_segments(), noise=-1)
    with pytest.raises(ValueError, match="point in the target's origin"):
        segments(np.zeros((1, 3)), np.eye(3), np.array([0, 0, 1.0]))
    with pytest.raises(ValueError, match="origin at z"):
        segments(np.ones((1, 3)), np.eye(3), np.array([0, 0, -1.0]))
    with pytest.raises(ValueError, match="arm_m is 0"):
        plane_errors.angle_errors(tilt_rad=0, distance_m=1, arm_m=0, noise_px=1, focal_px=1)


def square_bound(tilts_deg, *, edge_m=0.025):
    rotation = Rotation.from_euler("y", np.asarray(tilts_deg, float)[:, None], degrees=True).as_matrix()
    target_m = problems.layout("pl4", edge_m=edge_m)
    place_m = np.tile([0, 0, 0.5], (len(rotation), 1))
    return bound.bound(target_m, rotation, place_m, K=SQUARE_K, noise_px=0.447)


def test_bound_of_a_tilted_square_goes_by_one_over_sine_not_by_cosine():
    tilts_deg = np.array([10, 15, 30, 45, BEST_TILT_DEG, 70, 80, 88])
    found_deg = square_bound(tilts_deg).rotation_deg
    np.testing.assert_allclose(found_deg, [11.5, 7.8, 3.96, 2.71, 2.29, 1.92, 1.81, 1.77], rtol=5e-3)
    sine = np.sin(np.radians(tilts_deg))
    np.testing.assert_allclose(found_deg * sine, 1.9, rtol=0.08)
    assert np.all(np.diff(found_deg) < 0)
    assert square_bound([0]).rotation_deg[0] == pytest.approx(58, abs=0.1)


@pytest.mark.parametrize(("edge_m", "tolerance"), [(0.025, 2e-3), (0.1, 0.02)])
def test_corrected_angle_errors_of_a_plane_are_the_bound(edge_m, tolerance):
    tilts_deg = np.array([0, 1, 3, 7, 15, 30, 60, 89.0])
    given = {"tilt_rad": np.radians(tilts_deg), "distance_m": 0.5, "arm_m": edge_m / 2}
    given |= {"noise_px": 0.447, "focal_px": 500.0}
    least = square_bound(tilts_deg, edge_m=edge_m)
    corrected = plane_errors.angle_errors(**given)
    np.testing.assert_allclose(np.degrees(corrected.rotation_rad), least.rotation_deg, rtol=tolerance)
    deviation = np.sqrt(np.diagonal(least.covariance, axis1=1, axis2=2))
    angles = np.stack([corrected.across_rad, corrected.tilt_rad, corrected.azimuth_rad], axis=1)
    np.testing.assert_allclose(angles, deviation[:, :3], rtol=2.5 * tolerance)
    printed = plane_errors.angle_errors(**given, form="as_printed")
    assert printed.tilt_rad[0] == pytest.approx(deviation[0, 1], rel=tolerance)  # right at 0 deg alone
    assert printed.azimuth_rad[0] == pytest.approx(np.sqrt(2) * deviation[0, 2], rel=tolerance)
    by_bound = printed.tilt_rad / deviation[:, 1]
    assert by_bound.max() > 1.5 and by_bound[-1] < 0.8


SQUARE = problems.layout("pl4", edge_m=0.1)
NO_SQUARES = {
    "rectangle": SQUARE * [1.02, 1, 1],
    "rhombus": SQUARE @ np.array([[1, 0.02, 0], [0.02, 1, 0], [0, 0, 1]]),
    "kite": SQUARE + np.array([[0.002, 0.002, 0], [0, 0, 0], [0, 0, 0], [0, 0, 0]]),
    "four points of one square distance, folded": np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0.5, 0.5, np.sqrt(0.5)]]),
    "square with its centre": np.concatenate([SQUARE, [[0, 0, 0]]]),
    "three of a square": SQUARE[:3],
    "triangle with its centre": np.array([[2, 0, 0], [-1, 3**0.5, 0], [-1, -(3**0.5), 0], [0, 0, 0]]) / 40,
    "not flat": SQUARE + np.array([[0, 0, 1e-4], [0, 0, -1e-4], [0, 0, 1e-4], [0, 0, -1e-4]]),
    "octahedron": problems.layout("bi6", edge_m=0.1),
    "stereo": problems.layout("st4", edge_m=0.1),
}


@pytest.mark.parametrize("name", list(NO_SQUARES))
def test_what_is_no_square_is_none(name):
    turn = problems.random_rotations(1, rng=np.random.default_rng(0))[0]
    assert plane_errors.square_of(NO_SQUARES[name] @ turn.T + [0.1, -0.2, 0.3]) is None


def test_a_square_is_found_in_any_axes_and_its_errors_are_those_of_the_plain_one_on_the_axis():
    rng = np.random.default_rng(1)
    tilts = np.radians([0, 3, 30, 60, 90])
    for turn in problems.random_rotations(5, rng=rng):
        shift_m = rng.uniform(-1, 1, 3)
        found = plane_errors.square_of(rng.permutation(SQUARE @ turn.T + shift_m))
        np.testing.assert_allclose(found.centre_m, shift_m, atol=1e-12)
        assert abs(found.normal @ turn[:, 2]) == pytest.approx(1, abs=1e-12)
        assert found.arm_m == pytest.approx(0.05, rel=1e-12)
        rotation = Rotation.from_euler("y", tilts[:, None]).as_matrix() @ turn.T
        place_m = np.array([0, 0, 1.0]) - rotation @ shift_m
        for form in ("corrected", "as_printed"):
            given = {"noise_px": 0.3, "focal_px": 1300.0, "form": form}
            plain = plane_errors.angle_errors(tilt_rad=tilts, distance_m=1.0, arm_m=0.05, **given)
            angles = plane_errors.square_errors(found, rotation, place_m, **given)
            # 90 deg as printed: cosine of a rounded right angle
            np.testing.assert_allclose(np.stack(angles), np.stack(plain), rtol=1e-9, atol=1e-12)


def test_squares_measured_to_half_a_percent_keep_the_formula():
    """Model tolerance 2 %, as for exact ones; the points rounded to 1 um, and 0.2 % off in their plane."""
    rng = np.random.default_rng(2)
    rotation = problems.random_rotations(50, rng=rng)
    place_m = np.tile([0, 0, 1.0], (50, 1))
    for points_m in (SQUARE, np.round(SQUARE @ rotation[0].T, 6), SQUARE * [1.002, 0.999, 1]):
        found = plane_errors.square_of(points_m)
        angles = plane_errors.square_errors(found, rotation, place_m, noise_px=0.3, focal_px=1300)
        least = bound.bound(points_m, rotation, place_m, K=K, noise_px=0.3)
        np.testing.assert_allclose(np.degrees(angles.rotation_rad), least.rotation_deg, rtol=0.02)


@pytest.mark.parametrize(("off_axis_deg", "tolerance"), [(27, 0.02), (63, 0.17)])
def test_corrected_errors_of_a_square_off_the_axis_are_the_bound(off_axis_deg, tolerance):
    """Root mean square over orientations. Control: of noise and depth as on the axis they are not."""
    rng = np.random.default_rng(3)
    rotation = problems.random_rotations(400, rng=rng)
    place_m = np.tile([np.tan(np.radians(off_axis_deg)), 0, 1.0], (400, 1))
    found = plane_errors.square_of(SQUARE)
    given = {"noise_px": 0.3, "focal_px": 1300.0}
    least_rad = np.radians(bound.bound(SQUARE, rotation, place_m, K=K, noise_px=0.3).rotation_deg)
    for tilts in ((0, 20), (20, 50), (50, 90)):
        sight = place_m[0] / np.linalg.norm(place_m[0])
        tilt_deg = np.degrees(np.arccos(np.abs(rotation[:, :, 2] @ sight)))
        chosen = (tilt_deg >= tilts[0]) & (tilt_deg < tilts[1])
        assert chosen.sum() > 15
        angles = plane_errors.square_errors(found, rotation[chosen], place_m[chosen], **given)
        rms = [np.sqrt(np.mean(part**2)) for part in (angles.rotation_rad, least_rad[chosen])]
        assert rms[0] == pytest.approx(rms[1], rel=tolerance)
        plain = plane_errors.angle_errors(
            tilt_rad=np.radians(tilt_deg[chosen]), distance_m=np.linalg.norm(place_m[0]), arm_m=found.arm_m, **given
        )
        assert np.sqrt(np.mean(plain.rotation_rad**2)) > (1 + 3 * tolerance) * rms[1]


def test_slope_is_the_derivative_of_the_projection_and_agrees_with_the_solvers():
    rng = np.random.default_rng(5)
    skewed = np.array([[1300.0, 3, 653], [0, 1250, 508], [0, 0, 1]])
    placed = problems.in_box(problems.layout("bi6", edge_m=0.1), count=5, rng=rng)
    slope = bound.image_slope(placed.points_m, placed.rotation, placed.translation_m, K=skewed)
    for unknown in range(6):
        step = 1e-6 * np.eye(6)[unknown]
        sides = []
        for sign in (1, -1):
            turn = exponential(sign * step[:3, None])[..., 0]
            camera_m = transform(turn @ placed.rotation, placed.translation_m + sign * step[3:], placed.points_m)
            sides.append(project(camera_m, skewed))
        numeric = (sides[0] - sides[1]) / 2e-6
        np.testing.assert_allclose(slope[..., unknown], numeric, rtol=1e-6, atol=1e-4)
    least = bound.bound(placed.points_m, placed.rotation, placed.translation_m, K=K, noise_px=0.5)
    exact = problems.images(placed, focal_px=1300, noise_px=0, rng=rng)
    _, information = cost_and_information(placed.rotation, placed.translation_m, placed.points_m, exact)
    np.testing.assert_allclose(np.linalg.inv(least.covariance) * 0.5**2 / 1300**2, information, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("name", ["bi6", "py5"])
def test_least_squares_from_the_truth_reaches_the_bound(name):
    """Root mean square over 3000 noisy images of one pose. Control: half the noise does not."""
    count, noise_px = 3000, 0.5
    rng = np.random.default_rng(6)
    one = problems.in_box(problems.layout(name, edge_m=0.1), count=1, rng=rng)
    placed = problems.Placed(*(np.repeat(part, count, axis=0) for part in one))
    seen = problems.images(placed, focal_px=1300, noise_px=noise_px, rng=rng)
    rotation, translation_m, _ = least_reprojection(placed.rotation, placed.translation_m, placed.points_m, seen)
    turned = np.sqrt(np.mean(rotation_error_deg(rotation, placed.rotation) ** 2))
    moved = np.sqrt(np.mean(translation_error_percent(translation_m, placed.translation_m) ** 2))
    least = bound.bound(one.points_m, one.rotation, one.translation_m, K=K, noise_px=noise_px)
    assert turned == pytest.approx(least.rotation_deg[0], rel=0.05)
    assert moved == pytest.approx(least.translation_percent[0], rel=0.05)
    half = bound.bound(one.points_m, one.rotation, one.translation_m, K=K, noise_px=noise_px / 2)
    assert turned / half.rotation_deg[0] > 1.9


def test_covariances_of_points_in_place_of_one_noise():
    placed = problems.in_box(problems.layout("bi6", edge_m=0.1), count=3, rng=np.random.default_rng(7))
    pose = placed.rotation, placed.translation_m
    one = bound.bound(placed.points_m[0], *pose, K=K, noise_px=0.5)
    same = bound.bound(placed.points_m, *pose, K=K, noise_px=np.tile(0.25 * np.eye(2), (6, 1, 1)))
    np.testing.assert_allclose(same.covariance, one.covariance, rtol=1e-9, atol=1e-20)
    # a point without information is as good as none
    blind = np.tile(0.25 * np.eye(2), (6, 1, 1))
    blind[5] *= 1e12
    without = bound.bound(placed.points_m[:, :5], *pose, K=K, noise_px=0.5)
    few = bound.bound(placed.points_m, *pose, K=K, noise_px=blind)
    np.testing.assert_allclose(few.rotation_deg, without.rotation_deg, rtol=1e-6)
    assert np.all(few.rotation_deg > 1.01 * one.rotation_deg)


def test_points_on_a_line_leave_the_pose_open():
    line_m = np.linspace(-0.1, 0.1, 5)[:, None] * [1.0, 0.3, 0]
    found = bound.bound(line_m, np.eye(3)[None], np.array([[0, 0, 1.0]]), K=K, noise_px=0.5)
    assert np.all(np.isinf(found.rotation_deg)) and np.all(np.isinf(found.translation_percent))


def test_misuse_of_the_bound_is_refused():
    good = {"K": K, "noise_px": 0.5}
    target_m, turn, place_m = problems.layout("bi6", edge_m=0.1), np.eye(3)[None], np.array([[0, 0, 1.0]])
    with pytest.raises(ValueError, match="noise_px is 0"):
        bound.bound(target_m, turn, place_m, K=K, noise_px=0.0)
    with pytest.raises(ValueError, match="behind the camera"):
        bound.bound(target_m, turn, -place_m, **good)
    with pytest.raises(ValueError, match="allowed: 3 x 3"):
        bound.bound(target_m, turn, place_m, K=np.eye(2), noise_px=0.5)
    with pytest.raises(ValueError, match="poses"):
        bound.bound(target_m, turn, place_m[0][None, None], **good)
    with pytest.raises(ValueError, match="not positive definite"):
        bound.bound(target_m, turn, place_m, K=K, noise_px=-np.tile(np.eye(2), (6, 1, 1)))
    with pytest.raises(ValueError, match="of shape"):
        bound.bound(target_m, turn, place_m, K=K, noise_px=np.ones(3))
