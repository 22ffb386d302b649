"""The maximum-likelihood estimator on textures of known spectrum, its verdicts, its tiles and its refusals."""

import numpy as np
import pytest

from uwsim.bench.blur_controlled import textures
from uwsim.bench.blur_controlled.protocol import Texture
from uwsim.metrics.blur import angle_error_deg, blur_failure, length_error_px
from uwsim.motion_blur.estimate import VERDICTS
from uwsim.motion_blur.estimators import whittle
from uwsim.motion_blur.kernels import blur, otf
from uwsim.motion_blur.whittle import model, picture
from uwsim.motion_blur.whittle.cells_fit import fit_cells
from uwsim.motion_blur.whittle.fit import refine
from uwsim.motion_blur.whittle.gate import least_nats, shows_in_parts
from uwsim.motion_blur.whittle.periodogram import frequencies
from uwsim.motion_blur.whittle.picture import find
from uwsim.motion_blur.whittle.tiles import field

BORDER_PX = 48


def texture(seed, *, size_px=256, std=0.13, exponent=2.8):
    """Return a Gaussian texture of a power-law spectrum, mean 0.5, with borders to cut off."""
    side = size_px + 2 * BORDER_PX
    rng = np.random.default_rng(seed)
    frequency = np.hypot(np.fft.fftfreq(side)[:, None], np.fft.fftfreq(side)[None, :])
    frequency[0, 0] = 1
    picture = np.fft.ifft2(np.fft.fft2(rng.standard_normal((side, side))) / frequency ** (exponent / 2)).real
    return 0.5 + std * (picture - picture.mean()) / picture.std()


def finished(large, *, noise_std, seed):
    """Return the middle with noise, 8 bit, (H, W, 3) float32."""
    inner = large[BORDER_PX:-BORDER_PX, BORDER_PX:-BORDER_PX]
    noisy = inner + noise_std * np.random.default_rng(seed + 1000).standard_normal(inner.shape)
    stored = np.rint(255 * np.clip(noisy, 0, 1)) / 255
    return np.repeat(stored[..., None], 3, axis=2).astype(np.float32)


def frame(seed, *, length_px, angle_deg, noise_std=0.005, **kind):
    return finished(
        blur(texture(seed, **kind), length_px=length_px, angle_deg=angle_deg), noise_std=noise_std, seed=seed
    )


def sub_frames(large, offsets, *, angle_deg):
    """Return the mean of copies shifted by offsets [px] along the motion: shifts by the Fourier shift theorem."""
    u, v = np.fft.fftfreq(large.shape[1])[None, :], np.fft.fftfreq(large.shape[0])[:, None]
    angle = np.radians(angle_deg)
    along = u * np.cos(angle) - v * np.sin(angle)
    transfer = np.mean([np.exp(-2j * np.pi * offset * along) for offset in offsets], axis=0)
    return np.fft.ifft2(np.fft.fft2(large) * transfer).real


class TestEstimate:
    @pytest.mark.parametrize(
        "length_px, angle_deg, noise_std",
        [(2, 30, 0), (3, 165, 0.005), (4, 90, 0.01), (8, 0, 0.01), (15, 135, 0.02), (30, 60, 0.005)],
    )
    def test_within_five_of_its_standard_deviations(self, length_px, angle_deg, noise_std):
        """Model tolerance: none; statistical: 5 of the stated standard deviations, which are wide (2.4 x) already."""
        found = whittle.estimate(frame(length_px, length_px=length_px, angle_deg=angle_deg, noise_std=noise_std))
        std = np.sqrt(np.diag(found.covariance))
        errors = length_error_px(found.length_px, length_px), angle_error_deg(found.angle_deg, angle_deg)
        assert np.all(np.array(errors) < 5 / 2.4 * std)
        assert not blur_failure(*errors)
        assert std[0] < 0.5
        assert found.verdict == "blur"

    def test_rectangle_and_units(self):
        image = frame(3, length_px=6, angle_deg=40)[:200, :]
        found = whittle.estimate(image)
        assert length_error_px(found.length_px, 6) < 0.2
        assert angle_error_deg(found.angle_deg, 40) < 2
        scaled = whittle.estimate(7 * image + 3)
        assert scaled[:2] == pytest.approx(found[:2], abs=2e-3)
        assert scaled.spectrum.noise_std == pytest.approx(7 * found.spectrum.noise_std, rel=1e-2)

    def test_transposed_picture_mirrors_the_angle(self):
        image = frame(4, length_px=7, angle_deg=25)
        turned = whittle.estimate(image.transpose(1, 0, 2))
        assert angle_error_deg(turned.angle_deg, -90 - 25) < 1
        assert turned.length_px == pytest.approx(whittle.estimate(image).length_px, abs=0.05)

    def test_noise_and_texture_are_found(self):
        """1 % noise and 8 bit; the power law that made the texture. Statistical: 3 %, 0.15."""
        spectrum = whittle.estimate(frame(5, length_px=5, angle_deg=110, noise_std=0.01)).spectrum
        assert spectrum.noise_std == pytest.approx(np.hypot(0.01, 1 / 255 / np.sqrt(12)), rel=0.03)
        assert spectrum.exponent == pytest.approx(2.8, abs=0.15)
        large = texture(5)
        u, v = np.fft.fftfreq(large.shape[1])[None, :], np.fft.fftfreq(large.shape[0])[:, None]
        ring = np.abs(np.hypot(u, v) - 0.08) < 0.02
        power = np.abs(np.fft.fft2(large - large.mean())) ** 2 / large.size
        assert spectrum.texture_psd(u, v).shape == large.shape
        assert spectrum.texture_psd(u, v)[ring].mean() == pytest.approx(power[ring].mean(), rel=0.15)

    def test_deterministic(self):
        image = frame(6, length_px=5, angle_deg=10)
        first, again = whittle.estimate(image), whittle.estimate(image)
        assert first[:2] == again[:2]
        np.testing.assert_array_equal(first.covariance, again.covariance)


