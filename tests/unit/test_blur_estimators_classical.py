"""Classical blur estimators: exact cepstral values, known blurs in each one's regime, symmetries, what they refuse."""

import numpy as np
import pytest
from scipy.special import sici

from uwsim.metrics.blur import angle_error_deg, blur_failure, length_error_px
from uwsim.motion_blur import cepstrum as of
from uwsim.motion_blur import cepstrum_morphology as shape
from uwsim.motion_blur import log_spectrum
from uwsim.motion_blur.estimate import longest_length_px
from uwsim.motion_blur.estimators import (
    cepstrum_minimum,
    cepstrum_morphology,
    cepstrum_morphology_mended,
    derivative_autocorrelation,
    hough,
    radon,
)
from uwsim.motion_blur.kernels import blur, otf

ESTIMATORS = {
    module.__name__.rpartition(".")[2]: module
    for module in (
        cepstrum_minimum,
        cepstrum_morphology,
        cepstrum_morphology_mended,
        derivative_autocorrelation,
        hough,
        radon,
    )
}
# length and angle that each reaches on a power-law texture of 192 x 256 without noise; whole pixels, steps of the
# angle and the texture's own shape
TOLERANCE = {
    "cepstrum_minimum": (0.4, 2),
    "cepstrum_morphology": (1.0, 5),
    "cepstrum_morphology_mended": (0.4, 2),
    "derivative_autocorrelation": (1.5, 8),
    "hough": (0.6, 2),
    "radon": (0.4, 1),
}


def frame(*, length_px, angle_deg, height=192, width=256, seed=0, noise=0.0, border_px=48):
    """Return an 8-bit (H, W) Gaussian texture of spectrum f^-2.8, blurred; cut from a larger one, not periodic."""
    rng = np.random.default_rng(seed)
    rows, columns = height + 2 * border_px, width + 2 * border_px
    frequency = np.hypot(np.fft.fftfreq(rows)[:, None], np.fft.fftfreq(columns)[None, :])
    frequency[0, 0] = 1
    picture = np.fft.ifft2(np.fft.fft2(rng.standard_normal((rows, columns))) / frequency**1.4).real
    moved = blur(0.5 + 0.13 * picture / picture.std(), length_px=length_px, angle_deg=angle_deg)
    inner = moved[border_px:-border_px, border_px:-border_px] + noise * rng.standard_normal((height, width))
    return np.rint(255 * np.clip(inner, 0, 1)).astype(np.uint8)


def estimate(name, levels, **options):
    """Call an estimator with 8-bit levels, or with levels / 255 where it wants linear intensities."""
    module = ESTIMATORS[name]
    image = levels if module.INPUT == "srgb_uint8" else (levels / 255).astype(np.float32)
    return module.estimate(image, **options)


def errors(found, length_px, angle_deg):
    return length_error_px(found.length_px, length_px), angle_error_deg(found.angle_deg, angle_deg)


@pytest.fixture(scope="module")
def values():
    """Cepstrum of the blur alone, on a prime side: no frequency falls on a zero."""
    return of.cepstrum_of_power(otf((3, 4093), length_px=TestCepstrumOfTheBlur.LENGTH_PX, angle_deg=0) ** 2)


