"""The sensor against the linear model of EMVA 1288: means, variances, quantisation, saturation, fixed pattern.

Statistics are of many independent samples with fixed seeds; bounds are four standard errors, stated where used.
"""

import numpy as np
import pytest

from uwsim import images
from uwsim.camera import sensor

TWELVE_BITS = {
    "electrons_per_radiance": np.array([1.0, 2.0, 0.5]), "full_well_e": 10000.0, "white_balance": np.array([2, 1, 4.0]),
    "read_noise_e": 4.0, "dark_e": 25.0, "adc_bits": 12, "black_level_dn": 64,
}  # fmt: skip
GAIN_DN_PER_E = (4095 - 64) / 10000.0
# 8 bits with noise above one step, so that the rounding error is uniform
EIGHT_BITS = TWELVE_BITS | {"adc_bits": 8, "black_level_dn": 10, "read_noise_e": 40.0, "dark_e": 0.0}
STANDARD_ERRORS = 4


def even(electrons: float, size: int = 200, settings: dict = TWELVE_BITS) -> np.ndarray:
    """Return the radiance (size, size, 3) that makes the same mean electrons in every band."""
    return np.full((size, size, 3), electrons) / settings["electrons_per_radiance"]


def raw(electrons: float, seed: int, size: int = 200, settings: dict = TWELVE_BITS) -> np.ndarray:
    radiance = even(electrons, size, settings)
    return sensor.raw_dn(radiance, rng=np.random.default_rng(seed), **settings).astype(float)


def mean_and_variance(electrons: float, seed: int, settings: dict = TWELVE_BITS) -> tuple[float, float, float]:
    """Return mean [DN], temporal variance [DN^2] from a pair of images, and the variance's standard error."""
    one, other = (raw(electrons, 2 * seed + half, settings=settings) for half in (0, 1))
    variance = float(np.mean((one - other) ** 2) / 2)
    return float((one + other).mean() / 2), variance, variance * np.sqrt(2 / one.size)


def photon_transfer(settings: dict) -> tuple[float, float]:
    """Return the slope of the mean-variance line and its standard error, both [DN]; dark image taken off."""
    points = np.array([mean_and_variance(e, seed, settings) for seed, e in enumerate(np.linspace(0, 7000, 12))])
    mean, variance, error = points.T
    weights = 1 / error**2
    centre = np.average(mean, weights=weights)
    spread = np.sum(weights * (mean - centre) ** 2)
    return np.sum(weights * (mean - centre) * variance) / spread, spread**-0.5


@pytest.mark.parametrize("pattern", [{}, {"prnu": 0.02, "dsnu_e": 5.0}], ids=["even", "fixed pattern"])
def test_the_slope_of_the_mean_variance_line_is_the_gain(pattern):
    """Setup: pairs of even images from dark to 0.7 of the full well. Expected: variance over mean rises by K (EMVA 1288
    photon transfer), with and without fixed pattern, which the difference of a pair cancels. Tolerance: Monte Carlo,
    four standard errors of the fit. Control: a gain 2 % off is seen."""
    slope, error = photon_transfer(TWELVE_BITS | pattern)
    assert abs(slope - GAIN_DN_PER_E) < STANDARD_ERRORS * error
    assert abs(slope - 1.02 * GAIN_DN_PER_E) > STANDARD_ERRORS * error


def test_control_the_variance_of_one_image_holds_the_fixed_pattern():
    """Control: without the difference of a pair, 2 % of PRNU bends the line far above K."""
    image = raw(7000.0, 0, settings=TWELVE_BITS | {"prnu": 0.02})
    assert image.var() > 3 * GAIN_DN_PER_E**2 * 7000


@pytest.mark.parametrize("settings", [TWELVE_BITS, EIGHT_BITS], ids=["12 bits", "8 bits"])
def test_the_dark_variance_is_read_noise_dark_current_and_rounding(settings):
    """Setup: pairs of dark images. Expected: K^2 (sigma_d0^2 + dark_e) + 1/12 DN^2. Tolerance: Monte Carlo, four
    standard errors. Control: at 8 bits, 1/12 DN^2 left out is seen."""
    gain = sensor.Constants(**settings).gain_dn_per_e
    expected = gain**2 * (settings["read_noise_e"] ** 2 + settings["dark_e"]) + 1 / 12
    _, variance, error = mean_and_variance(0.0, 5, settings)
    assert abs(variance - expected) < STANDARD_ERRORS * error
    if settings is EIGHT_BITS:
        assert abs(variance - (expected - 1 / 12)) > STANDARD_ERRORS * error


