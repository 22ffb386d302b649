"""Scores on charts and features against closed forms: gain, colour difference, MTF50, contrast transfer, matches."""

import math

import numpy as np
import pytest
from scipy import ndimage
from scipy.special import erf

from uwsim.images import linear_from_srgb_uint8, srgb_uint8_from_linear
from uwsim.metrics import colour, contrast, edge
from uwsim.metrics.features import features, verified_percent
from uwsim.metrics.gain import global_gain, with_gain
from uwsim.metrics.image import psnr, ssim


def smooth_picture(seed=0, height=96, width=128):
    """Return an 8-bit picture with structure of a few pixels."""
    noise = np.random.default_rng(seed).random((height, width, 3))
    smooth = ndimage.gaussian_filter(noise, (2, 2, 0))
    return (255 * (smooth - smooth.min()) / np.ptp(smooth)).astype(np.uint8)


def scaled(image, factors):
    """Return an 8-bit picture times factors per band in linear light."""
    return srgb_uint8_from_linear(linear_from_srgb_uint8(image) * np.asarray(factors))


class TestGain:
    def test_half_the_light_is_made_up_for(self):
        """Expected: gain 2, and what 8 bits leave, above 45 dB. Control: half the red alone is no exposure."""
        truth = smooth_picture()
        half = scaled(truth, 0.5)
        assert global_gain(truth, half) == pytest.approx(2, rel=2e-3)
        assert psnr(truth, half) < 20
        assert psnr(truth, with_gain(truth, half)) > 45
        assert ssim(truth, with_gain(truth, half)) > 0.99
        reddish = scaled(truth, (0.5, 1, 1))
        assert psnr(truth, with_gain(truth, reddish)) < 25

    def test_it_is_the_least_squares_factor(self):
        """Control: one percent more or less is farther from the truth."""
        truth, other = smooth_picture(), smooth_picture(1)
        x, y = (linear_from_srgb_uint8(one).astype(float) for one in (other, truth))
        best = global_gain(truth, other)
        errors = [np.sum((gain * x - y) ** 2) for gain in (0.99 * best, best, 1.01 * best)]
        assert errors[1] == min(errors)

    def test_identical_and_black_pictures(self):
        truth = smooth_picture()
        assert global_gain(truth, truth) == 1
        assert np.array_equal(with_gain(truth, truth), truth)
        assert global_gain(truth, np.zeros_like(truth)) == 1
        with pytest.raises(ValueError, match="allowed"):
            global_gain(truth, truth[1:])


COLOURS = np.random.default_rng(4).uniform(0.05, 0.9, (24, 3))


def checker(pitch=24, gap=3):
    """Return (albedo of 4 x 6 patches on a dark frame on a grey wall, where the chart is)."""
    albedo, inside = np.full((130, 180, 3), 0.3), np.zeros((130, 180), bool)
    inside[10 : 10 + 4 * pitch + gap, 12 : 12 + 6 * pitch + gap] = True
    albedo[inside] = 0.04
    for number, value in enumerate(COLOURS):
        row, column = 10 + gap + number // 6 * pitch, 12 + gap + number % 6 * pitch
        albedo[row : row + pitch - gap, column : column + pitch - gap] = value
    return albedo, inside


