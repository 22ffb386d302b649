"""What others' restoration methods do to inputs whose result is known in closed form; each with a negative control."""

import numpy as np
import pytest

from uwsim.restoration import dark_channel, pyramid, retinex
from uwsim.restoration.algorithms import (
    agcwd,
    dcp,
    fusion,
    gray_world,
    haze_lines,
    he,
    minimal_colour_loss,
    msrcr,
    rcp,
    shades_of_gray,
    udcp,
    wgif_dehaze,
    wgif_detail,
)
from uwsim.restoration.levels import luma, stretched, to_uint8, unit
from uwsim.restoration.weighted_guided_filter import edge_weight, weighted_guided


def noise_picture(seed=0, height=60, width=80, low=0, high=256):
    return np.random.default_rng(seed).integers(low, high, (height, width, 3), dtype=np.uint8)


class TestHe:
    def test_two_levels_become_black_and_white(self):
        image = np.full((8, 8, 3), 100, np.uint8)
        image[:4, :, 1] = 120
        restored = he.restore(image)
        assert set(np.unique(restored[..., 1])) == {0, 255}
        # one level only: stays
        assert np.all(restored[..., 0] == 100)

    def test_levels_follow_the_cumulative_histogram(self):
        """255 (cdf - cdf_min) / (n - cdf_min) of levels 10, 20, 30 with 50, 25, 25 % of the pixels."""
        row = np.repeat(np.array([10, 20, 30], np.uint8), [50, 25, 25])
        restored = he.restore(np.dstack([np.tile(row, (4, 1))] * 3))[0, :, 0]
        assert list(restored[[0, 50, 75]]) == [0, round(255 * 0.5), 255]

    def test_control_an_even_histogram_stays(self):
        image = np.dstack([np.arange(256, dtype=np.uint8).reshape(16, 16)] * 3)
        np.testing.assert_array_equal(he.restore(image), image)


class TestGains:
    def cast(self, gains=(0.4, 1.0, 0.7)):
        grey = np.random.default_rng(1).uniform(0.2, 0.6, (50, 60, 1))
        return to_uint8(grey * np.array(gains))

    @pytest.mark.parametrize("method", [gray_world, shades_of_gray])
    def test_a_cast_of_gains_is_taken_off(self, method):
        means = method.restore(self.cast()).mean(axis=(0, 1))
        # model: rounding to 8 bit in the input, spread by a gain of 1.75
        assert np.ptp(means) < 1.5

    @pytest.mark.parametrize("method", [gray_world, shades_of_gray])
    def test_control_neutral_pictures_stay(self, method):
        image = self.cast((1, 1, 1))
        assert np.abs(method.restore(image).astype(int) - image).max() <= 1

    def test_the_two_differ_where_the_brightest_is_not_the_mean(self):
        image = np.full((10, 10, 3), 60, np.uint8)
        image[0, 0] = [250, 60, 60]
        world, shades = gray_world.restore(image), shades_of_gray.restore(image)
        assert shades[5, 5, 0] < world[5, 5, 0] - 10


