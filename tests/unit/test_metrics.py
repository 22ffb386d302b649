"""Metrics against closed forms: exact up to round-off unless a test says otherwise."""

import json
import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from uwsim.metrics import METRICS, Metric
from uwsim.metrics import blur as blur_metrics
from uwsim.metrics import pose as pose_metrics
from uwsim.metrics.image import mse, psnr, ssim
from uwsim.metrics.uciqe import uciqe_o
from uwsim.metrics.uiqm import resize_bicubic, uiqm_f, uiqm_m


def random_image(height=40, width=48, seed=0):
    return np.random.default_rng(seed).integers(0, 256, (height, width, 3), dtype=np.uint8)


def ramp(height=64, width=80):
    row, column = np.mgrid[:height, :width]
    return np.stack([2 * column, 40 + row, 200 - row], axis=2).astype(np.uint8)


class TestImage:
    def test_constant_offset_has_the_textbook_psnr(self):
        reference = np.full((20, 20, 3), 100, np.uint8)
        image = np.full((20, 20, 3), 110, np.uint8)
        assert mse(reference, image) == 100
        assert psnr(reference, image) == pytest.approx(10 * math.log10(255**2 / 100), abs=1e-12)

    def test_difference_does_not_wrap_around(self):
        black, white = np.zeros((9, 9, 3), np.uint8), np.full((9, 9, 3), 255, np.uint8)
        assert mse(black, white) == mse(white, black) == 255**2
        assert psnr(black, white) == 0

    def test_identical_images(self):
        image = random_image()
        assert psnr(image, image) == math.inf
        assert mse(image, image) == 0
        assert ssim(image, image) == pytest.approx(1, abs=1e-12)

    def test_every_channel_counts_alike(self):
        reference = np.full((10, 10, 3), 50, np.uint8)
        for channel in range(3):
            image = reference.copy()
            image[..., channel] += 30
            assert mse(reference, image) == 300

    def test_ssim_of_flat_images_is_the_luminance_term(self):
        reference, image = np.full((12, 12, 3), 80, np.uint8), np.full((12, 12, 3), 120, np.uint8)
        c1 = (0.01 * 255) ** 2
        expected = (2 * 80 * 120 + c1) / (80**2 + 120**2 + c1)
        assert ssim(reference, image) == pytest.approx(expected, abs=1e-9)

    def test_ssim_is_the_uniform_seven_pixel_variant(self):
        """Setup: one 7x7 window. Expected: formula with sample covariance. Control: population covariance."""
        reference, image = random_image(7, 7, 1), random_image(7, 7, 2)
        c1, c2 = (0.01 * 255) ** 2, (0.03 * 255) ** 2

        def formula(ddof):
            values = []
            for channel in range(3):
                x, y = (picture[..., channel].astype(float).ravel() for picture in (reference, image))
                cov = np.cov(x, y, ddof=ddof)
                top = (2 * x.mean() * y.mean() + c1) * (2 * cov[0, 1] + c2)
                values.append(top / ((x.mean() ** 2 + y.mean() ** 2 + c1) * (cov[0, 0] + cov[1, 1] + c2)))
            return np.mean(values)

        assert ssim(reference, image) == pytest.approx(formula(1), abs=1e-9)
        assert abs(ssim(reference, image) - formula(0)) > 1e-5

    @pytest.mark.parametrize("metric", [mse, psnr, ssim])
    def test_refuses_what_it_cannot_compare(self, metric):
        image = random_image()
        for other in (image[:-1], image[..., :1], image.astype(np.float32) / 255, image[..., 0]):
            with pytest.raises(ValueError, match="allowed"):
                metric(image, other)
            with pytest.raises(ValueError, match="allowed"):
                metric(other, image)

    def test_ssim_refuses_images_under_its_window(self):
        with pytest.raises(ValueError, match=r"got \(6, 30\).*>= 7"):
            ssim(random_image(6, 30), random_image(6, 30))