class TestCepstrumOfTheBlur:
    """ln sinc^2(L s) at whole quefrencies q: 2 Si(pi q) / (pi q), minus 1 / k at q = k L."""

    LENGTH_PX = 16

    def expected(self, q, echoes):
        ridge = 2 * sici(np.pi * q)[0] / (np.pi * q)
        return ridge - sum(1 / k for k in range(1, 5) if echoes and q == k * self.LENGTH_PX)

    @pytest.mark.parametrize("q", [1, 2, 5, 8, 15, 16, 17, 24, 32, 48, 64])
    def test_along_the_motion(self, values, q):
        """Tolerance 0.005: sums over 4093 frequencies instead of the integral over a logarithm's pole."""
        assert values[0, q] == pytest.approx(self.expected(q, echoes=True), abs=0.005)
        assert values[0, -q] == pytest.approx(values[0, q], abs=1e-12)

    def test_nothing_across(self, values):
        assert np.abs(values[1:]).max() < 1e-12

    def test_printed_digits_of_half_the_log_power(self, values):
        """-0.469, -0.234, -0.156 at L, 2 L, 3 L: 1 / (2 q) - 1 / (2 k) of ln |sinc|."""
        np.testing.assert_allclose(values[0, [16, 32, 48]] / 2, [-0.469, -0.234, -0.156], atol=0.004)

    @pytest.mark.parametrize("q", [16, 32, 48])
    def test_control_the_ridge_alone_misses_the_peaks(self, values, q):
        assert abs(values[0, q] - self.expected(q, echoes=False)) > 0.3

    def test_deepest_point_is_on_the_motion_up_to_the_right(self):
        """A motion of 4 px to the right and 3 px up. Control: the mirrored one is elsewhere."""
        for up in (3, -3):
            power = otf((256, 254), length_px=5, angle_deg=np.degrees(np.arctan2(up, 4))) ** 2
            values = of.centre(of.cepstrum_of_power(power), 20)
            row, column = of.deepest(values, (of.distance_px(20) > 1.5) & of.upper_half(20))
            assert (column - 20, 20 - row) in ((4, up), (-4, -up))


@pytest.mark.parametrize("shape_px", [(32, 32), (31, 40), (17, 16)])
def test_centre_has_quefrency_0_in_the_middle_and_is_even(shape_px):
    values = of.cepstrum(np.random.default_rng(0).random(shape_px))
    middle = of.centre(values, 7)
    assert middle[7, 7] == values[0, 0]
    assert middle[6, 9] == values[-1, 2]
    np.testing.assert_allclose(middle, middle[::-1, ::-1], atol=1e-12)


def test_sub_pixel_centroid():
    values = np.zeros((9, 9))
    values[2, 6], values[2, 7] = -3, -1
    assert of.sub_pixel(values, 2, 6) == pytest.approx((-2, 2.25))
    assert of.sub_pixel(values, 6, 2) == (2, -2)


