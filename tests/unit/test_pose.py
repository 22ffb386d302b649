"""Projection, marker corners and pose solvers on exact synthetic data. Pixel centres at integer + 0.5."""

import numpy as np
import pytest
from scipy import ndimage
from scipy.spatial.transform import Rotation

from uwsim.camera.dome_port import DomePort
from uwsim.camera.flat_port import FlatPort
from uwsim.camera.lens import Lens
from uwsim.images import linear_from_srgb_uint8, srgb_uint8_from_linear
from uwsim.metrics.pose import corner_error_px, rotation_error_deg, translation_error_percent
from uwsim.pose import edges
from uwsim.pose.detect import detect_markers, marker_covariances
from uwsim.pose.edges import refine_corners
from uwsim.pose.geometry import normalise, project, transform
from uwsim.pose.refine import refine
from uwsim.pose.solution import accept
from uwsim.pose.solvers import frontal, opencv_sqpnp, oracle_corners

K = np.array([[400.0, 0, 160], [0, 410.0, 120], [0, 0, 1]])
FACING = np.diag([1.0, -1.0, -1.0])
SQUARE_M = np.array([[-1, 1, 0], [1, 1, 0], [1, -1, 0], [-1, -1, 0]]) * 0.05
OCTAHEDRON_M = np.concatenate([np.eye(3), -np.eye(3)]) * 0.07
CUBE_M = np.stack(np.meshgrid([-1, 1], [-1, 1], [-1, 1]), axis=-1).reshape(8, 3) * 0.1


def poses(count, *, tilt_deg=40.0, distance_m=1.0, seed=0):
    """Return random (rotation, translation_m) of a target that shows its front, +-20 deg off the axis."""
    rng = np.random.default_rng(seed)
    turn = Rotation.from_rotvec(rng.uniform(-1, 1, (count, 3)) * np.radians(tilt_deg) / np.sqrt(3)).as_matrix()
    side = rng.uniform(-0.35, 0.35, (count, 2)) * distance_m
    return FACING @ turn, np.column_stack([side, np.full(count, distance_m)])


def problem(target_m, count=20, **options):
    rotation, translation_m = poses(count, **options)
    points_m = np.tile(target_m, (count, 1, 1))
    camera_m = transform(rotation, translation_m, points_m)
    return rotation, translation_m, points_m, camera_m[..., :2] / camera_m[..., 2:]


class TestGeometry:
    def test_projection_of_known_points(self):
        np.testing.assert_allclose(project(np.array([[0.0, 0, 2], [0.5, -0.5, 2]]), K), [[160, 120], [260, 17.5]])
        assert np.all(np.isnan(project(np.array([[0.1, 0.1, -1.0]]), K)))

    def test_normalise_undoes_projection(self):
        points_m = np.random.default_rng(0).uniform([-1, -1, 1], [1, 1, 3], (5, 7, 3))
        expected = points_m[..., :2] / points_m[..., 2:]
        np.testing.assert_allclose(normalise(project(points_m, K), K), expected, atol=1e-13)

    def test_transform_of_a_batch(self):
        rotation, translation_m = poses(3)
        points_m = np.random.default_rng(1).random((3, 5, 3))
        expected = [[r @ p + t for p in ps] for r, t, ps in zip(rotation, translation_m, points_m, strict=True)]
        np.testing.assert_allclose(transform(rotation, translation_m, points_m), expected)


def picture_of_markers(dictionary, ids, *, size_px, roll_deg=0.0, tilt_deg=0.0, noise=0.0, supersampling=6):
    """Return (uint8 sRGB picture, {id: true corners px}) of two markers; pixels average over their area."""
    import cv2

    kind = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, dictionary))
    side = kind.markerSize + 2
    turn = Rotation.from_euler("zx", [roll_deg, tilt_deg], degrees=True).as_matrix()
    # a plane of unit markers, x right, y down, 1.4 apart; its centre lies off the pixel grid
    shift = np.array([0.013, -0.007, 1.0]) * 400 / size_px - turn @ [1.2, 0.5, 0]
    image_from_plane = K @ np.column_stack([turn[:, 0], turn[:, 1], shift])
    height, width = 240 * supersampling, 320 * supersampling
    row, column = (np.mgrid[:height, :width] + 0.5) / supersampling
    plane = np.stack([column, row, np.ones_like(row)], axis=-1) @ np.linalg.inv(image_from_plane).T
    x, y = plane[..., 0] / plane[..., 2], plane[..., 1] / plane[..., 2]
    picture = np.full(x.shape, 0.7)
    for index, identity in enumerate(ids):
        modules = cv2.aruco.generateImageMarker(kind, identity, side) > 127
        inside = (x >= 1.4 * index) & (x < 1.4 * index + 1) & (y >= 0) & (y < 1)
        cell = np.floor(np.stack([y[inside], x[inside] - 1.4 * index]) * side).astype(int).clip(0, side - 1)
        picture[inside] = np.where(modules[cell[0], cell[1]], 0.7, 0.03)
    picture = picture.reshape(240, supersampling, 320, supersampling).mean(axis=(1, 3))
    picture = cv2.GaussianBlur(picture, (0, 0), 0.6)
    picture = picture + noise * np.random.default_rng(0).standard_normal(picture.shape)
    corners = {}
    for index, identity in enumerate(ids):
        square = np.array([[0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1.0]]) + [1.4 * index, 0, 0]
        seen = square @ image_from_plane.T
        corners[identity] = seen[:, :2] / seen[:, 2:]
    return np.repeat(srgb_uint8_from_linear(picture)[..., None], 3, axis=2), corners