class TestNoReference:
    def test_flat_images(self):
        for level in (0, 128, 255):
            flat = np.full((40, 40, 3), level, np.uint8)
            assert uiqm_f(flat) == uiqm_m(flat) == 0
        # the offset of a and b makes neutral grey coloured: the variant's mark, printed digits
        assert uciqe_o(np.full((40, 40, 3), 128, np.uint8)) == pytest.approx(0.205, abs=5e-4)

    def test_white_noise_scores(self):
        """White noise beats most photographs: these values guard the variants (printed digits)."""
        noise = np.random.default_rng(0).integers(0, 256, (256, 256, 3), dtype=np.uint8)
        assert uiqm_f(noise) == pytest.approx(2.910, abs=1e-3)
        assert uiqm_m(noise) == pytest.approx(3.421, abs=1e-3)
        assert uciqe_o(noise) == pytest.approx(0.662, abs=1e-3)

    def test_contrast_of_a_one_colour_image_is_zero_in_f_only(self):
        green = ramp()
        green[..., [0, 2]] = 0
        # a colour term of about -1 point remains; the sharpness weight of green is 0.587
        colour_and_sharpness = uiqm_f(green, resize=False)
        assert uiqm_m(green) - colour_and_sharpness > 0.1
        with_contrast = green.copy()
        with_contrast[..., [0, 2]] = 1
        assert uiqm_f(with_contrast, resize=False) > colour_and_sharpness + 0.05

    def test_blue_weight_and_resize_are_switches(self):
        image = random_image(128, 96)
        assert uiqm_f(image, blue_weight=0.144) > uiqm_f(image)
        assert uiqm_f(image, resize=False) != pytest.approx(uiqm_f(image), abs=0.01)
        square = random_image(256, 256)
        assert uiqm_f(square, resize=False) == uiqm_f(square)

    def test_f_cuts_the_remainder_of_the_blocks(self):
        image = random_image(64, 64)
        image[60:], image[:, 60:] = 7, 7
        assert uiqm_m(image) != uiqm_m(image[:60, :60])
        with pytest.raises(ValueError, match=">= 10"):
            uiqm_f(random_image(9, 30), resize=False)
        with pytest.raises(ValueError, match=">= 5"):
            uiqm_m(random_image(4, 30))

    @pytest.mark.parametrize("metric", [uiqm_f, uiqm_m, uciqe_o])
    def test_input_is_checked_and_kept(self, metric):
        image = ramp()
        before = image.copy()
        first = metric(image)
        assert metric(image) == first
        assert metric(image[:, ::-1][:, ::-1]) == first
        np.testing.assert_array_equal(image, before)
        assert np.isfinite(metric(np.zeros((20, 20, 3), np.uint8)))
        with pytest.raises(ValueError, match="uint8"):
            metric(image / 255.0)


class TestResize:
    def test_same_size_changes_nothing(self):
        image = random_image()
        np.testing.assert_array_equal(resize_bicubic(image, height=40, width=48), image)

    def test_constant_and_mean_survive(self):
        flat = np.full((50, 70, 3), 77, np.uint8)
        assert np.all(resize_bicubic(flat, height=13, width=90) == 77)
        image = random_image(100, 100)
        small = resize_bicubic(image, height=25, width=25)
        assert abs(small.mean() - image.mean()) < 0.5

    def test_reduction_is_antialiased(self):
        """A one-pixel checkerboard becomes grey; picking pixels would leave it black and white."""
        board = np.tile(np.indices((64, 64)).sum(axis=0)[..., None] % 2 * 255, (1, 1, 3)).astype(np.uint8)
        small = resize_bicubic(board, height=20, width=20)[2:-2, 2:-2]
        assert np.abs(small.astype(int) - 128).max() <= 3
        assert np.ptp(board[::3, ::3]) == 255

    def test_equals_pillow(self):
        image_module = pytest.importorskip("PIL.Image")
        for height, width in ((37, 20), (120, 30), (256, 256)):
            image = random_image(75, 64)
            theirs = image_module.fromarray(image).resize((width, height), image_module.Resampling.BICUBIC)
            ours = resize_bicubic(image, height=height, width=width)
            assert np.abs(ours.astype(int) - np.asarray(theirs)).max() <= 1