class TestColour:
    @pytest.mark.parametrize(("pitch", "gap"), [(24, 3), (24, 7), (24, 0), (12, 2)])
    def test_the_24_patches_are_found_and_nothing_else(self, pitch, gap):
        """Expected: each of one albedo, 2 px off its edges, be the frame thin, wide or absent."""
        albedo, inside = checker(pitch, gap)
        labels = colour.patches(albedo, inside)
        assert labels.max() == 24
        for number in range(1, 25):
            assert np.ptp(albedo[labels == number], axis=0).max() == 0
            assert np.count_nonzero(labels == number) == (pitch - gap - 4) ** 2
        assert not labels[~inside].any()

    def test_what_hides_a_patch_takes_it_away(self):
        albedo, inside = checker()
        inside[:, :40] = False
        assert colour.patches(albedo, inside).max() == 20
        assert colour.patches(albedo, np.zeros_like(inside)).max() == 0

    def test_grey_has_the_closed_form(self):
        """Expected: |dL| / S_L of CIE 142-2001 for pairs without chroma. Control: without S_L it is another number."""
        labels = np.ones((20, 20), int)
        levels = 90, 140
        reference, image = (np.full((20, 20, 3), level, np.uint8) for level in levels)
        first, second = (116 * float(linear_from_srgb_uint8(np.uint8([level]))[0]) ** (1 / 3) - 16 for level in levels)
        middle = ((first + second) / 2 - 50) ** 2
        expected = abs(first - second) / (1 + 0.015 * middle / math.sqrt(20 + middle))
        assert colour.colour_difference(reference, image, labels) == pytest.approx(expected, abs=2e-3)
        assert abs(expected - abs(first - second)) > 0.1

    def test_identical_half_and_swapped(self):
        albedo, inside = checker()
        labels, truth = colour.patches(albedo, inside), srgb_uint8_from_linear(albedo)
        assert colour.colour_difference(truth, truth, labels) == 0
        half = srgb_uint8_from_linear(albedo / 2)
        assert colour.colour_difference(truth, half, labels) > 8
        assert colour.colour_difference(truth, with_gain(truth, half), labels) < 0.5
        assert colour.colour_difference(truth, np.ascontiguousarray(truth[..., ::-1]), labels) > 15
        assert math.isnan(colour.colour_difference(truth, half, np.zeros_like(labels)))

    def test_noise_averages_out(self):
        """Expected: linear noise of 20 % of the light leaves less than 2. Control: in one pixel alone it does not."""
        albedo, inside = checker()
        labels, truth = colour.patches(albedo, inside), srgb_uint8_from_linear(albedo)
        noise = 1 + 0.2 * np.random.default_rng(0).normal(size=albedo.shape)
        noisy = srgb_uint8_from_linear(albedo * noise)
        assert colour.colour_difference(truth, noisy, labels) < 2
        first = [np.argwhere(labels == number)[0] for number in range(1, 25)]
        single = np.zeros_like(labels)
        for number, (row, column) in enumerate(first, start=1):
            single[row, column] = number
        assert colour.colour_difference(truth, noisy, single) > 4


DARK, STEP, SIDE = 0.05, 0.55, 66
EDGES = pytest.mark.parametrize("angle_deg", [5.0, -9.0, 95.0, 185.0, 262.0, 38.0])


def distances(angle_deg):
    """Return the distance of each pixel to an edge through the middle; its bright side is at angle_deg (y down)."""
    y, x = np.mgrid[:SIDE, :SIDE] + 0.5 - SIDE / 2
    return math.cos(math.radians(angle_deg)) * x + math.sin(math.radians(angle_deg)) * y


def blurred_edge(angle_deg, sigma_px):
    return DARK + STEP * 0.5 * (1 + erf(distances(angle_deg) / sigma_px / math.sqrt(2)))


def edge_of(angle_deg):
    albedo = np.where(distances(angle_deg) > 0, DARK + STEP, DARK)
    return edge.find_edge(np.repeat(albedo[..., None], 3, axis=-1), np.ones((SIDE, SIDE), bool))


def gaussian_mtf50(sigma_px):
    """exp(-2 pi^2 sigma^2 f^2) = 1/2."""
    return math.sqrt(math.log(2) / 2) / math.pi / sigma_px