def test_the_mean_is_linear_and_starts_at_black_and_dark_level():
    """Expected: mean DN = black + K (dark_e + mean electrons). Tolerance: Monte Carlo. Control: the sRGB picture."""
    levels = np.array([0.0, 10.0, 500.0, 3000.0, 9000.0])
    for seed, level in enumerate(levels):
        mean, variance, _ = mean_and_variance(level, seed)
        expected = 64 + GAIN_DN_PER_E * (25.0 + level)
        assert abs(mean - expected) < STANDARD_ERRORS * np.sqrt(variance / (2 * 120000))
    encoded = [sensor.expose_without_noise(even(e, 2), **TWELVE_BITS)[0, 0, 1] / 255 for e in (1000.0, 2000.0)]
    assert encoded[1] / encoded[0] < 1.5


def test_the_error_of_rounding_is_uniform():
    """Setup: the same electrons through 8 bits and, finely, 16 bits. Expected: the difference is uniform in +-1/2 DN:
    mean 0, variance 1/12, even in ten bins. Tolerance: Monte Carlo; 1/257 DN for the finer steps."""
    settings = EIGHT_BITS | {"black_level_dn": 0}
    coarse = raw(3000.0, 0, settings=settings)
    fine = raw(3000.0, 0, settings=settings | {"adc_bits": 16}) / 257  # 65535 / 255
    error = coarse - fine
    assert np.abs(error).max() <= 0.5 + 0.5 / 257
    assert error.mean() == pytest.approx(0, abs=STANDARD_ERRORS * np.sqrt(1 / 12 / error.size))
    assert error.var() == pytest.approx(1 / 12, rel=STANDARD_ERRORS * np.sqrt(0.8 / error.size) + 0.005)
    counts = np.histogram(error, 10, (-0.5, 0.5))[0] / error.size
    assert counts == pytest.approx(np.full(10, 0.1), abs=STANDARD_ERRORS * np.sqrt(0.09 / error.size) + 1 / 257)


@pytest.mark.parametrize("bits", sensor.ADC_BITS)
def test_the_range_of_the_adc_is_filled_and_not_left(bits):
    settings = TWELVE_BITS | {"adc_bits": bits, "read_noise_e": 50.0}
    assert raw(1e9, 0, 20, settings).max() == 2**bits - 1
    assert raw(1e9, 0, 20, settings | {"read_noise_e": 0.0}).min() == 2**bits - 1
    assert raw(0.0, 0, 20, settings | {"black_level_dn": 0, "dark_e": 0.0}).min() == 0
    assert sensor.raw_dn(even(1.0, 4), rng=np.random.default_rng(0), **settings).dtype == np.uint16


def test_dark_and_noiseless_is_the_black_level_and_black():
    settings = TWELVE_BITS | {"read_noise_e": 0.0, "dark_e": 0.0}
    dark = raw(0.0, 0, 8, settings)
    assert np.all(dark == 64)
    assert np.all(sensor.picture_from_dn(dark, **settings) == 0)


def test_control_without_a_black_level_the_dark_image_is_too_bright():
    settings = TWELVE_BITS | {"dark_e": 0.0}
    assert raw(0.0, 0, settings=settings).mean() == pytest.approx(64, abs=0.05)
    assert raw(0.0, 0, settings=settings | {"black_level_dn": 0}).mean() > 0.5


def test_gain_above_one_saturates_before_the_well_and_below_one_leaves_range_unused():
    quiet = TWELVE_BITS | {"read_noise_e": 0.0, "dark_e": 0.0}
    high, low = quiet | {"gain": 4.0}, quiet | {"gain": 0.5}
    assert sensor.Constants(**high).gain_dn_per_e == pytest.approx(4 * GAIN_DN_PER_E)
    assert np.all(raw(3000.0, 0, 8, high) == 4095)
    assert np.all(raw(1e9, 0, 8, low) == np.rint(64 + 0.5 * (4095 - 64)))
    for settings in (high, low):
        white = sensor.picture_from_dn(raw(1e9, 0, 8, settings), **settings)
        assert np.all(white == 255)


