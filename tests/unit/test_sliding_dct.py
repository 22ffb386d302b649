"""Denoising by shrinking cosine transforms: what stays, what goes, and against a library's denoiser."""

import numpy as np
import pytest

from uwsim.restoration.sliding_dct import denoised


def picture(side_px: int = 128) -> np.ndarray:
    from skimage import data

    grey = data.camera()[160 : 160 + side_px, 160 : 160 + side_px] / 255
    return (grey[..., None] * np.array([1.0, 0.8, 0.6])).astype(np.float32)


def noisy(clean: np.ndarray, std: float, seed: int = 0) -> np.ndarray:
    return clean + np.float32(std) * np.random.default_rng(seed).standard_normal(clean.shape).astype(np.float32)


def mse(one: np.ndarray, other: np.ndarray) -> float:
    return float(np.mean(np.square(one - other)))


def test_without_noise_a_picture_comes_back():
    clean = picture()
    np.testing.assert_allclose(denoised(clean, np.full(clean.shape, 1e-12)), clean, atol=1e-5)


@pytest.mark.parametrize("std", [0.02, 0.1])
def test_better_than_means_over_patches(std):
    """Non-local means of scikit-image, told the same noise, are the peer."""
    from skimage.restoration import denoise_nl_means

    clean = picture()
    seen = noisy(clean, std)
    peer = denoise_nl_means(seen, patch_size=5, patch_distance=9, h=0.7 * std, sigma=std, channel_axis=2)
    found = mse(denoised(seen, np.full(clean.shape, std**2)), clean)
    assert found < 0.85 * mse(peer, clean)
    assert found < 0.3 * std**2


def test_noise_alone_goes_and_no_light_is_lost():
    clean = np.full((96, 128, 3), 0.5, np.float32)
    seen = noisy(clean, 0.1)
    found = denoised(seen, np.full(clean.shape, 0.01))
    assert mse(found, clean) < 0.02 * 0.01
    # Monte Carlo: the mean of 12288 pixels is known to 0.1 / sqrt(12288) = 0.0009
    assert abs(found.mean() - 0.5) < 0.002
    # control: called certain, it stays
    assert mse(denoised(seen, np.full(clean.shape, 1e-8)), clean) > 0.9 * 0.01


def test_noise_that_differs_across_the_picture():
    clean = picture()
    std = np.linspace(0.02, 0.2, clean.shape[1], dtype=np.float32)[None, :, None]
    seen = clean + std * np.random.default_rng(3).standard_normal(clean.shape).astype(np.float32)
    told = denoised(seen, np.broadcast_to(std**2, clean.shape))
    one = denoised(seen, np.full(clean.shape, np.mean(std**2)))
    assert mse(told, clean) < 0.9 * mse(one, clean)


def test_an_edge_stays_sharp():
    clean = np.full((64, 64, 3), 0.2, np.float32)
    clean[:, 32:] = 0.8
    found = denoised(noisy(clean, 0.05), np.full(clean.shape, 0.0025)).mean(axis=(0, 2))
    assert found[33] - found[30] > 0.55


def test_sizes_that_no_block_divides_and_smaller_ones():
    for shape in ((37, 51, 3), (9, 11, 3)):
        clean = np.broadcast_to(np.linspace(0, 1, shape[1], dtype=np.float32)[None, :, None], shape)
        found = denoised(clean, np.full(shape, 1e-10))
        assert found.shape == shape
        np.testing.assert_allclose(found, clean, atol=1e-4)


@pytest.mark.parametrize(
    "image, variance",
    [
        (np.zeros((8, 8)), np.ones((8, 8))),
        (np.zeros((8, 8, 3)), np.ones((8, 9, 3))),
        (np.zeros((8, 8, 3)), np.zeros((8, 8, 3))),
        (np.full((8, 8, 3), np.nan), np.ones((8, 8, 3))),
        (np.zeros((8, 8, 3)), np.full((8, 8, 3), np.inf)),
    ],
)
def test_refuses_what_is_no_picture_or_no_noise(image, variance):
    with pytest.raises(ValueError, match="denoised: .*allowed"):
        denoised(image, variance)