class TestMsrcr:
    def test_an_exponential_ramp_in_closed_form(self):
        """A Gaussian makes e^(a x) to e^(a x + a^2 s^2 / 2): log ratio -a^2 s^2 / 2 (model: interpolation, 3 %)."""
        slope, width = 0.01, 900
        ramp = np.exp(slope * np.arange(width)).astype(np.float32)
        levels = np.broadcast_to(ramp[None, :, None], (200, width, 3)).copy()
        for sigma in (5.0, 15.0, 80.0):
            found = retinex.log_ratio(levels, sigmas_px=(sigma,))[100, width // 2, 0]
            assert found == pytest.approx(-((slope * sigma) ** 2) / 2, rel=0.03)
            # control: another width is told apart
            assert found != pytest.approx(-((slope * 1.1 * sigma) ** 2) / 2, rel=0.03)

    def test_the_light_of_the_scene_cancels(self):
        image = np.random.default_rng(3).uniform(20, 120, (60, 80, 3)).astype(np.float32)
        once, twice = (retinex.log_ratio(k * image, sigmas_px=(15.0, 80.0)) for k in (1, 2))
        np.testing.assert_allclose(once, twice, atol=1e-4)

    def test_a_shrunk_blur_is_that_of_the_full_picture(self):
        import cv2

        image = 100 + 80 * np.sin(np.arange(240) / 40)[None, :, None] * np.cos(np.arange(200) / 30)[:, None, None]
        image = (image * np.ones(3)).astype(np.float32)
        exact = cv2.GaussianBlur(image, (0, 0), 40.0, borderType=cv2.BORDER_REFLECT)
        assert np.abs(retinex.smoothed(image, sigma_px=40.0) - exact).max() < 2e-3 * exact.mean()
        # control: a width 2 % off is seen
        assert np.abs(retinex.smoothed(image, sigma_px=40.8) - exact).max() > 2e-3 * exact.mean()

    def test_it_fills_the_range(self):
        restored = msrcr.restore(noise_picture(5, low=90, high=130))
        assert restored.min() == 0
        assert restored.max() == 255

    def test_control_a_flat_channel_is_not_stretched(self):
        assert np.all(stretched(np.full((4, 4), 7.0), 1, 99) == 0)


class TestAgcwd:
    def test_two_levels_in_closed_form(self):
        """Half of the pixels each: weights equal, cdf 1/2 and 1: 255 (64/255)^(1/2) and 255."""
        counts = np.zeros(256)
        counts[[64, 128]] = 10
        table = agcwd.brightened(counts)
        assert table[64] == pytest.approx(255 * (64 / 255) ** 0.5)
        assert table[128] == pytest.approx(255)

    def test_rare_levels_count_by_the_root_of_their_share(self):
        counts = np.zeros(256)
        counts[64], counts[128] = 10, 90
        weight = np.sqrt(10 / 90)
        assert agcwd.brightened(counts)[64] == pytest.approx(255 * (64 / 255) ** (1 - weight / (1 + weight)))
        # control: not by their share itself
        assert agcwd.brightened(counts)[64] != pytest.approx(255 * (64 / 255) ** 0.9, rel=0.02)

    def test_hue_and_saturation_stay(self):
        image = np.zeros((4, 4, 3), np.uint8)
        image[:] = [20, 40, 80]
        image[0] = [5, 10, 20]
        restored = agcwd.restore(image).astype(float)
        assert np.all(np.abs(restored[..., 2] - 4 * restored[..., 0]) <= 2.5)  # rounding
        assert restored[0].mean() > 20

    def test_control_black_stays_black(self):
        assert np.all(agcwd.restore(np.zeros((4, 4, 3), np.uint8)) == 0)


class TestWeightedGuidedFilter:
    def test_weight_of_an_edge_and_of_what_is_flat(self):
        guide = np.zeros((20, 20), np.float32)
        guide[:, 10:] = 1
        weight = edge_weight(guide)
        variance = 2 / 9  # of 3 zeros among 9
        expected = (variance + 1e-6) * np.mean(np.where(np.isin(np.arange(20), (9, 10)), 1 / (variance + 1e-6), 1e6))
        assert weight[5, 10] == pytest.approx(expected, rel=1e-4)
        assert weight[5, 3] < 1 < weight[5, 10]

    def test_texture_is_kept_better_than_by_the_guided_filter_and_what_is_weak_is_not(self):
        """Stripes of variance 0.01 stay by v / (v + lambda / Gamma), Gamma far above 1; with Gamma = 1 half of them."""
        from uwsim.restoration.guided_filter import guided

        stripes = np.where(np.arange(160) // 2 % 2, 0.1, -0.1) * np.where(np.arange(160) < 80, 1, 0.05)
        image = (0.5 + stripes * np.ones((64, 1))).astype(np.float32)
        weighted = weighted_guided(image, image, radius_px=8, penalty=1 / 128)
        plain = guided(image, image, radius_px=8, epsilon=1 / 128)
        assert np.ptp(weighted[32, 30:50]) == pytest.approx(0.2, rel=0.02)
        assert np.ptp(plain[32, 30:50]) == pytest.approx(0.2 * 0.01 / (0.01 + 1 / 128), rel=0.05)
        assert np.ptp(weighted[32, 110:130]) < 0.1 * 0.01

    def test_detail_is_four_times_as_strong_and_flat_parts_stay(self):
        """A weak stripe pattern is detail (its variance far below lambda / Gamma): 4 times as strong."""
        flat = np.full((64, 64, 3), 100, np.uint8)
        np.testing.assert_array_equal(wgif_detail.restore(flat), flat)
        image = flat.copy()
        image[:, ::2] = 108
        restored = wgif_detail.restore(image)
        # model: a strip of the contrast stays in the base (v / (v + lambda / Gamma) = 3 %)
        assert float(restored[32, 32, 1]) - restored[32, 33, 1] == pytest.approx(4 * 8, abs=2)


def hazy(transmission=0.5, ambient=(0.7, 0.8, 0.9), seed=6, empty=None):
    """Return (object, hazy picture) whose object has a black channel in every window."""
    rng = np.random.default_rng(seed)
    objects = rng.uniform(0, 0.6, (90, 120, 3))
    objects[::5, ::5] = 0
    # something that is nothing but haze
    picture = transmission * objects + (1 - transmission) * np.array(ambient)
    picture[:20, :20] = ambient
    return objects, to_uint8(picture)


class TestDarkChannel:
    def test_ambient_light_and_transmission_of_even_haze(self):
        """t = 1 - 0.95 (1 - 0.5) where an object is black, 0.05 where all is haze (tolerance: 8-bit levels)."""
        _, image = hazy()
        colours = unit(image)
        ambient = dark_channel.haze_light(colours, dark_channel.dark_channel(colours))
        np.testing.assert_allclose(ambient, [0.7, 0.8, 0.9], atol=0.004)
        transmission = dark_channel.haze_transmission(colours, ambient)
        assert np.median(transmission[40:]) == pytest.approx(1 - 0.95 * 0.5, abs=0.01)
        assert transmission[5, 5] == pytest.approx(0.05, abs=0.01)

    def test_removal_turns_haze_around(self):
        objects, _ = hazy()
        ambient, transmission = np.array([0.7, 0.8, 0.9]), np.full((90, 120), 0.5)
        picture = 0.5 * objects + 0.5 * ambient
        found = dark_channel.without_haze(picture, ambient, transmission)
        np.testing.assert_allclose(found, objects, atol=1e-6)
        # control: below the floor of 0.1 it does not
        far = dark_channel.without_haze(0.02 * objects + 0.98 * ambient, ambient, 0.02 * np.ones((90, 120)))
        assert np.abs(far - objects).max() > 0.1

    @pytest.mark.parametrize("method", [dcp, wgif_dehaze])
    def test_methods_take_even_haze_away(self, method):
        objects, image = hazy()
        before, after = (np.abs(unit(p) - objects)[40:].mean() for p in (image, method.restore(image)))
        assert after < 0.25 * before

    def test_udcp_does_not_look_at_red(self):
        """Without light in red, the dark channel is black everywhere and DCP sees no haze; UDCP does."""
        objects, image = hazy()
        image[..., 0] = 0
        np.testing.assert_array_equal(dcp.restore(image)[40:], image[40:])
        green_blue = np.abs(unit(udcp.restore(image)) - objects)[40:, :, 1:].mean()
        assert green_blue < 0.4 * np.abs(unit(image) - objects)[40:, :, 1:].mean()

    def test_black_pictures_stay_black(self):
        for method in (dcp, udcp, wgif_dehaze):
            assert np.all(method.restore(np.zeros((20, 30, 3), np.uint8)) == 0)


class TestRcp:
    def test_transmission_from_inverted_red(self):
        """Objects of full red (or empty green) leave only the water: t where 1 - I_R = (1 - t)(1 - A_R)."""
        ambient = np.array([0.1, 0.5, 0.6], np.float32)
        objects = np.ones((40, 40, 3), np.float32)
        picture = 0.3 * objects + 0.7 * ambient
        np.testing.assert_allclose(rcp.red_transmission(picture, ambient), 0.3, atol=1e-5)
        # control: objects without red and of full green and blue hide it
        objects[..., 0] = 0
        assert rcp.red_transmission(0.3 * objects + 0.7 * ambient, ambient).min() < 0.1

    def test_grey_surfaces_count_as_near_with_saturation(self):
        ambient = np.array([0.1, 0.5, 0.6], np.float32)
        lamp_lit = np.full((40, 40, 3), 0.4, np.float32)
        np.testing.assert_allclose(rcp.red_transmission(lamp_lit, ambient, saturation_weight=1.0), 1, atol=1e-6)
        assert rcp.red_transmission(lamp_lit, ambient).max() < 0.4

    def test_refuses_a_weight_out_of_range(self):
        with pytest.raises(ValueError, match="saturation_weight"):
            rcp.restore(noise_picture(), saturation_weight=1.5)


class TestFusion:
    def test_a_pyramid_gives_its_image_back(self):
        image = np.random.default_rng(7).random((61, 83, 3)).astype(np.float32)
        np.testing.assert_allclose(pyramid.collapsed(pyramid.laplacian(image, 4)), image, atol=1e-6)

    def test_fusion_of_one_and_the_same_is_that_image(self):
        rng = np.random.default_rng(8)
        image, weight = rng.random((48, 64, 3)).astype(np.float32), rng.random((48, 64)).astype(np.float32)
        np.testing.assert_allclose(pyramid.fused([image, image], [weight, 1 - weight]), image, atol=1e-5)
        # control: weights that do not sum to 1
        assert np.abs(pyramid.fused([image, image], [weight, weight]) - image).max() > 0.1

    def test_even_weights_give_the_mean(self):
        rng = np.random.default_rng(9)
        one, other = (rng.random((48, 64, 3)).astype(np.float32) for _ in range(2))
        half = np.full((48, 64), 0.5, np.float32)
        np.testing.assert_allclose(pyramid.fused([one, other], [half, half]), (one + other) / 2, atol=1e-5)

    def test_red_is_raised_by_what_green_has_more(self):
        """Even picture: R + (G - R)(1 - R) G."""
        image = np.full((6, 6, 3), [0.1, 0.5, 0.7], np.float32)
        np.testing.assert_allclose(
            fusion.compensated(image)[0, 0], [0.1 + 0.4 * 0.9 * 0.5, 0.5, 0.7], rtol=1e-6
        )  # fmt: skip

    def test_control_nothing_to_raise(self):
        image = np.full((6, 6, 3), [0.6, 0.5, 0.7], np.float32)
        np.testing.assert_array_equal(fusion.compensated(image), image)

    def test_sharpening_of_what_is_flat_has_no_detail(self):
        np.testing.assert_allclose(fusion.sharpened(np.full((20, 20, 3), 0.6, np.float32)), 0.3, atol=1e-6)


class TestMinimalColourLoss:
    def picture(self):
        return np.random.default_rng(10).uniform(0.1, 0.4, (40, 50, 3)).astype(np.float32) * [0.3, 1.0, 0.8]

    def test_the_limit_of_the_steps(self):
        """The published loop, run until it no longer moves, ends where the closed form is."""
        image = self.picture().astype(np.float32)
        green = image[..., 1]
        strongest = (green - green.min()) / np.ptp(green)
        found = {}
        for channel in (0, 2):
            values = image[..., channel].astype(float)
            for _ in range(200):
                values = values + (strongest.mean() - values.mean()) * strongest
            found[channel] = values
        transferred = minimal_colour_loss.transferred(image)
        for channel, values in found.items():
            np.testing.assert_allclose(transferred[..., channel], values, atol=1e-5)
        assert np.ptp(transferred.mean(axis=(0, 1))) < 1e-5
        # control: one step is not the limit
        assert np.ptp(image.mean(axis=(0, 1))) > 0.1

    def test_local_contrast_grows_up_to_the_limit(self):
        """Weak stripes beside strong ones: contrast grows towards the picture's variance, at most 1.5 times."""
        stripes = np.where(np.arange(200) % 2, 1.0, -1.0) * np.where(np.arange(200) < 100, 2.0, 60.0)
        lightness = np.broadcast_to(128 + stripes, (60, 200)).astype(np.float32)
        found = minimal_colour_loss.local_contrast(lightness)
        assert np.ptp(found[30, 30:60]) == pytest.approx(1.5 * 4, abs=0.3)
        assert np.ptp(found[30, 140:170]) == pytest.approx(120 * 0.5, rel=0.05)

    def test_control_flat_stays_flat(self):
        np.testing.assert_array_equal(minimal_colour_loss.local_contrast(np.full((30, 30), 90, np.float32)), 90)
        assert np.ptp(minimal_colour_loss.restore(np.full((30, 30, 3), 120, np.uint8))) <= 2


class TestHazeLines:
    def scene(self):
        """Return (objects, picture, blue transmission, veil, ratios): four colours, each at every distance."""
        ratios = haze_lines.waters()["3C"]
        veil = np.array([0.02, 0.1, 0.12], np.float32)
        colours = np.array([[0.6, 0.5, 0.4], [0.4, 0.02, 0.03], [0.05, 0.4, 0.1], [0.3, 0.3, 0.6]], np.float32)
        objects = np.repeat(colours, 12, axis=0)[:, None] * np.ones((1, 100, 1), np.float32)
        blue = np.linspace(1, 0.4, 100, dtype=np.float32)[None, :] * np.ones((48, 1), np.float32)
        transmission = blue[..., None] ** (1 / ratios)
        return objects, transmission * objects + (1 - transmission) * veil, blue, veil, ratios

    def test_transmission_of_colours_seen_at_all_distances(self):
        """The farthest pixel of every line is at t = 1, so that the share of its length is t_B itself (cells: 3 %)."""
        _, picture, blue, veil, ratios = self.scene()
        ends = haze_lines.ends_of_lines(picture, veil, ratios)
        found = haze_lines.blue_transmission(picture, veil, ratios, ends)
        assert np.median(np.abs(found - blue)) < 0.03

    def test_control_another_water_does_not_fit(self):
        _, picture, blue, veil, _ = self.scene()
        other = haze_lines.waters()["I"]
        found = haze_lines.blue_transmission(picture, veil, other, haze_lines.ends_of_lines(picture, veil, other))
        assert np.median(np.abs(found - blue)) > 0.05

    def test_objects_never_fall_below_zero(self):
        _, picture, _, veil, ratios = self.scene()
        blue = haze_lines.blue_transmission(picture, veil, ratios, np.zeros(800, np.float32))
        assert (veil + (picture - veil) / blue[..., None] ** (1 / ratios)).min() > -1e-3

    def test_veil_is_the_largest_flat_part(self):
        image = np.random.default_rng(11).uniform(0, 0.5, (60, 80, 3)).astype(np.float32)
        image[:30] = [0.05, 0.2, 0.3]
        np.testing.assert_allclose(haze_lines.veiling_light(image), [0.05, 0.2, 0.3], atol=0.01)

    def test_waters_take_more_red_than_blue_or_less(self):
        """Oceanic water takes most of the red, the most coastal type most of the blue."""
        waters = haze_lines.waters()
        assert set(waters) >= {"I", "II", "3C", "9C"}
        assert waters["I"][0] < 0.5
        assert waters["9C"][0] > 1

    def test_refuses_other_types(self):
        with pytest.raises(ValueError, match="haze_lines"):
            haze_lines.restore(noise_picture())


def test_levels_come_back():
    image = noise_picture(12)
    np.testing.assert_array_equal(to_uint8(unit(image)), image)
    assert luma(np.ones((2, 2, 3), np.float32)) == pytest.approx(1)
    with pytest.raises(ValueError, match="float64"):
        unit(image.astype(float))
