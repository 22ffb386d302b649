"""The colour of the light: Gray World and Shades of Gray; the ambient light of the dark channel."""

import numpy as np
import pytest

from uwsim.restoration import ambient_light
from uwsim.restoration.colour_constancy import LARGEST_GAIN, gains, gray_world, light, shades_of_gray


def picture(seed=0):
    """Return a picture under bluish light, (30, 40, 3) float64, and that light."""
    cast = np.array([0.4, 0.7, 0.9])
    return np.random.default_rng(seed).random((30, 40, 1)) * cast, cast


@pytest.mark.parametrize("norm", [1.0, 2.5, 6.0])
def test_light_is_the_norm_of_each_channel(norm):
    image = np.random.default_rng(1).random((20, 30, 3))
    expected = np.mean(image**norm, axis=(0, 1)) ** (1 / norm)
    np.testing.assert_allclose(light(image, norm=norm), expected, rtol=1e-9)
    np.testing.assert_allclose(light(image.astype(np.float32), norm=norm), expected, rtol=1e-5)
    assert np.abs(light(image, norm=norm + 1) - expected).max() > 0.01


def test_high_norms_of_dark_pictures_do_not_vanish():
    image = np.full((8, 8, 3), 1e-9, np.float32)
    np.testing.assert_allclose(light(image, norm=20.0), 1e-9, rtol=1e-4)


@pytest.mark.parametrize("method", [gray_world, shades_of_gray])
def test_a_cast_on_grey_is_removed_and_the_brightness_kept(method):
    image, _ = picture()
    found = method(image)
    assert np.ptp(found, axis=2).max() < 1e-9
    assert np.ptp(image, axis=2).max() > 0.3
    norm = 1.0 if method is gray_world else 6.0
    np.testing.assert_allclose(light(found, norm=norm), light(image, norm=norm).mean(), rtol=1e-9)
    assert method(image.astype(np.float32)).dtype == np.float32


def test_one_bright_object_turns_the_mean_less_than_the_sixth_norm():
    image = np.full((30, 40, 3), 0.3)
    image[:5, :5] = (1.0, 0.3, 0.3)
    assert light(image, norm=6.0)[0] / 0.3 > light(image, norm=1.0)[0] / 0.3 + 0.2


def test_an_empty_channel_stays_empty_and_gains_are_limited():
    image, _ = picture()
    image[..., 0] = 0
    assert np.all(shades_of_gray(image)[..., 0] == 0)
    assert gains(np.array([0.0, 0.5, 0.5]))[0] == LARGEST_GAIN
    np.testing.assert_allclose(gains(np.array([1e-3, 0.5, 0.5]), least=0.9, largest=3.0), [3.0, 0.9, 0.9])
    np.testing.assert_allclose(gains(np.array([0.2, 0.4, 0.6])), [2.0, 1.0, 2 / 3])


@pytest.mark.parametrize(
    "image, norm, problem",
    [
        (np.zeros((4, 4)), 6.0, "shape|image"), (np.zeros((4, 4, 3), np.uint8), 6.0, "uint8"),
        (np.full((4, 4, 3), -0.1), 6.0, "negative"), (np.full((4, 4, 3), np.nan), 6.0, "NaN"),
        (np.full((4, 4, 3), np.inf), 6.0, "infinity"), (np.zeros((4, 4, 3)), 0.5, "norm"),
        (np.zeros((0, 4, 3)), 6.0, "pixels"),
    ],
)  # fmt: skip
def test_refuses(image, norm, problem):
    with pytest.raises(ValueError, match=problem):
        light(image, norm=norm)


class TestAmbientLight:
    def test_is_the_mean_where_the_dark_channel_is_highest_channel_by_channel(self):
        image = np.full((50, 40, 3), 0.1, np.float32)
        image[7, :2] = (0.2, 0.5, 0.4), (0.4, 0.7, 0.6)
        dark = image.min(axis=2)
        np.testing.assert_allclose(ambient_light.from_dark_channel(image, dark), [0.3, 0.6, 0.5], rtol=1e-6)
        one = ambient_light.from_dark_channel(image, dark, share=1e-9)
        np.testing.assert_allclose(one, [0.4, 0.7, 0.6], rtol=1e-6)

    def test_equal_pixels_all_count(self):
        image = np.full((10, 10, 3), 0.3, np.float32)
        assert ambient_light.brightest(image.min(axis=2), image).all()

    def test_refuses(self):
        image = np.zeros((4, 5, 3))
        for dark, share in ((np.zeros((5, 4)), 0.1), (np.zeros((4, 5)), 0), (np.full((4, 5), np.nan), 0.1)):
            with pytest.raises(ValueError, match="ambient light"):
                ambient_light.from_dark_channel(image, dark, share=share)
