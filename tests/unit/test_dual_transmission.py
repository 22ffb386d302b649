"""The dual-transmission restoration: each formula on inputs with a known answer, the switches, monochrome water."""

import dataclasses

import numpy as np
import pytest

from uwsim.restoration import dim_channels
from uwsim.restoration import dual_transmission as core
from uwsim.restoration.algorithms import dual_transmission, dual_transmission_as_printed

AMBIENT = np.array([0.35, 0.55, 0.5])


def planes_of(image):
    return {channel: np.ascontiguousarray(image[..., channel], np.float32) for channel in range(3)}


def hazy(*, darkest, brightest, transmission, seed=0):
    """Return I = J t + A (1 - t), (60, 80, 3), of objects J in a range."""
    objects = np.random.default_rng(seed).uniform(darkest, brightest, (60, 80, 3))
    return objects * transmission + AMBIENT * (1 - transmission)


def picture(height=120, width=160, seed=0):
    """Return a smooth 8-bit picture under a green veil that thickens to the right."""
    import cv2

    coarse = np.random.default_rng(seed).random((12, 16, 3)).astype(np.float32)
    objects = cv2.resize(coarse, (width, height), interpolation=cv2.INTER_CUBIC).clip(0, 1)
    objects *= 0.15
    transmission = np.linspace(0.8, 0.05, width)[:, None]
    return (255 * (objects * transmission + np.array([0.2, 0.6, 0.5]) * (1 - transmission))).round().astype(np.uint8)


class TestBound:
    @pytest.mark.parametrize("transmission", [0.15, 0.4, 0.8])
    def test_lies_below_the_true_transmission_and_near_it_in_full_contrast(self, transmission):
        image = hazy(darkest=core.DARKEST, brightest=1.0, transmission=transmission)
        found = core.bound(planes_of(image), AMBIENT)
        assert found.max() <= transmission + 1e-5
        assert np.median(found) > 0.9 * transmission

    def test_control_impossible_radiances_break_it(self):
        image = hazy(darkest=0.0, brightest=core.BRIGHTEST + 0.5, transmission=0.4)
        assert core.bound(planes_of(image), AMBIENT).max() > 0.45

    def test_of_one_value_is_the_printed_ratio(self):
        image = np.full((20, 20, 3), AMBIENT)
        image[..., 1] = 0.2
        expected = (0.55 - 0.2) / (0.55 - core.DARKEST)
        np.testing.assert_allclose(core.bound(planes_of(image), AMBIENT), expected, rtol=1e-5)
        image[..., 1] = 0.9
        expected = (0.9 - 0.55) / (core.BRIGHTEST - 0.55)
        np.testing.assert_allclose(core.bound(planes_of(image), AMBIENT), expected, rtol=1e-5)

    def test_stays_in_its_range_where_the_ambient_light_is_black(self):
        found = core.bound(planes_of(np.random.default_rng(0).random((20, 20, 3))), np.zeros(3))
        assert found.min() >= 0
        assert found.max() <= 1


class TestContrastAndFusion:
    def test_stripes_have_the_contrast_of_michelson(self):
        stripes = np.where(np.arange(40) % 4 < 2, 0.2, 0.6) * np.ones((30, 1))
        np.testing.assert_allclose(core.local_contrast(stripes.astype(np.float32)), 0.5, rtol=1e-5)
        assert np.all(core.local_contrast(np.full((9, 9), 0.4, np.float32)) == 0)
        assert np.all(core.local_contrast(np.zeros((9, 9), np.float32)) == 0)

    def test_power_keeps_the_bound_that_the_printed_factor_breaks(self):
        planes = planes_of(hazy(darkest=core.DARKEST, brightest=1.0, transmission=0.4))
        lowest, contrast = core.bound(planes, AMBIENT), core.local_contrast(core.grey(planes))
        assert np.all(core.fused(planes, AMBIENT, core.Steps()) >= lowest)
        printed = np.maximum(lowest, contrast) * dual_transmission_as_printed.GAMMA_1
        assert np.any(printed < lowest)

    def test_each_map_alone(self):
        planes = planes_of(hazy(darkest=0.2, brightest=0.9, transmission=0.6))
        alone = core.fused(planes, AMBIENT, core.Steps(contrast=False, exponent=1.0))
        np.testing.assert_allclose(alone, core.bound(planes, AMBIENT), rtol=1e-6)
        alone = core.fused(planes, AMBIENT, core.Steps(boundary=False, exponent=1.0))
        np.testing.assert_allclose(alone, core.local_contrast(core.grey(planes)), rtol=1e-6)


