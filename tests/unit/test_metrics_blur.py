"""Errors of blur estimates against the bound and against the stated intervals; fields; PSNR in linear light."""

import math

import numpy as np
import pytest
from skimage.metrics import peak_signal_noise_ratio

from uwsim.metrics import blur


def normal(count: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal(count)


def test_an_estimator_at_the_bound_has_a_median_ratio_of_one():
    """Tolerance: Monte Carlo, four standard errors of the median of 20000. Control: errors half as large again."""
    errors = 0.3 * normal(20_000)
    spread = 4 * 1.17 / math.sqrt(20_000)
    assert np.median(blur.error_to_bound_ratio(errors, 0.3)) == pytest.approx(1, abs=spread)
    assert np.median(blur.error_to_bound_ratio(1.5 * errors, 0.3)) > 1 + 10 * spread


@pytest.mark.parametrize("function", [blur.error_to_bound_ratio, blur.error_to_sd])
def test_no_error_is_held_against_nothing(function):
    assert math.isnan(function(0.1, math.nan))
    with pytest.raises(ValueError, match="got 0.0, allowed: > 0"):
        function(0.1, 0.0)


def test_intervals_cover_what_they_say_after_their_scale():
    """Setup: standard deviations stated three times too small, scale fitted on one half. Control: without the scale."""
    ratios = blur.error_to_sd(normal(20_000), 1 / 3)
    scale = blur.interval_scale(ratios[:10_000])
    assert scale == pytest.approx(3, rel=0.03)
    assert np.mean(blur.within_interval(ratios[10_000:], scale=scale)) == pytest.approx(0.9, abs=0.012)
    assert np.mean(blur.within_interval(ratios)) < 0.5
    assert math.isnan(blur.interval_scale([math.nan]))
    assert not blur.within_interval(math.nan)


def test_a_sharp_picture_is_called_blurred_by_its_length_and_verdict():
    assert blur.sharp_called_blurred(2.0, "blur")
    assert blur.sharp_called_blurred(2.0, "not uniform")
    assert not blur.sharp_called_blurred(1.99, "blur")
    assert not blur.sharp_called_blurred(9.0, "no blur")


def test_the_sign_of_a_displacement_is_not_counted_but_its_direction_is():
    true = np.array([[3.0, 4.0], [3.0, 4.0], [0.0, 2.0]])
    found = np.array([[-3.0, -4.0], [3.0, -4.0], [0.0, 0.0]])
    assert blur.field_error_px(found, true) == pytest.approx([0, 6, 2])


def test_psnr_of_floats_is_that_of_scikit_image():
    rng = np.random.default_rng(1)
    sharp, other = rng.random((2, 40, 50))
    assert blur.psnr_linear(sharp, other) == pytest.approx(peak_signal_noise_ratio(sharp, other, data_range=1))
    assert blur.psnr_linear(sharp, sharp) == math.inf
    assert blur.ssim_linear(sharp, sharp) == pytest.approx(1)
    assert blur.ssim_linear(sharp, other) < 0.3
    for function in (blur.psnr_linear, blur.ssim_linear):
        with pytest.raises(ValueError, match=r"got uint8 \(40, 50\), allowed: float of the shape \(40, 50\)"):
            function(sharp, (255 * other).astype(np.uint8))