def test_the_full_well_ends_the_shot_noise():
    """EMVA 1288: the temporal noise falls at saturation of the pixel; left is what comes after the well."""
    settings = TWELVE_BITS | {"gain": 0.5, "dark_e": 0.0}
    _, variance, error = mean_and_variance(1e6, 0, settings)
    assert abs(variance - ((0.5 * GAIN_DN_PER_E * 4.0) ** 2 + 1 / 12)) < STANDARD_ERRORS * error


@pytest.mark.parametrize("settings", [TWELVE_BITS, TWELVE_BITS | {"mosaic": "GBRG"}], ids=["three bands", "mosaic"])
def test_raw_back_to_linear(settings):
    """Expected: the mean over many pixels of the linear picture is that of the noise-free one. Tolerance: Monte Carlo,
    the mosaic's with a quarter of the samples, correlated."""
    radiance = np.full((200, 200, 3), [3000.0, 1500.0, 4000.0])
    expected = sensor.linear_from_radiance(radiance, **settings)[0, 0]
    linear = sensor.linear_from_dn(sensor.raw_dn(radiance, rng=np.random.default_rng(0), **settings), **settings)
    std = sensor.noise_std_e(radiance, **settings)[0, 0] / (10000.0 - 25.0) * settings["white_balance"]
    assert np.all(np.abs(linear.mean(axis=(0, 1)) - expected) < STANDARD_ERRORS * std * 2 / 200)
    assert sensor.radiance_from_linear(expected, **settings) == pytest.approx(radiance[0, 0], rel=1e-6)


@pytest.mark.parametrize("settings", [TWELVE_BITS, EIGHT_BITS], ids=["12 bits", "8 bits"])
def test_the_noise_model_is_what_exposures_scatter_by(settings):
    """Setup: one radiance per band, 200 x 200 exposures. Expected: `noise_std_radiance`. Tolerance: Monte Carlo.
    Control: at 8 bits the model without ADC falls short of it."""
    radiance = np.full((200, 200, 3), [900.0, 100.0, 4000.0])
    predicted = sensor.noise_std_radiance(radiance, **settings)[0, 0]
    dn = sensor.raw_dn(radiance, rng=np.random.default_rng(3), **settings)
    linear = sensor.linear_from_dn(dn, **settings)
    seen = sensor.radiance_from_linear(linear, **settings).std(axis=(0, 1))
    bound = STANDARD_ERRORS * np.sqrt(0.5 / dn[..., 0].size)
    assert np.all(np.abs(seen / predicted - 1) < bound)
    if settings is EIGHT_BITS:
        without = sensor.noise_std_radiance(radiance, **settings | {"adc_bits": None, "black_level_dn": 0})[0, 0]
        assert np.any(np.abs(seen / without - 1) > bound)


def test_without_an_adc_the_noise_model_has_no_rounding():
    analog = {key: TWELVE_BITS[key] for key in ("electrons_per_radiance", "full_well_e", "white_balance")}
    std = sensor.noise_std_e(np.full((1, 1, 3), 100.0), read_noise_e=3.0, dark_e=7.0, **analog)
    assert std[0, 0] == pytest.approx(np.sqrt([100 + 16, 200 + 16, 50 + 16]))
    per_radiance = sensor.noise_std_radiance(np.full((1, 1, 3), 100.0), read_noise_e=3.0, dark_e=7.0, **analog)
    assert per_radiance[0, 0] == pytest.approx(std[0, 0] / [1.0, 2.0, 0.5])


def averaged(settings: dict, seeds: range) -> np.ndarray:
    return np.mean([raw(5000.0, seed, 100, settings) for seed in seeds], axis=0)


def test_the_fixed_pattern_belongs_to_the_sensor_and_not_to_the_frame():
    """Setup: means of 32 frames, two sets. Expected: with the same pattern seed correlated as the variances say, with
    another seed not at all (|r| < 4 / sqrt(n)); spatial variance (K mu prnu)^2 + (K dsnu)^2 beside the noise."""
    settings = TWELVE_BITS | {"prnu": 0.01, "dsnu_e": 20.0}
    one, again = averaged(settings, range(32)), averaged(settings, range(32, 64))
    other = averaged(settings | {"pattern_seed": 1}, range(64, 96))
    pattern = GAIN_DN_PER_E**2 * ((0.01 * 5000) ** 2 + 20.0**2)
    noise = (GAIN_DN_PER_E**2 * (5000 + 25 + 16) + 1 / 12) / 32
    bound = STANDARD_ERRORS / np.sqrt(one.size)
    assert np.corrcoef(one.ravel(), again.ravel())[0, 1] == pytest.approx(pattern / (pattern + noise), abs=bound)
    assert abs(np.corrcoef(one.ravel(), other.ravel())[0, 1]) < bound
    assert one.var() == pytest.approx(pattern + noise, rel=STANDARD_ERRORS * np.sqrt(2 / one.size))


