"""The statement of a denoiser's bias on made-up layers whose truth is known. Nothing is rendered."""

import numpy as np
import pytest

from uwsim.dataset.recipe import Recipe
from uwsim.render import smooth
from uwsim.render.accumulate import Sums
from uwsim.validation import validated

SHAPE = (48, 64, 3)
SURFACES = smooth.Surfaces(albedo=np.ones(SHAPE), normal=np.zeros(SHAPE, np.float32))


def truth() -> np.ndarray:
    x = np.linspace(0, 1, SHAPE[1])[None, :, None]
    edge = np.where(np.arange(SHAPE[0]) < 20, 1.0, 2.0)[:, None, None]
    return 1e-3 * (1 + x) * edge * np.array([1.0, 0.8, 0.6])


def sums(rng: np.random.Generator, *, batches: int = 5, noise: float = 0.5) -> tuple[Sums, np.ndarray]:
    """Return sums as `smooth.HalvedAccumulator` has them: scattered light of all layers alike, unscattered constant."""
    image, total, odd = truth(), np.zeros((6, *SHAPE)), np.zeros((3, *SHAPE))
    for batch in range(batches):
        on_body, forward, back = (image * (1 + noise * rng.standard_normal(SHAPE)) for _ in smooth.DENOISED)
        total += np.stack([image + on_body + forward + back, image + on_body, forward, back, image, back])
        odd += np.stack([on_body, forward, back]) * (batch % 2)
    both = np.concatenate([total, odd])
    regions = np.zeros((8, 8, 3))
    return Sums(batches, both, both**2, regions, regions), image


def pictures(made: Sums) -> dict[str, np.ndarray]:
    names = (*smooth.DENOISED, "direct_unscattered", "backscatter_single")
    return dict(zip(names, smooth.whole(made).means[1:], strict=True))


def stated(monkeypatch, denoiser, *, seeds=40, **options):
    """Return the stated biases of the backscatter over seeds, the true ones, and the images."""
    monkeypatch.setattr(smooth, "denoised", denoiser)
    biases, images = [], []
    for seed in range(seeds):
        made, _ = sums(np.random.default_rng(seed), **options)
        found, bias = smooth.denoise_layers(pictures(made), made, SURFACES)
        biases.append(bias["backscatter"])
        images.append(found["backscatter"])
    return biases, np.stack(images).astype(float)


def blurred(layer, normal=None):
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
    biases, images = stated(monkeypatch, lambda layer, normal=None: layer, seeds=8)
    for bias in biases:
        assert bias.pixel < 1e-6 and bias.region < 1e-6
        assert np.abs(bias.mean).max() < 1e-6
        assert bias.pixel_error == pytest.approx(bias.pixel_error_before, rel=1e-4)


@pytest.mark.parametrize("batches", [2, 5, 8])
def test_a_filter_that_takes_light_away_is_found_out(monkeypatch, batches):
    """Expected: a tenth less in the mean and in the regions, whatever the number of batches."""
    biases, _ = stated(monkeypatch, lambda layer, normal=None: 0.9 * layer, seeds=8, batches=batches)
    regions = smooth.region_means(truth())
    expected = 0.1 * np.sqrt(np.mean(regions**2)) / truth().mean()
    for bias in biases:
        np.testing.assert_allclose(bias.mean, -0.1, rtol=1e-6)
        assert bias.region == pytest.approx(expected, rel=0.1)


def test_only_scattered_light_changes_and_the_image_is_the_sum_of_the_layers(monkeypatch):
    """Expected: unscattered light stays, so that the direct layer changes by what its scattered part does."""
    monkeypatch.setattr(smooth, "denoised", blurred)
    made, image = sums(np.random.default_rng(0))
    before = pictures(made)
    found, biases = smooth.denoise_layers(before, made, SURFACES)
    assert np.array_equal(found["direct_unscattered"], before["direct_unscattered"])
    change = blurred(before["direct"] - image) - (before["direct"] - image)
    np.testing.assert_allclose(found["direct"], before["direct"] + change, rtol=1e-5)
    assert not np.array_equal(found["forward_scatter"], before["forward_scatter"])
    # relative to the whole layer, of which half is not touched
    assert biases["direct"].pixel_error_before == pytest.approx(biases["backscatter"].pixel_error_before / 2, rel=0.2)
    assert np.array_equal(found["radiance"], found["direct"] + found["forward_scatter"] + found["backscatter"])


def test_in_motion_the_direct_layer_stays(monkeypatch):
    monkeypatch.setattr(smooth, "denoised", blurred)
    made, _ = sums(np.random.default_rng(0))
    before = pictures(made)
    found, biases = smooth.denoise_layers(before, made, None)
    assert np.array_equal(found["direct"], before["direct"]) and set(biases) == {"forward_scatter", "backscatter"}


def test_light_on_bodies_keeps_their_texture(monkeypatch):
    """Setup: even light on a chequered body. Expected: a blur leaves the picture as it is, for it is the light that is
    blurred; where no body is seen too. Control: without the albedo the chequers are gone."""
    monkeypatch.setattr(smooth, "denoised", blurred)
    albedo = np.where(np.indices(SHAPE[:2]).sum(axis=0) % 2, 0.8, 0.1)[..., None] * np.ones(3)
    albedo[:, -4:] = 0
    picture = 2e-3 * albedo
    surfaces = smooth.Surfaces(albedo=albedo, normal=np.zeros(SHAPE, np.float32))
    kept = smooth._light_on_bodies(surfaces)(picture)
    np.testing.assert_allclose(kept[:, :-8], picture[:, :-8], rtol=1e-5)
    assert np.ptp(blurred(picture)[:, 8:-16]) < 0.2 * np.ptp(picture)


def test_a_black_layer_stays_black(monkeypatch):
    monkeypatch.setattr(smooth, "denoised", blurred)
    made, _ = sums(np.random.default_rng(0))
    made.sums[...] = 0
    found, biases = smooth.denoise_layers(pictures(made), made, SURFACES)
    assert not found["radiance"].any()
    assert biases["backscatter"].region == 0


def test_a_missing_denoiser_is_one_line_with_the_command(monkeypatch):
    monkeypatch.setattr(smooth, "PACKAGE", "no_such_package_here")
    with pytest.raises(ValueError, match="pip install no_such_package_here"):
        smooth.require_denoiser()


def test_a_recipe_asks_for_options_and_has_none_by_default():
    group = {"name": "one", "scene": "tank_markers", "frames": 1}
    values = {"name": "test", "description": "", "seed": 1, "samples_per_pixel": 4, "batches": 2, "group": [group]}
    plain = validated(Recipe, values, where="test")
    assert plain.options_of(plain.group[0]) == smooth.Options()
    other = group | {"name": "two", "denoise": False}
    asked = validated(Recipe, values | {"orders": True, "denoise": True, "group": [group, other]}, where="test")
    first, second = (asked.options_of(one) for one in asked.group)
    assert first == smooth.Options(orders=True, denoise=True)
    assert second == smooth.Options(orders=True)