class TestBlur:
    def test_directions_repeat_after_half_a_turn(self):
        np.testing.assert_allclose(
            blur_metrics.angle_error_deg([179, 1, 90, 0, 45, 540], [1, 179, 0, 180, 46, 0]),
            [2, 2, 90, 0, 1, 0],
        )

    def test_length_error_is_absolute(self):
        np.testing.assert_allclose(blur_metrics.length_error_px([3, 5], [4, 4.5]), [1, 0.5])

    def test_failure(self):
        lengths = np.array([2.0, 2.01, 0, 0, np.nan, 0, np.inf])
        angles = np.array([10.0, 0, 10.1, 0, 0, np.nan, 0])
        assert blur_metrics.blur_failure(lengths, angles).tolist() == [
            False,
            True,
            True,
            False,
            True,
            True,
            True,
        ]


class TestPose:
    @pytest.mark.parametrize("angle_deg", [0, 1e-9, 1e-6, 0.3, 90, 179.9999, 180])
    def test_rotation_error_is_the_angle_everywhere(self, angle_deg):
        """Control: the arccos form is off by more than 1e-7 deg near 0."""
        base = Rotation.from_rotvec([0.3, -1.1, 2.0])
        axis = np.array([1.0, 2.0, -0.5]) / np.linalg.norm([1.0, 2.0, -0.5])
        turned = (base * Rotation.from_rotvec(np.radians(angle_deg) * axis)).as_matrix()
        assert pose_metrics.rotation_error_deg(turned, base.as_matrix()) == pytest.approx(angle_deg, abs=1e-12 + 1e-13)

    def test_arccos_form_would_fail_this(self):
        base, small = np.eye(3), Rotation.from_rotvec([0, 0, np.radians(1e-9)]).as_matrix()
        arccos_deg = np.degrees(np.arccos(np.clip((np.trace(small.T @ base) - 1) / 2, -1, 1)))
        assert abs(arccos_deg - 1e-9) > 1e-10
        assert pose_metrics.rotation_error_deg(small, base) == pytest.approx(1e-9, rel=1e-6)

    def test_batches_and_non_rotations(self):
        matrices = Rotation.from_rotvec(np.radians([[10, 0, 0], [0, 20, 0]])).as_matrix()
        np.testing.assert_allclose(pose_metrics.rotation_error_deg(matrices, np.eye(3)), [10, 20])
        for wrong in (2 * np.eye(3), np.diag([1.0, 1, -1]), np.full((3, 3), np.nan), np.eye(4)):
            with pytest.raises(ValueError, match="rotation error"):
                pose_metrics.rotation_error_deg(wrong, np.eye(3))

    def test_translation(self):
        estimated, true = np.array([[0.0, 0, 2.02], [0.3, 0.4, 1]]), np.array([[0.0, 0, 2], [0, 0, 1]])
        np.testing.assert_allclose(pose_metrics.translation_error_percent(estimated, true), [1, 50])
        np.testing.assert_allclose(pose_metrics.translation_error_mm(estimated, true), [20, 500])
        with pytest.raises(ValueError, match="length 0"):
            pose_metrics.translation_error_percent([1.0, 0, 0], [0.0, 0, 0])

    def test_corners(self):
        np.testing.assert_allclose(pose_metrics.corner_error_px([[3.0, 4], [1, 1]], [[0.0, 0], [1, 1]]), [5, 0])
        with pytest.raises(ValueError, match="corner error"):
            pose_metrics.corner_error_px(np.zeros((4, 2)), np.zeros((1, 2)))


def test_table_of_metrics():
    assert all(isinstance(metric, Metric) and metric.name == name for name, metric in METRICS.items())
    assert {metric.better for metric in METRICS.values()} == {"higher", "lower"}
    assert METRICS["psnr"] == ("psnr", "dB", "higher")
    assert METRICS["rotation_error_deg"].better == METRICS["mse"].better == "lower"
    json.dumps({name: metric._asdict() for name, metric in METRICS.items()}, allow_nan=False)
