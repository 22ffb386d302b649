"""Radiance errors and contrast transfer: exact on known pictures, and free of the truth's noise in the mean."""

import numpy as np
import pytest

from uwsim.metrics import contrast, radiance


@pytest.fixture
def picture():
    y, x = np.mgrid[:60, :80]
    return np.stack([1 + 0.5 * np.sin(x / 3), 2 + 0.5 * np.cos(y / 4), 0.5 + 0.01 * x], axis=-1)


def test_a_scaled_picture_is_off_by_the_scale(picture):
    assert radiance.relative_error(picture, 1.07 * picture) == pytest.approx(7, rel=1e-9)
    assert radiance.region_error(picture, 0.8 * picture) == pytest.approx(20, rel=1e-9)
    assert radiance.relative_error(picture, picture) == 0


def test_noise_of_the_truth_is_taken_off(picture):
    error = 0.2 * picture
    found, plain = [], []
    for seed in range(20):
        noisy = picture + error * np.random.default_rng(seed).standard_normal(picture.shape)
        found.append(radiance.relative_error(noisy, 1.05 * picture, standard_error=error))
        plain.append(radiance.relative_error(noisy, 1.05 * picture))
    # each known to 0.6 %, their mean to 0.14 %
    assert np.mean(found) == pytest.approx(5, abs=0.5)
    assert min(plain) > 15  # control: without the correction the noise is all there is


def test_resolution_is_what_noise_alone_makes(picture):
    error, found = 0.2 * picture, []
    for seed in range(200):
        noise = np.random.default_rng(seed).standard_normal(picture.shape[:2])[..., None]  # the same in all bands
        found.append(radiance.relative_error(picture + error * noise, picture, standard_error=error) ** 2)
    expected = radiance.resolution(picture, standard_error=error, batches=10**6)
    # half of the squared errors are cut off at 0: mean of the others sigma / sqrt(2 pi)
    assert np.mean(found) == pytest.approx(expected**2 / np.sqrt(2 * np.pi), rel=0.25)


def test_region_means_are_means(picture):
    means = radiance.region_means(picture)
    assert means.shape == (8, 8, 3)
    assert means[0, 0] == pytest.approx(picture[:7, :10].mean(axis=(0, 1)))
    assert means[7, 7] == pytest.approx(picture[52:, 70:].mean(axis=(0, 1)))
    with pytest.raises(ValueError, match="at least 8 px"):
        radiance.region_means(picture[:4])


def test_a_truth_without_light_has_no_error():
    black = np.zeros((8, 8, 3))
    assert np.isnan(radiance.relative_error(black, black + 1))
    assert np.isnan(radiance.noise_share(black, standard_error=black))
    with pytest.raises(ValueError, match="allowed"):
        radiance.relative_error(black, black[:4])


def pattern():
    rng = np.random.default_rng(0)
    return 1 + 0.5 * (rng.random((96, 128)) > 0.5)


EDGES = np.array([0.06, 0.12, 0.24, 0.4])


def test_a_veil_takes_contrast_evenly():
    reference = pattern()
    veiled = 0.5 * reference + 0.5 * reference.mean()
    found = contrast.transfer(veiled, reference, edges=EDGES)
    assert found.value == pytest.approx([0.5] * 3, rel=1e-9)


def test_a_blur_takes_contrast_by_its_mtf():
    reference, frequency = pattern(), np.hypot(*np.meshgrid(np.fft.fftfreq(128), np.fft.fftfreq(96)))
    blurred = np.fft.ifft2(np.fft.fft2(reference) * np.exp(-6 * frequency)).real
    found = contrast.transfer(blurred, reference, edges=EDGES)
    inside = [(frequency >= low) & (frequency < high) for low, high in zip(EDGES, EDGES[1:], strict=False)]
    # model tolerance: the window mixes neighbouring frequencies, and the bins' weights are those of a random pattern
    assert found.value == pytest.approx([np.exp(-6 * frequency[one]).mean() for one in inside], rel=0.06)


def test_noise_neither_adds_nor_takes_contrast_and_is_stated():
    reference, values = pattern(), []
    for seed in range(40):
        noisy = reference + 0.5 * np.random.default_rng(seed).standard_normal(reference.shape)
        found = contrast.transfer(noisy, reference, edges=EDGES, standard_error=0.5)
        values.append(found.value)
    assert np.mean(values, axis=0) == pytest.approx([1] * 3, abs=4 * found.standard_error.max() / np.sqrt(40))
    # 40 replicates know a spread to 11 %
    assert np.std(values, axis=0) == pytest.approx(found.standard_error, rel=0.4)


def test_transfer_error_looks_at_known_bins_only():
    known = contrast.Transfer(EDGES, np.array([0.5, 0.2, 0.1]), np.array([0.01, 0.01, 0.09]))
    other = contrast.Transfer(EDGES, np.array([0.6, 0.2, 0.9]), np.zeros(3))
    assert contrast.transfer_error(known, other) == pytest.approx(10)
    assert np.isnan(contrast.transfer_error(contrast.Transfer(EDGES, known.value, known.value), other))