class TestMorphology:
    @pytest.mark.parametrize("angle_deg", [0, 20, 65, 90, 130, 170])
    def test_ellipse_of_a_drawn_ridge(self, angle_deg):
        """An elliptical hill, of which the brightest tenth of the map is an ellipse of known area and shape."""
        down, right = np.mgrid[-41:42, -41:42]
        angle = np.radians(angle_deg)
        along, across = right * np.cos(angle) - down * np.sin(angle), right * np.sin(angle) + down * np.cos(angle)
        found = shape.ellipse_of_ridge(-np.hypot(along / 20, across / 8))
        assert angle_error_deg(found.angle_deg, angle_deg) < 1
        half_short_px = np.sqrt(0.1 * 83**2 / (np.pi * 2.5))
        assert found.half_short_px == pytest.approx(half_short_px, rel=0.03)
        assert found.half_long_px == pytest.approx(2.5 * half_short_px, rel=0.03)

    def test_no_ridge_no_ellipse(self):
        assert shape.ellipse_of_ridge(np.zeros((83, 83))) is None

    def test_window_has_twice_the_axes_as_edges(self):
        window = shape.window_of(shape.Ellipse(6.0, 2.0, 90.0), 20)
        rows, columns = np.nonzero(window)
        assert (rows.min() - 20, rows.max() - 20) == (-12, 12)
        assert (columns.min() - 20, columns.max() - 20) == (-4, 4)

    def test_brightest_region_by_total_or_by_peak(self):
        values = np.zeros((41, 41))
        values[20, 26:33], values[12, 20] = -1.0, -1.5
        values += values[::-1, ::-1]
        window = np.ones(values.shape, bool)
        total, deepest = (shape.brightest_region(values, window, by=by) for by in ("sum", "peak"))
        assert total[20, 28]
        assert total[20, 12]
        assert not total[12, 20]
        assert deepest[12, 20]
        assert not deepest[20, 28]

    def test_window_decides_between_peaks_and_the_deepest_is_the_fallback(self):
        values = np.full((41, 41), 0.01)
        values[20, 30], values[5, 20] = -1.0, -2.0
        values = np.minimum(values, values[::-1, ::-1])
        mask = of.distance_px(20) >= 1.5
        along = shape.Ellipse(8.0, 2.0, 0.0)

        def chosen(ellipse):
            return shape.chosen_peak(values, mask, ellipse, both_of_a_pair=False, by="sum")

        assert chosen(along) == (20, 30)
        assert chosen(None) == (5, 20)
        assert chosen(shape.Ellipse(1.0, 1.0, 0.0)) == (5, 20)

    def test_pairs_leave_three_of_six_peaks(self):
        values = np.full((41, 41), 0.01)
        for depth, column in enumerate(range(24, 40, 3)):
            values[20, column] = values[20, 40 - column] = depth - 10.0
        mask = of.distance_px(20) >= 1.5
        assert len({abs(column - 20) for _, column in shape.negative_peaks(values, mask)}) == 3
        assert len({abs(column - 20) for _, column in shape.negative_peaks(values, mask & of.upper_half(20))}) == 6

    def test_control_printed_angle_counts_the_direction_twice(self):
        """alpha + delta against delta, where both are right: off by the direction itself."""
        misses = []
        for angle_deg in (30, 60, 120, 150):
            levels = frame(length_px=12, angle_deg=angle_deg, height=256, seed=angle_deg)
            corrected = estimate("cepstrum_morphology", levels)
            printed = estimate("cepstrum_morphology", levels, as_printed=True)
            assert errors(corrected, 12, angle_deg)[1] < 5
            assert printed.length_px == corrected.length_px
            misses.append(angle_error_deg(printed.angle_deg, angle_deg))
        assert min(misses) > 10
        assert np.median(misses) > 20

    def test_gamma_does_not_matter_to_an_equalised_picture(self):
        """A rising curve without merged levels leaves the ranks, hence the estimate. The linear one notices."""
        levels = frame(length_px=9, angle_deg=40, seed=4) // 4
        curved = np.rint(255 * (np.arange(64) / 63) ** 0.6).astype(np.uint8)[levels]
        assert estimate("cepstrum_morphology", curved) == estimate("cepstrum_morphology", levels)
        assert estimate("cepstrum_minimum", curved) != estimate("cepstrum_minimum", levels)


class TestLogSpectrum:
    def test_bins_are_equal_on_both_axes_of_any_picture(self):
        """Unequal bins would turn 30 degrees into 12 or 57 at these sides. Control: the turned picture says 120."""
        angles_deg = np.arange(0, 180, 10.0)
        levels = frame(length_px=12, angle_deg=30, height=96, width=256, seed=1) / 255
        for picture, expected_deg in ((levels, 30), (np.rot90(levels), 120)):
            flat = log_spectrum.flat_log_spectrum(picture, longest_px=40, side=128)
            found, weight = log_spectrum.profiles(flat, angles_deg)
            assert angles_deg[np.argmax(weight @ found**2)] == expected_deg

    @pytest.mark.parametrize("length_px", [4.0, 7.3, 15.0, 31.0])
    def test_length_of_an_exact_profile(self, length_px):
        """Method tolerance: the ridge, which falls as 1 / q, moves the minimum outwards."""
        frequency = np.linspace(-0.5, 0.5, 129)
        profile = np.log(np.sinc(length_px * frequency) ** 2 + 0.01)
        weight = np.full(129, 1 / 129)
        found = log_spectrum.length_from_profile(profile, weight, longest_px=40)
        assert found == pytest.approx(length_px, abs=0.25)