class TestDetect:
    @pytest.mark.parametrize("dictionary", ["DICT_4X4_50", "DICT_APRILTAG_36h11", "DICT_APRILTAG_16h5"])
    @pytest.mark.parametrize("roll_deg, tilt_deg", [(0, 0), (17, 25), (-40, -35), (200, 45)])
    def test_corners_are_where_they_are(self, dictionary, roll_deg, tilt_deg):
        """Model tolerance 0.1 px. Controls: OpenCV's pixel centres (half a pixel off), next corner."""
        image, true = picture_of_markers(dictionary, (3, 7), size_px=60, roll_deg=roll_deg, tilt_deg=tilt_deg)
        found = detect_markers(image, dictionary)
        assert sorted(found) == [3, 7]
        for identity, corners in true.items():
            assert corner_error_px(found[identity], corners).max() < 0.1
            assert corner_error_px(found[identity] - 0.5, corners).min() > 0.5
            assert corner_error_px(np.roll(found[identity], 1, axis=0), corners).min() > 10

    def test_noise(self):
        image, true = picture_of_markers("DICT_4X4_50", (3, 7), size_px=40, roll_deg=17, noise=0.01)
        found = detect_markers(image, "DICT_4X4_50")
        assert max(corner_error_px(found[identity], true[identity]).max() for identity in true) < 0.2

    @pytest.mark.parametrize("smooth_px", [0.0, 0.8])
    def test_corners_are_as_sure_as_the_edges_say(self, smooth_px, monkeypatch):
        """Setup: 12 pictures of two markers, noise independent or smoothed. Expected: squared errors in units of the
        variances from the edges' scatter have the mean 2; 96 corners and what interpolation adds: 1.5 to 4. Negative
        control: smooth noise taken for independent gives more than twice as much."""
        quiet, true = picture_of_markers("DICT_4X4_50", (3, 7), size_px=40, roll_deg=17)
        clean = linear_from_srgb_uint8(quiet)[..., 0].astype(float)

        def mean_square():
            squares = []
            for seed in range(12):
                noise = np.random.default_rng(seed).standard_normal(clean.shape)
                noise = ndimage.gaussian_filter(noise, smooth_px) if smooth_px else noise
                noisy = np.clip(clean + 0.02 * noise / noise.std(), 0, 1)
                image = np.repeat(srgb_uint8_from_linear(noisy)[..., None], 3, axis=2)
                found = detect_markers(image, "DICT_4X4_50")
                covariances = marker_covariances(image, "DICT_4X4_50", found)
                for identity, corners in found.items():
                    off, inverse = corners - true[identity], np.linalg.inv(covariances[identity])
                    squares.append(edges.CORNERS_OVER_MODEL_STD**2 * np.einsum("ni,nij,nj->n", off, inverse, off))
            assert len(squares) == 24
            return np.mean(squares)

        stated = mean_square()
        assert 1.5 < stated < 4
        monkeypatch.setattr(edges, "_correlated_places", lambda residuals: 2.0)
        assert (mean_square() > 2 * stated) == (smooth_px > 0)

    def test_lines_are_better_than_what_opencv_returns(self, monkeypatch):
        """The reason for the refinement: without it the corners are off by more than 0.1 px."""
        image, true = picture_of_markers("DICT_4X4_50", (3, 7), size_px=60, roll_deg=17, tilt_deg=25)
        monkeypatch.setattr("uwsim.pose.detect.refine_corners", lambda grey, corners, modules: corners)
        found = detect_markers(image, "DICT_4X4_50")
        errors_px = [corner_error_px(found[identity], true[identity]) for identity in true]
        assert np.max(errors_px) > 0.1
        # the conversion of the pixel centres leaves no common shift behind
        shift_px = np.mean([found[identity] - true[identity] for identity in true], axis=(0, 1))
        assert np.abs(shift_px).max() < 0.1

    def test_an_ambiguous_id_is_left_out(self):
        image, _ = picture_of_markers("DICT_4X4_50", (3, 3), size_px=60)
        assert detect_markers(image, "DICT_4X4_50") == {}
        other, _ = picture_of_markers("DICT_4X4_50", (3, 4), size_px=60)
        assert sorted(detect_markers(other, "DICT_4X4_50")) == [3, 4]

    def test_nothing_to_see(self):
        assert detect_markers(np.full((60, 80, 3), 90, np.uint8), "DICT_4X4_50") == {}
        image, _ = picture_of_markers("DICT_APRILTAG_36h11", (3, 7), size_px=60)
        assert detect_markers(image, "DICT_4X4_50") == {}

    def test_refuses_other_inputs(self):
        image = np.zeros((60, 80, 3), np.uint8)
        with pytest.raises(ValueError, match="dictionary: got 'DICT_NONE'.*DICT_4X4_50"):
            detect_markers(image, "DICT_NONE")
        for wrong in (image[..., 0], image.astype(np.float32), None):
            with pytest.raises(ValueError, match="detect_markers: got"):
                detect_markers(wrong, "DICT_4X4_50")

    @pytest.mark.parametrize("grey", [np.zeros((50, 50)), np.random.default_rng(0).random((50, 50))])
    def test_refinement_without_edges_keeps_the_corners(self, grey):
        corners = np.array([[12.0, 12], [38, 12], [38, 38], [12, 38]])
        moved = corner_error_px(refine_corners(grey, corners, modules=6), corners)
        assert moved.max() <= 26 / 6