class TestLight:
    def test_the_veil_is_found_and_made_neutral(self):
        image = np.full((60, 80, 3), 0.05, np.float32)
        image[:30] = (0.3, 0.6, 0.6)
        planes = [np.ascontiguousarray(image[..., channel]) for channel in range(3)]
        gains, ambient = core.light(planes, (0, 1, 2), colour=True, norm=6.0)
        np.testing.assert_allclose(gains, 0.5 / np.array([0.3, 0.6, 0.6]), rtol=1e-4)
        # of the corrected picture, 0.5 in one half and next to nothing in the other: (0.5^6 / 2)^(1/6)
        np.testing.assert_allclose(ambient, 0.5 * 0.5 ** (1 / 6), rtol=1e-3)
        gains, ambient = core.light(planes, (0, 1, 2), colour=False, norm=6.0)
        np.testing.assert_allclose(gains, 1)
        np.testing.assert_allclose(ambient, [0.3, 0.6, 0.6], rtol=1e-5)

    def test_gains_are_limited(self):
        planes = [np.full((20, 20), level, np.float32) for level in (0.01, 0.9, 0.02)]
        gains, _ = core.light(planes, (0, 1, 2), colour=True, norm=6.0)
        np.testing.assert_allclose(gains, [3.0, 0.31 / 0.9, 3.0], rtol=1e-5)

    def test_a_printed_maximum_over_channels_corrects_nothing(self):
        image = np.full((40, 40, 3), (0.2, 0.6, 0.5), np.float32)
        corrected, _ = dual_transmission_as_printed.colour_corrected(image)
        np.testing.assert_array_equal(corrected, image)


class TestVeil:
    def planes(self, darkest):
        """Return a picture of mean 0.5 with 2 % of pixels at a level."""
        plane = np.full((50, 60), (0.5 - 0.02 * darkest) / 0.98, np.float32)
        plane[-1] = darkest
        return [plane, plane * np.float32(0.5), plane * np.float32(0.2)]

    def test_is_the_darkest_over_the_mean_full_at_six_tenths(self):
        assert core.veil(self.planes(0.15)) == pytest.approx(0.5, rel=1e-4)
        assert core.veil(self.planes(0.32)) == core.veil(self.planes(0.45)) == 1
        # a shadow as black as can be leaves a little of the method
        assert core.veil(self.planes(0.0)) == pytest.approx(0.07)

    def test_a_clear_picture_is_stretched_less(self):
        planes = planes_of(hazy(darkest=0.2, brightest=0.6, transmission=0.4))
        strong, weak = (core.fused(planes, AMBIENT, core.Steps(), strength=strength) for strength in (1.0, 0.2))
        np.testing.assert_allclose(weak, strong**0.2, rtol=1e-5)
        assert weak.min() > 1.2 * strong.min()

    def test_of_a_black_picture(self):
        assert core.veil([np.zeros((4, 5), np.float32)] * 3) == 0