class TestEdge:
    @EDGES
    def test_the_edge_lies_where_it_is(self, angle_deg):
        found = edge_of(angle_deg)
        assert found.distance_px == pytest.approx(distances(angle_deg)[found.rows, found.columns], abs=0.15)
        assert found.reach_px == pytest.approx(edge.REACH_PX, abs=0.5)

    @EDGES
    @pytest.mark.parametrize("sigma_px", [0.7, 1.5, 3.0])
    def test_a_gaussian_has_its_closed_form(self, angle_deg, sigma_px):
        """Tolerance 2 %: the place of the edge is known to a tenth of a pixel. Control: the edge next to it, 6 degrees
        off, is not sharp along this line."""
        picture = blurred_edge(angle_deg, sigma_px)
        assert edge.mtf50(picture, edge_of(angle_deg)) == pytest.approx(gaussian_mtf50(sigma_px), rel=0.02)
        if sigma_px < 3:
            assert edge.mtf50(picture, edge_of(angle_deg + 6)) < 0.9 * gaussian_mtf50(sigma_px)

    def test_gain_and_veil_do_not_matter(self):
        picture, where = blurred_edge(5, 2), edge_of(5)
        assert edge.mtf50(0.3 * picture + 0.2, where) == pytest.approx(edge.mtf50(picture, where), rel=1e-9)

    @pytest.mark.parametrize(("noise", "tolerance"), [(0.1, 0.05), (0.3, 0.15)])
    def test_noise_makes_the_error_that_is_stated(self, noise, tolerance):
        """Setup: noise in shares of the step. Expected: the standard deviation of 40 pictures. Control: five times the
        noise is outside."""
        rng, where = np.random.default_rng(0), edge_of(5)

        def error(share):
            pictures = [blurred_edge(5, 1.5) + share * STEP * rng.normal(size=(SIDE, SIDE)) for _ in range(40)]
            return np.std([edge.mtf50(one, where) / gaussian_mtf50(1.5) for one in pictures])

        assert 0.5 * tolerance < error(noise) < 1.2 * tolerance
        assert error(5 * noise) > 1.2 * tolerance

    def test_a_lost_edge_scores_nothing_and_a_sharp_one_what_pixels_can_carry(self):
        where = edge_of(5)
        noise = np.random.default_rng(0).normal(size=(SIDE, SIDE))
        assert edge.mtf50(0.5 + 0.1 * noise, where) == 0
        assert edge.mtf50(blurred_edge(5, 1.5) + 2 * STEP * noise, where) == 0
        assert edge.mtf50(1 - blurred_edge(5, 1.5), where) == 0  # dark and bright changed places
        assert edge.mtf50(blurred_edge(5, 0.2), where) == edge.FINEST_CYCLES_PER_PX

    def test_too_little_of_an_edge_is_none(self):
        albedo = np.repeat(np.where(distances(5) > 0, 0.6, 0.05)[..., None], 3, axis=-1)
        inside = np.zeros((SIDE, SIDE), bool)
        assert edge.find_edge(albedo, inside) is None
        inside[:, :28] = True  # the dark side
        assert edge.find_edge(albedo, inside) is None
        inside[:, :35] = True  # a sliver of the bright one
        assert edge.find_edge(albedo, inside) is None
        inside[:] = False
        inside[20:26] = True
        assert edge.find_edge(albedo, inside) is None
        inside[:] = True
        assert edge.find_edge(albedo, inside) is not None


def bars():
    """Return (bars of several widths on a bright chart, where the chart is)."""
    picture, inside = np.full((90, 120), 0.3), np.zeros((90, 120), bool)
    inside[8:84, 10:114] = True
    picture[inside] = 0.8
    column = 20
    for width in (8, 5, 3, 2):
        for _ in range(3):
            picture[16:76, column : column + width] = 0.1
            column += 2 * width
    return picture, inside