class TestSqpnp:
    @pytest.mark.parametrize("target_m", [SQUARE_M, OCTAHEDRON_M, CUBE_M], ids=["square", "octahedron", "cube"])
    @pytest.mark.parametrize("distance_m", [0.4, 2.0, 8.0])
    def test_exact_data_give_the_exact_pose(self, target_m, distance_m):
        rotation, translation_m, points_m, points = problem(target_m, distance_m=distance_m)
        solution = opencv_sqpnp.solve(points_m, points)
        assert solution.ok.all()
        assert rotation_error_deg(solution.rotation, rotation).max() < 1e-3
        assert translation_error_percent(solution.translation_m, translation_m).max() < 1e-3

    def test_position_of_the_origin_does_not_matter(self):
        rotation, translation_m, points_m, points = problem(OCTAHEDRON_M)
        offset_m = np.array([3.0, -2.0, 5.0])
        solution = opencv_sqpnp.solve(points_m + offset_m, points)
        np.testing.assert_allclose(solution.rotation, rotation, atol=1e-6)
        np.testing.assert_allclose(solution.translation_m, translation_m - rotation @ offset_m, atol=1e-5)

    def test_noise_is_averaged(self):
        rotation, _, points_m, points = problem(CUBE_M, count=50)
        noise = 0.5 / 400 * np.random.default_rng(3).standard_normal(points.shape)
        errors_deg = rotation_error_deg(opencv_sqpnp.solve(points_m, points + noise).rotation, rotation)
        assert 0.05 < np.median(errors_deg) < 1

    def test_points_on_a_line_are_not_ok(self):
        _, _, points_m, points = problem(OCTAHEDRON_M, count=3)
        line_m = np.linspace(-0.1, 0.1, 6)[:, None] * [1.0, 2.0, 0.5]
        rotation, translation_m = poses(1)
        camera_m = transform(rotation[0], translation_m[0], line_m)
        points_m[1], points[1] = line_m, camera_m[:, :2] / camera_m[:, 2:]
        solution = opencv_sqpnp.solve(points_m, points)
        assert solution.ok.tolist() == [True, False, True]
        assert np.all(np.isnan(solution.translation_m[1]))
        np.testing.assert_array_equal(solution.rotation[1], np.eye(3))

    def test_images_in_one_point_are_not_ok(self):
        assert not opencv_sqpnp.solve(SQUARE_M[None], np.full((1, 4, 2), 0.1)).ok[0]

    def test_too_far_is_not_a_wrong_pose(self):
        """In a batch that reaches from near to far beyond OpenCV's limit every pose is either right or not ok."""
        near, far = (problem(OCTAHEDRON_M, distance_m=distance_m, seed=3) for distance_m in (10.0, 40.0))
        rotation, _, points_m, points = (np.concatenate(parts) for parts in zip(near, far, strict=True))
        solution = opencv_sqpnp.solve(points_m, points)
        assert solution.ok[:20].all() and not solution.ok[20:].any()
        assert np.all(np.isnan(solution.translation_m[20:]))
        assert rotation_error_deg(solution.rotation[:20], rotation[:20]).max() < 1e-3

    def test_three_points_are_refused(self):
        _, _, points_m, points = problem(SQUARE_M)
        with pytest.raises(ValueError, match="got 3 points, allowed: at least 4"):
            opencv_sqpnp.solve(points_m[:, :3], points[:, :3])