class TestExposure:
    def test_sub_frames_at_mid_points_have_the_length_of_the_motion(self):
        count, length_px = 16, 10.0
        large = sub_frames(texture(7), length_px * ((np.arange(count) + 0.5) / count - 0.5), angle_deg=20)
        found = whittle.estimate(finished(large, noise_std=0.002, seed=7))
        assert length_error_px(found.length_px, length_px) < 0.05
        assert angle_error_deg(found.angle_deg, 20) < 0.3

    @pytest.mark.parametrize("count", [8, 16])
    def test_control_both_end_points_make_it_too_long(self, count):
        """n sub-frames with both ends stand for an exposure n / (n - 1) as long."""
        length_px = 10.0
        large = sub_frames(texture(7), length_px * np.linspace(-0.5, 0.5, count), angle_deg=20)
        found = whittle.estimate(finished(large, noise_std=0.002, seed=7))
        assert found.length_px == pytest.approx(length_px * count / (count - 1), abs=0.06)
        assert length_error_px(found.length_px, length_px) > 0.5


class TestVerdict:
    @pytest.mark.parametrize("noise_std", [0.0, 0.01])
    def test_sharp_pictures_are_not_blurred(self, noise_std):
        for seed, exponent in enumerate((2.2, 2.8, 3.2)):
            image = frame(20 + seed, length_px=0, angle_deg=0, noise_std=noise_std, exponent=exponent)
            assert whittle.estimate(image).verdict == "no blur"

    @pytest.mark.parametrize("std_px", [(0.6, 0.6), (1.2, 0.4)])
    def test_gaussian_spot_is_not_motion(self, std_px):
        """A lens, round or astigmatic, rolls off without a zero. Control: motion of the same variance is blur."""
        large = texture(30, exponent=2.4)
        u, v = np.fft.fftfreq(large.shape[1])[None, :], np.fft.fftfreq(large.shape[0])[:, None]
        spot = np.exp(-2 * np.pi**2 * ((std_px[0] * u) ** 2 + (std_px[1] * v) ** 2))
        soft = np.fft.ifft2(np.fft.fft2(large) * spot).real
        assert whittle.estimate(finished(soft, noise_std=0.002, seed=30)).verdict == "no blur"
        moved = blur(large, length_px=np.sqrt(12) * std_px[0], angle_deg=0)
        assert whittle.estimate(finished(moved, noise_std=0.002, seed=30)).verdict == "blur"

    def test_part_that_does_not_move(self):
        large = texture(31, exponent=2.4)
        moved = blur(large, length_px=10, angle_deg=30)
        moved[:, : BORDER_PX + 52] = large[:, : BORDER_PX + 52]
        found = whittle.estimate(finished(moved, noise_std=0.005, seed=31))
        assert found.verdict == "not uniform"
        assert length_error_px(found.length_px, 10) < 0.5
        assert found.spectrum.static_share > 0.03

    def test_motion_from_rest(self):
        """Offsets grow with the square of the time: the zeros fill in."""
        times = (np.arange(64) + 0.5) / 64
        large = sub_frames(texture(32, exponent=2.4), 15 * times**2, angle_deg=60)
        assert whittle.estimate(finished(large, noise_std=0.002, seed=32)).verdict == "not uniform"

    @pytest.mark.parametrize("quarters, is_shown", [(1, False), (2, True), (4, True)])
    def test_two_quarters_must_show_a_doubtful_motion(self, quarters, is_shown):
        """Texture in motion in some quarters of the frame, none in the others but noise."""
        moved = blur(texture(33, exponent=2.4), length_px=8, angle_deg=30)[BORDER_PX:-BORDER_PX, BORDER_PX:-BORDER_PX]
        inside = np.zeros(moved.shape)
        for row, column in [(0, 0), (1, 1), (0, 1), (1, 0)][:quarters]:
            inside[128 * row : 128 * (row + 1), 128 * column : 128 * (column + 1)] = 1
        noise = 0.005 * np.random.default_rng(33).standard_normal(moved.shape)
        found = find(moved)
        shown = shows_in_parts(
            0.5 + (moved - 0.5) * inside + noise, scale=found.scale, parameters=found.fit.parameters, lens_std_px=None
        )
        assert shown == is_shown

    def test_one_long_edge_is_not_motion(self):
        """A corner of the picture of an eye: the straight border of its round field looks like 30 px across it."""
        crop = textures.crop(Texture(picture="retina", use="test"), place=2, side_px=256, margin_px=0)
        image = np.repeat((np.rint(255 * crop) / 255)[..., None], 3, axis=2).astype(np.float32)
        found = whittle.estimate(image)
        assert (found.verdict, found.length_px > 20) == ("no blur", True)

    def test_longer_motions_need_more_evidence(self):
        assert least_nats(1.5) == least_nats(2.0) < least_nats(4.0) < least_nats(40.0) < 5 * least_nats(2.0)

    def test_verdicts_are_the_named_ones(self):
        assert set(VERDICTS) == {"blur", "no blur", "not uniform"}