class TestChart:
    @pytest.mark.parametrize("veil", [0.0, 0.2, 1.0])
    def test_a_veil_takes_contrast_as_its_share(self, veil):
        """Expected: mean / (mean + veil) on the chart. Control: a gain changes nothing."""
        picture, inside = bars()
        mean = picture[ndimage.binary_erosion(inside, iterations=2)].mean()
        found = contrast.chart_transfer(3 * (picture + veil), picture, inside=inside)
        assert found == pytest.approx(mean / (mean + veil), abs=1e-9)

    def test_more_than_the_truth_counts_as_all(self):
        """Control: too much in coarse bars does not make up for fine ones that are gone."""
        picture, inside = bars()
        mean = picture[ndimage.binary_erosion(inside, iterations=2)].mean()
        assert contrast.chart_transfer(mean + 1.5 * (picture - mean), picture, inside=inside) == 1
        coarse = ndimage.gaussian_filter(picture, 2.0)
        stretched = contrast.chart_transfer(mean + 3 * (coarse - mean), picture, inside=inside)
        assert contrast.chart_transfer(coarse, picture, inside=inside) < stretched < 0.95

    def test_what_is_beside_the_chart_does_not_matter(self):
        picture, inside = bars()
        other = np.where(inside, 0.5 * picture + 0.1, np.random.default_rng(0).random(picture.shape))
        same = np.where(inside, other, 0.0)
        expected = contrast.chart_transfer(same, picture, inside=inside)
        assert contrast.chart_transfer(other, picture, inside=inside) == expected
        assert contrast.chart_transfer(other, picture, inside=np.ones_like(inside)) != expected

    def test_noise_adds_no_bias(self):
        """Expected: of 40 pictures whose noise is the whole contrast of the bars the mean is within four standard
        errors, and these are below 2 %. Control: half the contrast is not."""
        picture, inside = bars()
        rng, veiled = np.random.default_rng(0), picture + 0.5
        expected = contrast.chart_transfer(veiled, picture, inside=inside)
        found = [
            contrast.chart_transfer(veiled + 0.7 * rng.normal(size=picture.shape), picture, inside=inside)
            for _ in range(40)
        ]
        error = np.std(found) / math.sqrt(len(found))
        assert error < 0.02 * expected
        assert abs(np.mean(found) - expected) < 4 * error
        assert abs(np.mean(found) - expected / 2) > 4 * error

    def test_small_charts_and_black_pictures(self):
        picture, inside = bars()
        assert math.isnan(
            contrast.chart_transfer(picture[20:50, 20:50], picture[20:50, 20:50], inside=inside[20:50, 20:50])
        )
        assert math.isnan(contrast.chart_transfer(picture, picture, inside=np.zeros_like(inside)))
        assert contrast.chart_transfer(np.zeros_like(picture), picture, inside=inside) == 0


def large_picture(seed=0):
    return smooth_picture(seed, 192, 256)


@pytest.mark.parametrize("kind", ["sift", "orb"])
class TestFeatures:
    def test_the_same_picture_has_them_all(self, kind):
        """Control: another picture has none."""
        truth = features(large_picture(), kind)
        assert len(truth.points_px) > 50
        assert verified_percent(truth, truth) == 100
        assert verified_percent(truth, features(large_picture(1), kind)) < 3

    def test_a_match_in_another_place_is_none(self, kind):
        """Setup: the picture moved. Expected: 1 px is near enough, 4 px is not, though all features match."""
        picture = large_picture()
        truth = features(picture, kind)
        near, far = (features(np.roll(picture, shift, axis=1), kind) for shift in (1, 4))
        assert verified_percent(truth, near) > 70
        assert verified_percent(truth, far) < 5
        assert verified_percent(truth, far, within_px=4.5) > 60

    def test_pictures_without_features(self, kind):
        truth, flat = features(large_picture(), kind), features(np.full((192, 256, 3), 90, np.uint8), kind)
        assert verified_percent(truth, flat) == 0
        assert math.isnan(verified_percent(flat, truth))

    def test_no_more_than_asked_for(self, kind):
        assert 10 < len(features(large_picture(), kind, count=20).points_px) <= 20


def test_unknown_features_are_refused():
    with pytest.raises(ValueError, match="'surf', allowed: 'sift', 'orb'"):
        features(large_picture(), "surf")
