"""The statement of a denoiser's bias on made-up layers whose truth is known. Nothing is rendered."""

import numpy as np
import pytest

from uwsim.dataset.recipe import Recipe
from uwsim.render import smooth
from uwsim.render.accumulate import Sums
from uwsim.validation import validated

SHAPE = (48, 64, 3)


def truth() -> np.ndarray:
    x = np.linspace(0, 1, SHAPE[1])[None, :, None]
    edge = np.where(np.arange(SHAPE[0]) < 20, 1.0, 2.0)[:, None, None]
    return 1e-3 * (1 + x) * edge * np.array([1.0, 0.8, 0.6])


def sums(rng: np.random.Generator, *, batches: int = 5, noise: float = 0.5) -> tuple[Sums, np.ndarray]:
    """Return sums as `smooth.HalvedAccumulator` has them: both layers alike, and a constant direct layer."""
    image, total, odd = truth(), np.zeros((4, *SHAPE)), np.zeros((2, *SHAPE))
    for batch in range(batches):
        layers = [image * (1 + noise * rng.standard_normal(SHAPE)) for _ in smooth.DENOISED]
        mean = np.stack([image + sum(layers), image, *layers])
        total += mean
        odd += mean[2:] * (batch % 2)
    both = np.concatenate([total, odd])
    regions = np.zeros((8, 8, 3))
    return Sums(batches, both, both**2, regions, regions), image


def stated(monkeypatch, denoiser, *, seeds=40, **options):
    """Return the stated biases of the backscatter over seeds, the true ones, and the images."""
    monkeypatch.setattr(smooth, "denoised", denoiser)
    biases, images = [], []
    for seed in range(seeds):
        made, _ = sums(np.random.default_rng(seed), **options)
        pictures = dict(zip(("direct", *smooth.DENOISED), smooth.whole(made).means[1:], strict=True))
        found, bias = smooth.denoise_layers(pictures, made)
        biases.append(bias["backscatter"])
        images.append(found["backscatter"])
    return biases, np.stack(images).astype(float)


def blurred(layer):
    from scipy import ndimage

    return ndimage.uniform_filter(layer, (7, 7, 1), mode="nearest")


def squares(biases, name):
    return np.array([getattr(bias, name) for bias in biases]) ** 2


def test_a_blur_is_stated_as_it_is(monkeypatch):
    """Expected: mean of the squares over seeds equals the true bias and error of the blur. Tolerance: 4 standard errors
    over the seeds (at most a quarter of the value). Negative control: the noise before it is not what is stated."""
    biases, images = stated(monkeypatch, blurred)
    scale = truth().mean()
    bias = np.mean((blurred(truth()) - truth()) ** 2) / scale**2
    error = np.mean((images - truth()) ** 2) / scale**2
    noise = np.mean((0.5 * truth()) ** 2) / 5 / scale**2
    for name, expected in (("pixel", bias), ("pixel_error", error), ("pixel_error_before", noise)):
        found = squares(biases, name)
        spread = found.std(ddof=1) / np.sqrt(len(found))
        assert spread < expected / 16, "no power"
        assert abs(found.mean() - expected) < 4 * spread + 1e-3 * expected
    assert error < noise / 3


def test_a_filter_that_does_nothing_has_no_bias(monkeypatch):
    biases, images = stated(monkeypatch, lambda layer: layer, seeds=8)
    for bias in biases:
        assert bias.pixel < 1e-6 and bias.region < 1e-6
        assert np.abs(bias.mean).max() < 1e-6
        assert bias.pixel_error == pytest.approx(bias.pixel_error_before, rel=1e-4)


@pytest.mark.parametrize("batches", [2, 5, 8])
def test_a_filter_that_takes_light_away_is_found_out(monkeypatch, batches):
    """Expected: a tenth less in the mean and in the regions, whatever the number of batches."""
    biases, _ = stated(monkeypatch, lambda layer: 0.9 * layer, seeds=8, batches=batches)
    regions = smooth.region_means(truth())
    expected = 0.1 * np.sqrt(np.mean(regions**2)) / truth().mean()
    for bias in biases:
        np.testing.assert_allclose(bias.mean, -0.1, rtol=1e-6)
        assert bias.region == pytest.approx(expected, rel=0.1)


def test_only_the_smooth_layers_change_and_the_image_is_their_sum(monkeypatch):
    monkeypatch.setattr(smooth, "denoised", blurred)
    made, image = sums(np.random.default_rng(0))
    pictures = dict(zip(("direct", *smooth.DENOISED), smooth.whole(made).means[1:], strict=True))
    found, _ = smooth.denoise_layers(pictures, made)
    assert np.array_equal(found["direct"], pictures["direct"])
    assert not np.array_equal(found["forward_scatter"], pictures["forward_scatter"])
    assert np.array_equal(found["radiance"], found["direct"] + found["forward_scatter"] + found["backscatter"])


def test_a_black_layer_stays_black(monkeypatch):
    monkeypatch.setattr(smooth, "denoised", blurred)
    made, _ = sums(np.random.default_rng(0))
    made.sums[...] = 0
    found, biases = smooth.denoise_layers(dict.fromkeys(("direct", *smooth.DENOISED), np.zeros(SHAPE)), made)
    assert not found["radiance"].any()
    assert biases["backscatter"].region == 0


def test_a_missing_denoiser_is_one_line_with_the_command(monkeypatch):
    monkeypatch.setattr(smooth, "PACKAGE", "no_such_package_here")
    with pytest.raises(ValueError, match="pip install no_such_package_here"):
        smooth.require_denoiser()


def test_a_recipe_asks_for_options_and_has_none_by_default():
    group = {"name": "one", "scene": "tank_markers", "frames": 1}
    values = {"name": "test", "description": "", "seed": 1, "samples_per_pixel": 4, "batches": 2, "group": [group]}
    assert validated(Recipe, values, where="test").options == smooth.Options()
    asked = validated(Recipe, values | {"orders": True, "denoise": True}, where="test").options
    assert asked == smooth.Options(orders=True, denoise=True)
