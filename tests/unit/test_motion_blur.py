"""Blur kernels against closed forms; estimators on power-law textures blurred by the exact transfer."""

import numpy as np
import pytest

from uwsim.metrics.blur import angle_error_deg, blur_failure, length_error_px
from uwsim.motion_blur.estimate import estimate_from_vector, longest_length_px
from uwsim.motion_blur.estimators import cepstrum_minimum, none, oracle_sharp
from uwsim.motion_blur.kernels import blur, kernel, otf

ESTIMATORS = {"none": none, "cepstrum_minimum": cepstrum_minimum, "oracle_sharp": oracle_sharp}


def texture(height, width, seed):
    """Return a Gaussian texture of spectrum f^-2.8, mean 0.5, standard deviation 0.13."""
    rng = np.random.default_rng(seed)
    frequency = np.hypot(np.fft.fftfreq(height)[:, None], np.fft.fftfreq(width)[None, :])
    frequency[0, 0] = 1
    picture = np.fft.ifft2(np.fft.fft2(rng.standard_normal((height, width))) / frequency**1.4).real
    return 0.5 + 0.13 * (picture - picture.mean()) / picture.std()


def frames(*, length_px, angle_deg, height=192, width=256, seed=0, noise=0.0, border_px=48):
    """Return (blurred, sharp) (H, W, 3) float32, 8 bit, cut from a larger picture: nothing is periodic."""
    large = texture(height + 2 * border_px, width + 2 * border_px, seed)
    moved = blur(large, length_px=length_px, angle_deg=angle_deg)
    inner = (slice(border_px, -border_px), slice(border_px, -border_px))
    blurred = moved[inner] + noise * np.random.default_rng(seed + 100).standard_normal((height, width))
    blurred = np.rint(255 * np.clip(blurred, 0, 1)) / 255
    return tuple(np.repeat(picture[..., None], 3, axis=2).astype(np.float32) for picture in (blurred, large[inner]))


def call(module, image, sharp):
    return module.estimate(image, **({"sharp": sharp} if "sharp" in module.NEEDS else {}))


class TestOtf:
    def test_moving_along_rows_and_columns(self):
        along_rows = otf((16, 32), length_px=4, angle_deg=0)
        np.testing.assert_allclose(along_rows, np.broadcast_to(np.sinc(4 * np.fft.fftfreq(32)), (16, 32)))
        along_columns = otf((16, 32), length_px=4, angle_deg=90)
        np.testing.assert_allclose(
            along_columns, np.broadcast_to(np.sinc(4 * np.fft.fftfreq(16))[:, None], (16, 32)), atol=1e-15
        )

    def test_y_is_up(self):
        """A point moving at 45 deg smears from bottom left to top right. Control: -45 deg does not."""
        point = np.zeros((33, 33))
        point[16, 16] = 1
        smeared = blur(point, length_px=12, angle_deg=45)
        up_right, down_right = smeared[12:16, 17:21], smeared[17:21, 17:21]
        assert np.trace(up_right[::-1]) > 10 * abs(np.trace(down_right))
        mirrored = blur(point, length_px=12, angle_deg=-45)
        np.testing.assert_allclose(mirrored, smeared[::-1], atol=1e-12)

    def test_energy_and_second_moment(self):
        """The mean stays; a line of length L has the variance L^2 / 12 along itself, none across."""
        length_px, angle = 9.0, np.radians(30)
        row, column = np.mgrid[-32:32, -32:32]
        spot = np.exp(-(row**2 + column**2) / (2 * 4.0**2))
        smeared = blur(spot, length_px=length_px, angle_deg=30)
        assert smeared.sum() == pytest.approx(spot.sum(), rel=1e-12)
        along = column * np.cos(angle) - row * np.sin(angle)
        across = column * np.sin(angle) + row * np.cos(angle)

        def variance(picture, axis):
            return (picture * axis**2).sum() / picture.sum()

        assert variance(smeared, along) - variance(spot, along) == pytest.approx(length_px**2 / 12, abs=1e-6)
        assert variance(smeared, across) - variance(spot, across) == pytest.approx(0, abs=1e-6)

    def test_zero_length_changes_nothing_and_dtype_is_kept(self):
        image = np.random.default_rng(0).random((20, 24, 3)).astype(np.float32)
        before = image.copy()
        same = blur(image, length_px=0, angle_deg=70)
        assert same.dtype == np.float32
        np.testing.assert_allclose(same, image, atol=1e-6)
        np.testing.assert_array_equal(image, before)

    @pytest.mark.parametrize("length_px, angle_deg", [(-1, 0), (np.nan, 0), (np.inf, 0), (3, np.nan)])
    def test_refuses_nonsense(self, length_px, angle_deg):
        with pytest.raises(ValueError, match="motion blur: got"):
            otf((8, 8), length_px=length_px, angle_deg=angle_deg)
        with pytest.raises(ValueError, match="float"):
            blur(np.zeros((8, 8), np.uint8), length_px=1, angle_deg=0)