@pytest.mark.parametrize("name", ESTIMATORS)
class TestEveryEstimator:
    @pytest.mark.parametrize("length_px, angle_deg", [(6, 30), (10, 135), (16, 90), (20, 160)])
    def test_known_blur(self, name, length_px, angle_deg):
        """Model tolerance: stands with the estimator. Control: the other diagonal is a failure."""
        found = estimate(name, frame(length_px=length_px, angle_deg=angle_deg, seed=length_px))
        length_error, angle_error = errors(found, length_px, angle_deg)
        assert length_error < TOLERANCE[name][0]
        assert angle_error < TOLERANCE[name][1]
        assert blur_failure(*errors(found, length_px, angle_deg + 45))

    def test_transposed_picture_mirrors_the_angle(self, name):
        """x right and down change places: theta becomes 270 - theta, that is 90 + (180 - theta), modulo 180."""
        levels = frame(length_px=14, angle_deg=25, height=224, width=224, seed=14)
        first, turned = estimate(name, levels), estimate(name, np.ascontiguousarray(levels.T))
        assert length_error_px(turned.length_px, first.length_px) < 0.3
        assert angle_error_deg(turned.angle_deg, 270 - first.angle_deg) < 1.5
        assert angle_error_deg(first.angle_deg, turned.angle_deg) > 10

    def test_units_do_not_matter(self, name):
        levels = frame(length_px=9, angle_deg=70, seed=2)
        if ESTIMATORS[name].INPUT == "srgb_uint8":
            first, scaled = estimate(name, levels // 2), estimate(name, levels // 2 + 64)
        else:
            image = (levels / 255).astype(np.float32)
            first, scaled = ESTIMATORS[name].estimate(image), ESTIMATORS[name].estimate(1e-3 * image)
        assert scaled == pytest.approx(first, abs=1e-2)

    def test_same_answer_twice_and_from_three_equal_channels(self, name):
        levels = frame(length_px=5, angle_deg=110, noise=0.01, seed=3)
        first = estimate(name, levels)
        assert estimate(name, levels.copy()) == first
        assert estimate(name, np.repeat(levels[..., None], 3, axis=2)) == pytest.approx(first, abs=1e-2)

    @pytest.mark.parametrize("height, width", [(16, 16), (17, 23), (64, 48)])
    @pytest.mark.parametrize("length_px", [0, 3])
    def test_always_a_number(self, name, height, width, length_px):
        found = estimate(name, frame(length_px=length_px, angle_deg=70, height=height, width=width))
        assert 0 < found.length_px <= longest_length_px((height, width)) + 1.5
        assert 0 <= found.angle_deg < 180

    def test_texture_at_the_border_only(self, name):
        levels = np.zeros((64, 64), np.uint8)
        levels[0] = np.random.default_rng(0).integers(0, 256, 64)
        found = estimate(name, levels)
        assert np.all(np.isfinite(found[:2]))

    def test_refuses_constant_and_tiny_images(self, name):
        with pytest.raises(ValueError, match=f"{name}: image is constant"):
            estimate(name, np.full((32, 40, 3), 80, np.uint8))
        with pytest.raises(ValueError, match=">= 16"):
            estimate(name, frame(length_px=3, angle_deg=0, height=32, width=32)[:15])

    def test_refuses_what_is_not_finite_or_not_8_bit(self, name):
        image = (frame(length_px=3, angle_deg=0, height=32, width=32) / 255).astype(np.float32)
        image[3, 4] = np.nan
        expected = "got float32, allowed: uint8" if ESTIMATORS[name].INPUT == "srgb_uint8" else "1 NaN"
        with pytest.raises(ValueError, match=expected):
            ESTIMATORS[name].estimate(image)


@pytest.mark.parametrize("name", ["radon", "hough"])
def test_known_limit_no_stripe_of_a_2_px_blur_is_in_the_spectrum(name):
    """Control that failure is possible: the first zero of 2 px is at the end of the spectrum."""
    failed = [
        blur_failure(*errors(estimate(name, frame(length_px=2, angle_deg=a, seed=a, noise=0.01)), 2, a))
        for a in range(0, 180, 36)
    ]
    assert sum(failed) >= 3