class TestSolved:
    def test_undoes_the_model(self):
        objects = np.linspace(0.1, 0.9, 50, dtype=np.float32).reshape(5, 10)
        image = objects * np.float32(0.4) + np.float32(0.5 * 0.6)
        found = core._solved(image, np.full((5, 10), 0.4, np.float32), 0.5)
        assert np.abs(found - 255 * objects).max() <= 0.51

    def test_far_pixels_go_to_the_ambient_light_and_by_the_printed_formula_to_black(self):
        """J = 0.5, A = 0.3, t = 0.02, t0 = 0.1: 0.34 instead of 0.10."""
        image = np.full((4, 4, 3), 0.5 * 0.02 + 0.3 * 0.98, np.float32)
        found = core._solved(np.ascontiguousarray(image[..., 0]), np.full((4, 4), 0.1, np.float32), 0.3)
        assert np.abs(found / 255 - 0.34).max() < 0.003
        ambient = np.full(3, 0.3)
        printed = dual_transmission_as_printed.solved(image, np.full((4, 4, 1), 0.02, np.float32), ambient)
        np.testing.assert_allclose(printed, 0.1, atol=1e-4)


class TestSteps:
    def test_every_switch_changes_the_picture(self):
        image = picture()
        whole = dual_transmission.restore(image)
        for change in (
            {"colour": False}, {"boundary": False}, {"contrast": False}, {"exponent": 0.9}, {"refine": False},
            {"floor": 0.9}, {"clip_limit": 0.0}, {"norm": 8.0}, {"share": 0.001}, {"adaptive": False},
        ):  # fmt: skip
            assert np.any(dual_transmission.restore(image, **change) != whole), change
        # all channels of this picture are held
        np.testing.assert_array_equal(dual_transmission.restore(image, monochrome=False), whole)

    @pytest.mark.parametrize(
        "change",
        [
            {"boundary": False, "contrast": False}, {"exponent": 0.0}, {"floor": 1.5}, {"clip_limit": -1.0},
            {"clip_limit": np.nan}, {"norm": 0.0}, {"colour": "no"}, {"share": 0.0}, {"adaptive": 1},
        ],
    )  # fmt: skip
    def test_refuses(self, change):
        (name, *_) = change
        with pytest.raises(ValueError, match=name):
            dual_transmission.restore(picture(), **change)

    def test_refuses_other_images(self):
        for image in (picture()[..., 0], picture() / 255, picture()[:0]):
            with pytest.raises(ValueError, match="allowed"):
                dual_transmission.restore(image)

    def test_are_frozen(self):
        with pytest.raises(dataclasses.FrozenInstanceError):
            core.Steps().floor = 0.2


def test_contrast_rises_and_the_cast_goes():
    image = picture()
    found = dual_transmission.restore(image)

    def cast(values):
        return np.ptp(values.mean(axis=(0, 1)))

    assert found.std(axis=(0, 1)).mean() > 1.2 * image.std(axis=(0, 1)).mean()
    assert cast(found) < 0.5 * cast(image)
    assert cast(dual_transmission.restore(image, colour=False)) > 0.5 * cast(image), "control: without colour"


@pytest.mark.parametrize("shape", [(1, 1), (4, 1), (1, 4), (5, 700), (300, 260)])
def test_any_size(shape):
    image = np.random.default_rng(0).integers(0, 256, (*shape, 3), dtype=np.uint8)
    assert dual_transmission.restore(image).shape == image.shape