class TestKernel:
    def test_horizontal_line_splits_its_ends(self):
        np.testing.assert_allclose(kernel(5, length_px=4, angle_deg=0)[2], np.array([0.5, 1, 1, 1, 0.5]) / 4)
        np.testing.assert_allclose(kernel(5, length_px=4, angle_deg=90)[:, 2], np.array([0.5, 1, 1, 1, 0.5]) / 4)

    def test_diagonal_stays_on_the_diagonal_that_goes_up(self):
        np.testing.assert_allclose(kernel(3, length_px=3 * np.sqrt(2), angle_deg=45), np.eye(3)[::-1] / 3, atol=1e-12)

    @pytest.mark.parametrize("angle_deg", [0, 15, 63.4, 90, 117, 179])
    @pytest.mark.parametrize("length_px", [0, 0.3, 2, 7.7, 20])
    def test_sum_symmetry_and_length(self, length_px, angle_deg):
        shares = kernel(33, length_px=length_px, angle_deg=angle_deg)
        assert shares.sum() == pytest.approx(1, abs=1e-12)
        assert shares.min() >= 0
        np.testing.assert_allclose(shares, shares[::-1, ::-1], atol=1e-9)
        if length_px >= 2:
            row, column = np.mgrid[-16:17, -16:17]
            angle = np.radians(angle_deg)
            along = column * np.cos(angle) - row * np.sin(angle)
            # widening each piece to a pixel shifts it by half a pixel at most
            variance = (shares * along**2).sum()
            assert abs(variance - length_px**2 / 12) < 0.25

    def test_refuses_what_does_not_fit(self):
        for size_px, length_px in ((4, 1), (3, 3.1), (0, 0)):
            with pytest.raises(ValueError, match="kernel: got size"):
                kernel(size_px, length_px=length_px, angle_deg=0)


class TestCepstrumMinimum:
    @pytest.mark.parametrize("length_px, angle_deg", [(5, 0), (6, 30), (8, 90), (10, 135), (14, 75), (20, 165)])
    def test_long_blur_without_noise(self, length_px, angle_deg):
        """Model tolerance: the texture shifts the minimum, by up to half of the bounds here."""
        image, _ = frames(length_px=length_px, angle_deg=angle_deg, seed=length_px)
        estimate = cepstrum_minimum.estimate(image)
        assert length_error_px(estimate.length_px, length_px) < 0.4
        assert angle_error_deg(estimate.angle_deg, angle_deg) < 2

    def test_sub_pixel_refinement_helps(self):
        """Half-way between two pixels a whole number of pixels is off by 0.5 px."""
        for angle_deg in (0, 90):
            image, _ = frames(length_px=8.5, angle_deg=angle_deg, seed=3)
            assert length_error_px(cepstrum_minimum.estimate(image).length_px, 8.5) < 0.25

    def test_small_image(self):
        image, _ = frames(length_px=6, angle_deg=30, height=48, width=64, seed=2)
        assert not blur_failure(*errors(cepstrum_minimum.estimate(image), 6, 30))

    def test_short_noisy_blur_is_beyond_it(self):
        """Known limit, and control that failure is possible: most 2 px blurs with 1 % noise are missed."""
        failed = [
            blur_failure(
                *errors(cepstrum_minimum.estimate(frames(length_px=2, angle_deg=a, seed=a, noise=0.01)[0]), 2, a)
            )
            for a in range(0, 180, 36)
        ]
        assert sum(failed) >= 3