class TestFrontal:
    def test_exact_for_a_target_that_faces_the_camera(self):
        translation_m = np.array([[0.1, -0.2, 1.5], [0.0, 0.0, 0.3]])
        points_m = np.tile(SQUARE_M + [0.02, 0.01, 0], (2, 1, 1))
        camera_m = transform(np.tile(FACING, (2, 1, 1)), translation_m, points_m)
        solution = frontal.solve(points_m, camera_m[..., :2] / camera_m[..., 2:])
        assert solution.ok.all()
        np.testing.assert_allclose(solution.translation_m, translation_m, rtol=1e-12, atol=1e-12)
        np.testing.assert_array_equal(solution.rotation, np.tile(FACING, (2, 1, 1)))

    def test_does_nothing_about_the_tilt(self):
        rotation, translation_m, points_m, points = problem(SQUARE_M, tilt_deg=60)
        solution = frontal.solve(points_m, points)
        assert solution.ok.all()
        assert np.median(rotation_error_deg(solution.rotation, rotation)) > 10
        assert np.median(translation_error_percent(solution.translation_m, translation_m)) < 20

    def test_images_in_one_point_are_not_ok(self):
        assert not frontal.solve(SQUARE_M[None], np.zeros((1, 4, 2))).ok[0]


def test_oracle_uses_the_true_points_only():
    rotation, _, points_m, points = problem(CUBE_M)
    true = {"true_points": points, "true_pixels": points @ K[:2, :2].T + K[:2, 2], "lens": Lens(K=K)}
    solution = oracle_corners.solve(points_m, np.full_like(points, np.nan), **true)
    assert solution.ok.all()
    assert rotation_error_deg(solution.rotation, rotation).max() < 1e-6


@pytest.mark.parametrize("target_m", [CUBE_M, SQUARE_M])
@pytest.mark.parametrize(
    "lens",
    [
        Lens(K=K, port=FlatPort(gap_m=0.03, thickness_m=0.01, n_glass=1.52, n_water=1.334)),
        Lens(K=K, coefficients=(-0.2, 0.05, 0.001, -0.002), port=DomePort(
            inner_radius_m=0.05, thickness_m=0.005, n_glass=1.52, n_water=1.334, decentring_m=(0.0, 0.002, 0.004)
        )),
    ],
    ids=["flat", "dome"],
)  # fmt: skip
def test_reprojection_through_the_lens_finds_the_pose(target_m, lens):
    """Expected: exact pixels behind a port give the pose to 1e-6. Control: SQPnP on the pinhole's points does not."""
    rotation, translation_m, points_m, _ = problem(target_m, count=6)
    pixels, status = lens.project(transform(rotation, translation_m, points_m))
    assert not status.any()
    start = opencv_sqpnp.solve(points_m, normalise(pixels, K @ np.diag([1.33, 1.33, 1])))
    assert start.ok.all()
    solution = refine(start, points_m, pixels, lens=lens)
    assert solution.ok.all()
    assert translation_error_percent(solution.translation_m, translation_m).max() < 1e-6
    assert rotation_error_deg(solution.rotation, rotation).max() < 1e-6
    assert translation_error_percent(start.translation_m, translation_m).min() > 1e-2


class TestAccept:
    def test_points_behind_the_camera_are_not_ok(self):
        """Control: the same rotation farther away is."""
        rotation = np.tile(np.eye(3), (2, 1, 1))
        translation_m = np.array([[0, 0, 0.05], [0, 0, 1.0]])
        assert accept(rotation, translation_m, np.tile(OCTAHEDRON_M, (2, 1, 1))).ok.tolist() == [False, True]

    def test_mirrors_scalings_and_nan_are_not_ok(self):
        rotation = np.stack([np.diag([1.0, 1, -1]), 1.01 * np.eye(3), np.full((3, 3), np.nan), np.eye(3)])
        translation_m = np.tile([0.0, 0, 2], (4, 1))
        solution = accept(rotation, translation_m, np.tile(SQUARE_M, (4, 1, 1)))
        assert solution.ok.tolist() == [False, False, False, True]
        assert np.all(np.isnan(solution.translation_m[:3]))