def test_the_fixed_pattern_leaves_the_noise_of_a_frame_as_it_is():
    """DSNU is added after the noise: the same frame with and without it differs by the pattern, to the rounding."""
    difference = raw(5000.0, 0, 50, TWELVE_BITS | {"dsnu_e": 20.0}) - raw(5000.0, 0, 50)
    pattern = 20.0 * GAIN_DN_PER_E * sensor.fixed_pattern("dsnu", (50, 50, 3), pattern_seed=0)
    assert np.abs(difference - pattern).max() <= 1


def test_the_default_chain_is_electrons_over_full_well():
    """Byte by byte: what the camera stores without any of the options."""
    plain = {"full_well_e": 1000.0, "white_balance": np.array([1.5, 1.0, 2.0]), "electrons_per_radiance": np.ones(3)}
    radiance = np.random.default_rng(1).uniform(0, 1200, (30, 40, 3))
    rng = np.random.default_rng(0)
    electrons = np.minimum(rng.poisson(radiance), 1000.0) + 4.0 * rng.standard_normal(radiance.shape)
    expected = images.srgb_uint8_from_linear(electrons / 1000.0 * plain["white_balance"])
    assert np.array_equal(sensor.expose(radiance, rng=np.random.default_rng(0), read_noise_e=4.0, **plain), expected)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"adc_bits": 11}, "adc_bits = 11, allowed: 8, 10, 12, 14, 16"),
        ({"black_level_dn": -1}, "black_level_dn = -1, allowed: 0 to 4094"),
        ({"black_level_dn": 4095}, "black_level_dn = 4095, allowed: 0 to 4094"),
        ({"full_well_e": 0.0}, "full_well_e = 0.0, allowed: > 0"),
        ({"full_well_e": np.nan}, "full_well_e = nan, allowed: > 0"),
        ({"white_balance": [1.0, 0.0, 1.0]}, r"white_balance = \[1.0, 0.0, 1.0\], allowed: three numbers > 0"),
        ({"gain": 0.0}, "gain = 0.0, allowed: > 0"),
        ({"read_noise_e": -1.0}, "read_noise_e = -1.0, allowed: >= 0"),
        ({"prnu": 0.2}, "prnu = 0.2, allowed: 0 to 0.1"),
        ({"dark_e": 10000.0}, "dark current makes 10000 e- in the exposure, allowed: less than the 10000 e-"),
        ({"dark_e": 3000.0, "gain": 4.0}, "dark current makes 3000 e- in the exposure, allowed: less than the 2500 e-"),
        ({"adc_bits": None}, "black_level_dn, mosaic and a gain below 1 need adc_bits"),
        ({"mosaic": "RGBG"}, "mosaic: got 'RGBG', allowed: RGGB, BGGR, GRBG, GBRG"),
        ({"relative_illumination": np.ones((3, 4))}, r"image of shape \(4, 4, 3\), allowed: \(3, 4, 3\)"),
    ],
)
def test_sensors_that_do_not_exist_are_refused_in_one_line(change, message):
    with pytest.raises(ValueError, match=message) as caught:
        sensor.raw_dn(even(1.0, 4), rng=np.random.default_rng(0), **TWELVE_BITS | change)
    assert "\n" not in str(caught.value)


def test_raw_of_another_shape_or_range_is_refused():
    with pytest.raises(ValueError, match=r"raw DN of shape \(4, 4\), allowed: \(H, W, 3\)"):
        sensor.linear_from_dn(np.zeros((4, 4)), **TWELVE_BITS)
    with pytest.raises(ValueError, match=r"raw DN of shape \(4, 4, 3\), allowed: \(H, W\)"):
        sensor.linear_from_dn(np.zeros((4, 4, 3)), **TWELVE_BITS | {"mosaic": "RGGB"})
    with pytest.raises(ValueError, match="raw DN from 0 to 4096, allowed: 0 to 4095"):
        sensor.linear_from_dn(np.array([[[0, 1, 4096]]]), **TWELVE_BITS)