class TestOracleSharp:
    @pytest.mark.parametrize("length_px, angle_deg", [(1, 20), (2, 90), (4, 150), (10, 0), (25, 60)])
    def test_reaches_the_truth(self, length_px, angle_deg):
        """Model tolerance 0.02 px, 0.3 deg: 8 bits, and the tails of the band-limited line at the border."""
        image, sharp = frames(length_px=length_px, angle_deg=angle_deg, seed=length_px)
        estimate = oracle_sharp.estimate(image, sharp=sharp)
        assert length_error_px(estimate.length_px, length_px) < 0.02
        assert angle_error_deg(estimate.angle_deg, angle_deg) < 0.3

    def test_units_do_not_matter(self):
        image, sharp = frames(length_px=6, angle_deg=40)
        first = oracle_sharp.estimate(image, sharp=sharp)
        scaled = oracle_sharp.estimate(0.5 * image + 0.1, sharp=3e-3 * sharp)
        assert scaled == pytest.approx(first, abs=1e-3)

    def test_noise(self):
        image, sharp = frames(length_px=8, angle_deg=110, noise=0.01, seed=5)
        errors_now = errors(oracle_sharp.estimate(image, sharp=sharp), 8, 110)
        assert errors_now[0] < 0.1
        assert errors_now[1] < 0.5

    def test_control_another_twin_is_no_oracle(self):
        image, _ = frames(length_px=8, angle_deg=110, seed=5)
        _, other = frames(length_px=8, angle_deg=110, seed=6)
        assert errors(oracle_sharp.estimate(image, sharp=other), 8, 110)[0] > 0.1

    def test_no_motion(self):
        image, sharp = frames(length_px=0, angle_deg=0, seed=1)
        assert oracle_sharp.estimate(image, sharp=sharp).length_px < 0.2
        assert oracle_sharp.estimate(sharp, sharp=sharp).length_px < 0.01

    def test_sizes_must_agree(self):
        image, sharp = frames(length_px=4, angle_deg=0)
        with pytest.raises(ValueError, match="sharp is"):
            oracle_sharp.estimate(image, sharp=sharp[:-1])


def errors(estimate, length_px, angle_deg):
    return length_error_px(estimate.length_px, length_px), angle_error_deg(estimate.angle_deg, angle_deg)


@pytest.mark.parametrize("name", ESTIMATORS)
class TestEveryEstimator:
    @pytest.mark.parametrize("height, width", [(16, 16), (17, 23), (48, 64), (64, 48)])
    @pytest.mark.parametrize("length_px", [0, 0.2, 3])
    def test_always_a_number(self, name, height, width, length_px):
        image, sharp = frames(length_px=length_px, angle_deg=70, height=height, width=width)
        estimate = call(ESTIMATORS[name], image, sharp)
        assert 0 <= estimate.length_px <= longest_length_px(image.shape) + 1.5
        assert 0 <= estimate.angle_deg < 180

    @pytest.mark.parametrize("rows", [1, 3])
    def test_texture_at_the_border_only(self, name, rows):
        picture = np.zeros((64, 64, 3), np.float32)
        picture[:rows] = np.random.default_rng(0).random((rows, 64, 1))
        assert np.all(np.isfinite(call(ESTIMATORS[name], picture, picture)[:2]))

    @pytest.mark.parametrize("value", [0.0, 0.3, 1.0])
    def test_refuses_constant_images(self, name, value):
        image = np.full((32, 40, 3), value, np.float32)
        with pytest.raises(ValueError, match="constant"):
            call(ESTIMATORS[name], image, texture(32, 40, 0)[..., None])

    def test_refuses_nan_and_tiny_images(self, name):
        image, sharp = frames(length_px=3, angle_deg=0, height=32, width=32)
        broken = image.copy()
        broken[5, 5, 1] = np.nan
        with pytest.raises(ValueError, match="NaN"):
            call(ESTIMATORS[name], broken, sharp)
        with pytest.raises(ValueError, match=">= 16"):
            call(ESTIMATORS[name], image[:15], sharp[:15])


def test_do_nothing_says_no_motion():
    image, _ = frames(length_px=5, angle_deg=30, height=32, width=32)
    assert none.estimate(image)[:2] == (0.0, 0.0)


def test_vector_to_estimate():
    assert estimate_from_vector(3, 4)[:2] == pytest.approx((5, np.degrees(np.arctan2(4, 3))))
    assert estimate_from_vector(-3, -4) == pytest.approx(estimate_from_vector(3, 4))
    assert estimate_from_vector(1, -1).angle_deg == pytest.approx(135)
    assert estimate_from_vector(1, -1e-18).angle_deg == 0
    assert estimate_from_vector(0, 0)[:2] == (0, 0)