class TestLens:
    def test_known_lens_is_not_taken_for_motion(self):
        large = texture(40)
        u, v = np.fft.fftfreq(large.shape[1])[None, :], np.fft.fftfreq(large.shape[0])[:, None]
        spot = np.exp(-2 * np.pi**2 * 0.8**2 * (u**2 + v**2))
        moved = np.fft.ifft2(np.fft.fft2(large) * spot * otf(large.shape, length_px=3, angle_deg=70)).real
        image = finished(moved, noise_std=0.005, seed=40)
        known = length_error_px(whittle.estimate(image, lens_std_px=0.8).length_px, 3)
        assert known < 0.5
        # a lens that is not there hides blur or bends the texture: the knowledge is used
        assert known != length_error_px(whittle.estimate(image, lens_std_px=2.0).length_px, 3)


def board(seed, *, module_px=14, size_px=256):
    """Return a board of black and white squares, as large as a `texture`."""
    side = size_px + 2 * BORDER_PX
    squares = np.random.default_rng(seed).integers(0, 2, (side // module_px + 1,) * 2)
    return 0.2 + 0.6 * np.kron(squares, np.ones((module_px, module_px)))[:side, :side]


class TestSquares:
    @pytest.mark.parametrize("module_px", [6, 14])
    def test_squares_of_one_size_are_no_blur(self, module_px):
        """Zeros in both directions, as those of tags. A moving board is not called blurred by its squares' size, and a
        texture whose blur is as long is. Negative control: without the look at right angles the board is blurred."""
        image = finished(board(70, module_px=module_px), noise_std=0.004, seed=70)
        assert whittle.estimate(image).verdict == "no blur"
        assert set(field(image).verdict.ravel()) == {"no blur"}
        moved = whittle.estimate(
            finished(blur(board(70, module_px=module_px), length_px=3, angle_deg=30), noise_std=0.004, seed=70)
        )
        assert moved.verdict == "no blur" or moved.length_px == pytest.approx(3, abs=0.5)
        textured = whittle.estimate(frame(71, length_px=module_px, angle_deg=0))
        assert textured.verdict == "blur" and textured.length_px == pytest.approx(module_px, abs=0.5)
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(picture, "is_of_squares", lambda *args, **keywords: False)
            assert whittle.estimate(image).verdict != "no blur"


class TestField:
    def test_two_depths(self):
        """Left and right half move by 5 and 10 px: tiles inside a half see their own."""
        large = texture(50, exponent=2.4)
        moved = blur(large, length_px=5, angle_deg=20)
        middle = large.shape[1] // 2
        moved[:, middle:] = blur(large, length_px=10, angle_deg=20)[:, middle:]
        found = field(finished(moved, noise_std=0.003, seed=50), tile_px=128, step_px=128)
        assert found.centres_px.tolist() == [[[64, 64], [192, 64]], [[64, 192], [192, 192]]]
        lengths = np.hypot(*np.moveaxis(found.displacement_px, -1, 0))
        np.testing.assert_allclose(lengths, [[5, 10], [5, 10]], atol=0.3)
        angles = np.degrees(np.arctan2(found.displacement_px[..., 1], found.displacement_px[..., 0]))
        np.testing.assert_allclose(angles, 20, atol=3)
        assert set(found.verdict.ravel()) == {"blur"}
        assert np.all(np.linalg.eigvalsh(found.covariance_px2) > 0)

    def test_empty_tiles_are_nan(self):
        image = frame(51, length_px=5, angle_deg=20)
        image[:128, :128] = 0.25
        found = field(image, tile_px=128, step_px=128)
        assert np.all(np.isnan(found.displacement_px[0, 0]))
        assert np.all(np.isfinite(found.displacement_px[1]))
        assert found.verdict[0, 0] == "no blur"

    def test_tiles_without_detail_move_with_their_neighbours_and_tiles_at_rest_do_not(self):
        """Nine tiles, one of them empty, one at rest. Control: without `fill` the empty one has no answer."""
        large = texture(53, size_px=384, exponent=2.4)
        moved = blur(large, length_px=8, angle_deg=30)
        rest = np.s_[BORDER_PX + 256 :, BORDER_PX + 256 :]
        moved[rest] = large[rest]
        image = finished(moved, noise_std=0.003, seed=53)
        image[:128, :128] = 0.25
        found = field(image, tile_px=128, step_px=128, fill=True)
        lengths = np.hypot(*np.moveaxis(found.displacement_px, -1, 0))
        assert lengths[0, 0] == pytest.approx(8, abs=0.5) and found.verdict[0, 0] == "blur"
        assert found.verdict[2, 2] == "no blur"
        np.testing.assert_allclose(np.delete(lengths.ravel(), 8), 8, atol=0.5)
        assert np.isnan(field(image, tile_px=128, step_px=128).displacement_px[0, 0, 0])

    def test_the_estimators_field(self):
        """One tile where all moves alike; tiles, filled, where it does not. A small picture has no tiles."""
        found = whittle.field(frame(54, length_px=7, angle_deg=50))
        assert found["centres_px"].tolist() == [[128, 128]] and found["verdict"].tolist() == ["blur"]
        assert np.hypot(*found["displacement_px"][0]) == pytest.approx(7, abs=0.3)
        large = texture(55, size_px=384, exponent=2.4)
        moved = blur(large, length_px=5, angle_deg=20)
        middle = large.shape[1] // 2
        moved[:, middle:] = blur(large, length_px=12, angle_deg=110)[:, middle:]
        found = whittle.field(finished(moved, noise_std=0.003, seed=55))
        lengths = np.hypot(*found["displacement_px"].T)
        across_px = found["centres_px"][:, 0]
        assert len(lengths) == 25
        assert np.median(lengths[across_px <= 128]) == pytest.approx(5, abs=0.3)
        assert np.median(lengths[across_px >= 256]) == pytest.approx(12, abs=0.3)

    @pytest.mark.parametrize("tile_px, step_px", [(31, 8), (257, 8), (64, 0)])
    def test_refuses_tiles_that_do_not_fit(self, tile_px, step_px):
        with pytest.raises(ValueError, match="whittle field: got"):
            field(frame(52, length_px=5, angle_deg=20), tile_px=tile_px, step_px=step_px)


class TestBadInput:
    def test_constant_tiny_and_nan(self):
        with pytest.raises(ValueError, match="constant"):
            whittle.estimate(np.full((64, 64, 3), 0.4, np.float32))
        with pytest.raises(ValueError, match=">= 16"):
            whittle.estimate(np.random.default_rng(0).random((8, 8, 3)).astype(np.float32))
        broken = frame(60, length_px=3, angle_deg=0)
        broken[5, 5, 1] = np.nan
        with pytest.raises(ValueError, match="NaN"):
            whittle.estimate(broken)

    def test_saturated(self):
        image = frame(61, length_px=6, angle_deg=30)
        with pytest.raises(ValueError, match="saturated"):
            whittle.estimate(np.minimum(image, np.quantile(image, 0.8)))
        few = whittle.estimate(np.minimum(image, np.quantile(image, 0.98)))
        assert length_error_px(few.length_px, 6) < 0.3

    @pytest.mark.parametrize("lens_std_px", [-1.0, np.nan])
    def test_lens(self, lens_std_px):
        with pytest.raises(ValueError, match="lens_std_px"):
            whittle.estimate(frame(62, length_px=3, angle_deg=0), lens_std_px=lens_std_px)

    def test_texture_at_the_border_only(self):
        image = np.zeros((64, 64, 3), np.float32)
        image[:1] = np.random.default_rng(0).random((1, 64, 1))
        assert whittle.estimate(image)[:2] == (0.0, 0.0)
        assert whittle.estimate(image).verdict == "no blur"

    @pytest.mark.parametrize("height, width", [(16, 16), (17, 23), (48, 64), (64, 49)])
    def test_small_pictures_give_numbers(self, height, width):
        found = whittle.estimate(frame(63, length_px=3, angle_deg=70)[:height, :width])
        assert np.all(np.isfinite(found[:2]))
        assert np.all(np.isfinite(found.covariance))


class TestFrequencies:
    @pytest.mark.parametrize("shape", [(32, 32), (31, 33), (32, 33)])
    def test_leakage_is_the_convolution_on_the_whole_plane(self, shape):
        full = np.abs(np.fft.fft2(np.random.default_rng(0).standard_normal(shape))) ** 2
        found = frequencies(*shape)
        expected = np.zeros_like(full)
        reach = len(found.leakage[0]) // 2
        for i, down in enumerate(range(-reach, reach + 1)):
            for j, right in enumerate(range(-reach, reach + 1)):
                expected += found.leakage[0][i] * found.leakage[1][j] * np.roll(full, (down, right), (0, 1))
        half = slice(shape[1] // 2 + 1)
        np.testing.assert_allclose(found.leak(full[:, half]), expected[:, half], rtol=1e-10)

    def test_every_pair_once(self):
        """Of each frequency and its mirror image exactly one is fitted."""
        for shape in ((32, 32), (31, 33)):
            found = frequencies(*shape)
            seen = np.zeros(shape, int)
            for row, column in np.argwhere(found.fitted):
                seen[row, column] += 1
                seen[-row, -column] += 1
            u, v = np.fft.fftfreq(shape[1])[None, :], np.fft.fftfreq(shape[0])[:, None]
            far = np.hypot(u, v) >= found.lowest_frequency
            own = ((2 * u) % 1 == 0) & ((2 * v) % 1 == 0)
            np.testing.assert_array_equal(seen[far & ~own], 1)
            assert np.all(seen[~far] == 0)

    def test_white_noise_has_its_variance(self):
        found = frequencies(256, 256)
        power = found.periodogram(0.3 * np.random.default_rng(1).standard_normal((256, 256)))
        # statistical: 33 000 exponential numbers, correlated by the taper
        assert power[found.fitted].mean() == pytest.approx(0.09, rel=0.03)


class TestSlopes:
    def test_gradient_is_that_of_the_loss(self):
        """The loss falls to the fit from every side: a step in any parameter costs, with the noise fitted again."""
        image = frame(70, length_px=6, angle_deg=40, noise_std=0.01)[..., 0].astype(float)
        found = frequencies(*image.shape)
        power = found.periodogram(image / image.std()).astype(np.float32)
        prior = model.prior()
        start = prior[0].copy()
        start[:3] = 6 * np.cos(np.radians(40)), 6 * np.sin(np.radians(40)), np.log((0.01 / image.std()) ** 2)
        options = {"limit_px": 40.0, "prior": prior}
        best = refine(found, power, start, **options)
        std = 1 / np.sqrt(np.diag(best.information + np.diag(best.precision)))
        for index in set(range(model.PARAMETERS)) - {model.NOISE}:
            for sign in (-1, 1):
                away = best.parameters.copy()
                away[index] += sign * 2 * std[index]
                assert refine(found, power, away, free=[model.NOISE], **options).loss > best.loss + 0.5


@pytest.mark.filterwarnings("error")
def test_a_step_out_of_float32_is_not_taken():
    """Where noise covers the texture, its brightness hangs on little: the first step is past what float32 holds."""
    found = frequencies(96, 96)
    power = found.cells.mean(found.periodogram(30 * np.random.default_rng(3).normal(size=(96, 96)))[found.fitted])
    start = np.zeros((1, model.PARAMETERS))
    start[0, [model.STATIC, model.FILL]], start[0, model.TEXTURE.start] = -12.0, -9.0
    given = {"free": np.array([model.TEXTURE.start]), "limit_px": 10.0, "prior": model.prior()}
    _, before, _ = fit_cells(found.cells, power, start, steps=0, **given)
    after, losses, _ = fit_cells(found.cells, power, start, steps=12, **given)
    assert losses[0] < before[0]
    assert np.isfinite(after).all()