class TestMonochromeWater:
    def water(self):
        """Return (8-bit picture with a pattern in green, faint noise in blue, no red; the pattern)."""
        rng = np.random.default_rng(0)
        pattern = (np.add.outer(np.arange(240) // 24, np.arange(320) // 24) % 2).astype(float)
        image = np.zeros((240, 320, 3), np.uint8)
        image[..., 1] = 80 + 25 * pattern
        image[..., 2] = rng.integers(0, 12, pattern.shape)
        return image, pattern

    def test_the_signal_is_raised_and_nothing_else(self):
        image, pattern = self.water()
        found = dual_transmission.restore(image)
        assert np.ptp(found.astype(int), axis=2).max() <= 3, "grey but for rounding in Lab"
        grey = found.mean(axis=2)
        assert np.corrcoef(grey.ravel(), pattern.ravel())[0, 1] > 0.95
        assert grey[pattern == 1].mean() - grey[pattern == 0].mean() > 40

    def test_control_without_the_branch_noise_enters(self):
        image, pattern = self.water()
        found = dual_transmission.restore(image, monochrome=False)
        assert np.ptp(found.astype(int), axis=2).max() > 30

    def test_held_channels(self):
        def held(*levels):
            return dim_channels.held_channels([np.full((4, 4), level, np.float32) for level in levels])

        assert held(0.0, 0.4, 0.05) == (1,)
        assert held(0.02, 0.4, 0.5) == (1, 2)
        assert held(0.3, 0.4, 0.5) == (0, 1, 2)
        assert held(0.0, 0.0, 0.0) == (0, 1, 2)

    def dim(self, red):
        """Return the channels held of a picture of green and blue bodies whose red is given in levels."""
        green = 100 + 25 * (np.add.outer(np.arange(240) // 24, np.arange(320) // 24) % 2) + 20 * self.wave()
        return dim_channels.held_channels(
            [np.float32(plane) / 255 for plane in (np.clip(red, 0, 255), green, 0.8 * green)]
        )

    def wave(self):
        return np.add.outer(np.sin(np.arange(240) / 7), np.cos(np.arange(320) / 9))

    def test_a_dim_channel_is_held_for_a_picture_of_its_own(self):
        """Setup: red bodies in a tenth of a picture with next to no red, as dim as what is not held."""
        bodies = np.zeros((240, 320))
        bodies[60:180, 40:110] = 45
        assert bodies.mean() < dim_channels.DIM_SHARE * 100
        assert self.dim(bodies) == (0, 1, 2)

    @pytest.mark.parametrize("kind", ["nothing", "rim", "noise", "the green again", "veil"])
    def test_control_a_dim_channel_is_not_held_for_less(self, kind):
        red = np.zeros((240, 320))
        if kind == "rim":
            red[:, -2:] = 255
        elif kind == "noise":
            red = 4 + 16 * np.random.default_rng(0).standard_normal(red.shape)
        elif kind == "the green again":
            red = 0.3 * (25 * (np.add.outer(np.arange(240) // 24, np.arange(320) // 24) % 2) + 20 * self.wave()) + 6
        elif kind == "veil":
            red += np.linspace(2, 14, 320)
        assert self.dim(red) == (1, 2)

    @pytest.mark.parametrize("shape", [(1, 1), (1, 40), (7, 3)])
    def test_dim_channels_of_any_size(self, shape):
        image = np.full((*shape, 3), (2, 90, 60), np.uint8)
        assert dual_transmission.restore(image).shape == image.shape

    def test_an_empty_channel_is_the_mean_of_the_others(self):
        planes = {1: np.full((2, 2), 40, np.uint8), 2: np.full((2, 2), 60, np.uint8)}
        assert core.joined(planes)[0, 0].tolist() == [50, 40, 60]
        assert core.joined({1: planes[1]})[0, 0].tolist() == [40, 40, 40]


class TestAsPrinted:
    def test_a_flat_picture_turns_black_and_by_the_corrected_formulas_stays(self):
        """Without contrast and at the ambient light t is 0, so that eq. 3.13 leaves nothing."""
        image = np.full((64, 64, 3), (110, 130, 125), np.uint8)
        assert dual_transmission_as_printed.restore(image).mean() < 12
        assert np.abs(dual_transmission.restore(image, clip_limit=0.0).mean() - image.mean()) < 15

    def test_bound_has_no_value_where_the_ambient_light_is_the_darkest(self):
        ambient = np.full(3, dual_transmission_as_printed.DARKEST)
        found = dual_transmission_as_printed.bound(np.full((20, 20, 3), ambient, np.float32), ambient)
        assert np.all(np.isfinite(found))
        assert np.all((found >= 0) & (found <= 1))
