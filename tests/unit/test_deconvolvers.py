"""Deconvolvers with the true blur, against closed forms, a dense solution, and the blurred picture as it came."""

import json
from typing import NamedTuple

import numpy as np
import pytest

from uwsim import cli, photographs
from uwsim.discovery import discover
from uwsim.images import linear_from_srgb_uint8, read_srgb, srgb_uint8_from_linear, write_png
from uwsim.motion_blur import deconvolvers, unknown_boundary
from uwsim.motion_blur.deconvolution import (
    WHITE_FROM,
    Canvas,
    canvas_of,
    half_of,
    leaves_unchanged,
    weights_of_half,
    wiener_filtered,
)
from uwsim.motion_blur.deconvolvers import mmse, plug_and_play_tv, richardson_lucy, unsupervised_wiener, wiener
from uwsim.motion_blur.estimate import Estimate
from uwsim.motion_blur.extension import harmonic_extension
from uwsim.motion_blur.kernels import blur, kernel, otf
from uwsim.motion_blur.spectrum import Spectrum, texture_terms
from uwsim.motion_blur.tiles import BlurField, deblur_tiles
from uwsim.motion_blur.whittle.known_blur import spectrum_of_blurred

METHODS = {name: module for name, module in discover(deconvolvers).items() if name != "none"}
BORDER_PX = 32


class Known(NamedTuple):
    """Noise and texture told to a deconvolver instead of fitted: an isotropic power law."""

    noise_std: float
    level: float = 0.1

    def texture_psd(self, u, v):
        return self.level * np.maximum(np.hypot(u, v) / 0.1, 0.05) ** -2.8


def texture(side, seed=0):
    """Return a (side, side) Gaussian texture of the density of Known, mean 0.5."""
    rng = np.random.default_rng(seed)
    density = Known(0.0).texture_psd(np.fft.fftfreq(side)[None, :], np.fft.fftfreq(side)[:, None])
    density[0, 0] = 0
    return 0.5 + np.fft.ifft2(np.fft.fft2(rng.standard_normal((side, side))) * np.sqrt(density)).real


def photograph(side=192):
    """Return the middle of scikit-image's photograph `camera`, (side, side) in [0, 1]."""
    from skimage import data

    picture = data.camera() / 255
    first = (picture.shape[0] - side) // 2
    return picture[first : first + side, first : first + side]


def seen(sharp, *, length_px, angle_deg, noise=0.01, bits=True, seed=0):
    """Return (blurred, sharp), both without the outer 32 px: what lies beyond the border is in the blurred picture."""
    inner = (slice(BORDER_PX, -BORDER_PX), slice(BORDER_PX, -BORDER_PX))
    moved = blur(sharp, length_px=length_px, angle_deg=angle_deg)[inner]
    moved = moved + noise * np.random.default_rng(seed).standard_normal(moved.shape)
    if bits:
        moved = np.rint(255 * np.clip(moved, 0, 1)) / 255
    return moved, np.clip(sharp[inner], 0, 1)


def psnr(picture, truth):
    return -10 * np.log10(np.mean((np.asarray(picture, float) - truth) ** 2))


class TestExtension:
    def test_bands_are_harmonic_and_the_picture_stays(self):
        """Round-off: every new pixel inside a band is the mean of its four neighbours, across the seam too."""
        picture = np.random.default_rng(0).random((2, 20, 27))
        canvas = harmonic_extension(picture, (31, 40))
        np.testing.assert_array_equal(canvas[:, :20, :27], picture)
        mean = sum(np.roll(canvas, step, axis) for step in (-1, 1) for axis in (-1, -2)) / 4
        below, beside = slice(20, None), slice(27, None)
        for band in ((below, slice(1, 26)), (slice(1, 19), beside), (below, beside)):
            np.testing.assert_allclose(canvas[:, *band], mean[:, *band], atol=1e-12)
        assert canvas.max() <= picture.max()

    def test_no_seam(self):
        """A ramp jumps where it repeats; continued it steps by its height / margin at most, and a little more."""
        ramp = np.broadcast_to(np.linspace(0, 1, 50)[:, None], (50, 30))
        steps = np.abs(np.diff(np.concatenate([(canvas := harmonic_extension(ramp, (70, 40))), canvas[:1]]), axis=0))
        assert steps.max() < 1.1 / 21
        assert abs(ramp[-1] - ramp[0]).max() == 1

    def test_no_margin_and_too_small_a_canvas(self):
        picture = np.random.default_rng(0).random((6, 5))
        np.testing.assert_array_equal(harmonic_extension(picture, (6, 5)), picture)
        assert harmonic_extension(picture, (7, 5)).shape == (7, 5)
        with pytest.raises(ValueError, match="harmonic_extension: got canvas"):
            harmonic_extension(picture, (5, 5))


class TestSpectrum:
    @pytest.mark.parametrize("length_px", [2, 9])
    def test_noise_and_texture_of_known_ones(self, length_px):
        """Model tolerance: 4 % of the noise; 15 % of the density at 0.05 to 0.3 per pixel, from some thousand bins."""
        picture, _ = seen(texture(256), length_px=length_px, angle_deg=25, noise=0.01, bits=False)
        fit = spectrum_of_blurred(picture, length_px=length_px, angle_deg=25)
        assert fit.noise_std == pytest.approx(0.01, rel=0.04)
        along = np.array([0.05, 0.1, 0.2, 0.3])
        for u, v in ((along, 0 * along), (0 * along, along)):
            np.testing.assert_allclose(fit.texture_psd(u, v), Known(0).texture_psd(u, v), rtol=0.3)

    def test_a_blur_longer_than_the_cells_resolve(self):
        """Model tolerance as above. Stripes 1 / 60 apart; the fit averages over cells of 1 / 85."""
        picture, _ = seen(texture(320), length_px=60, angle_deg=70, noise=0.01, bits=False)
        fit = spectrum_of_blurred(picture, length_px=60, angle_deg=70)
        assert fit.noise_std == pytest.approx(0.01, rel=0.04)
        along = np.array([0.05, 0.1, 0.2])
        np.testing.assert_allclose(fit.texture_psd(along, 0), Known(0).texture_psd(along, 0), rtol=0.3)

    def test_density_is_that_of_the_terms(self):
        """Round-off: term by term and all at once; frequency 0 and both signs of the highest."""
        factors = np.random.default_rng(0).normal(size=14)
        u, v = np.fft.fftfreq(8)[None, :], np.fft.fftfreq(6)[:, None]
        terms = texture_terms(u, v, lowest_frequency=0.05)
        found = Spectrum(0.1, tuple(factors), 0.05).texture_psd(u, v)
        np.testing.assert_allclose(found, np.exp(terms @ factors), rtol=1e-12)
        phi = np.arctan2(-v, u) + 0 * u
        np.testing.assert_allclose(terms[..., 4], np.cos(2 * phi), atol=1e-14)
        np.testing.assert_allclose(terms[..., 9], np.sin(4 * phi), atol=1e-14)

    def test_control_another_blur_has_another_spectrum(self):
        picture, _ = seen(texture(256), length_px=9, angle_deg=25, noise=0.01, bits=False)
        fit = spectrum_of_blurred(picture, length_px=0, angle_deg=0)
        assert fit.texture_psd(0.3, 0.0) < 0.5 * Known(0).texture_psd(0.3, 0.0)


class TestUnknownBoundary:
    def test_against_a_dense_solution(self):
        """Round-off and the solver's tolerance: the system written out as matrices, solved at once."""
        shape, known, rng = (12, 14), np.zeros((12, 14), bool), np.random.default_rng(0)
        known[:8, :10] = True
        known[3, 4:6] = False
        transfer = half_of(otf(shape, length_px=3, angle_deg=40))
        density = half_of(Known(0).texture_psd(np.fft.fftfreq(14)[None, :], np.fft.fftfreq(12)[:, None]))
        data = np.where(known, rng.standard_normal(shape), 0)
        spectra = np.fft.rfft2(np.eye(168).reshape(168, *shape))
        blurs, whitens = (
            np.fft.irfft2(spectra * gain, s=shape).reshape(168, 168).T for gain in (transfer, 0.05**2 / density)
        )
        np.testing.assert_allclose(blurs, blurs.T, atol=1e-15)
        masked = blurs[known.ravel()]
        exact = np.linalg.solve(masked.T @ masked + whitens, masked.T @ data[known]).reshape(shape)
        canvas = Canvas(shape, transfer, density, 0.05)
        solved = unknown_boundary.posterior_mean(data, known, canvas, tolerance=1e-9)
        np.testing.assert_allclose(solved.sharp, exact, atol=1e-7)
        assert solved.residual <= 1e-9
        np.testing.assert_array_equal(solved.filled[known], data[known])
        np.testing.assert_allclose(solved.filled[~known], (blurs @ exact.ravel()).reshape(shape)[~known], atol=1e-7)
        everything = unknown_boundary.posterior_mean(data, np.ones(shape, bool), canvas, tolerance=1e-9)
        assert np.abs(everything.sharp - exact).max() > 0.01

    @pytest.mark.parametrize("length_px, least_db", [(1.2, 75), (3, 55), (8, 45)])
    def test_inverse_without_noise(self, length_px, least_db):
        """Model tolerance, inside of 32 px of border: what a noise of a thousandth of the contrast, the least that is
        reckoned with, leaves; most near the zeros of the transfer, of which 1.2 px have none.
        """
        flat = 0.5 + 0.25 * (texture(224, seed=1) - 0.5)
        moved, sharp = seen(flat, length_px=length_px, angle_deg=20, noise=0, bits=False)
        result = mmse.deblur(moved, blur=Estimate(length_px, 20), spectrum=Known(1e-5, level=0.1 / 16))
        inner = (slice(32, -32), slice(32, -32))
        assert psnr(result[inner], sharp[inner]) > least_db
        assert psnr(moved[inner], sharp[inner]) < least_db - 9

    def test_solver_says_how_far_it_came(self):
        moved, _ = seen(photograph(), length_px=8, angle_deg=30)
        for solution in unknown_boundary.sharp_image(moved, blur=Estimate(8, 30)).solutions.values():
            assert solution.residual <= unknown_boundary.TOLERANCE
            assert 0 < solution.iterations < unknown_boundary.MOST_ITERATIONS

    def test_what_does_not_converge_is_refused(self, monkeypatch):
        monkeypatch.setattr(unknown_boundary, "MOST_ITERATIONS", 1)
        moved, _ = seen(photograph(), length_px=15, angle_deg=30, noise=0)
        with pytest.raises(ValueError, match="unknown boundary: 1 iterations"):
            mmse.deblur(moved, blur=Estimate(15, 30))


class TestGains:
    @pytest.mark.parametrize("name", METHODS)
    @pytest.mark.parametrize("length_px, least_db", [(4, 1.0), (8, 1.5)])
    def test_nearer_to_the_truth_at_1_percent_noise(self, name, length_px, least_db):
        """Control: told a blur across the true one, the reference makes it worse."""
        moved, sharp = seen(photograph(), length_px=length_px, angle_deg=30)
        result = METHODS[name].deblur(moved.astype(np.float32), blur=Estimate(length_px, 30))
        assert psnr(result, sharp) > psnr(moved, sharp) + least_db

    def test_control_the_wrong_blur_makes_it_worse(self):
        moved, sharp = seen(photograph(), length_px=8, angle_deg=30)
        assert psnr(mmse.deblur(moved, blur=Estimate(8, 120)), sharp) < psnr(moved, sharp) - 1

    @pytest.mark.parametrize("name", METHODS)
    def test_short_blur_makes_nothing_worse(self, name):
        moved, sharp = seen(photograph(), length_px=2, angle_deg=75)
        result = METHODS[name].deblur(moved.astype(np.float32), blur=Estimate(2, 75))
        assert psnr(result, sharp) > psnr(moved, sharp) - 0.02

    def test_borders(self):
        """A long blur: unknown boundary before harmonic continuation. Control: the bare Fourier filter is worst."""
        moved, sharp = seen(photograph(), length_px=15, angle_deg=30)
        estimate = Estimate(15, 30)
        roomy = canvas_of(moved, estimate)
        transfer = half_of(otf(moved.shape, length_px=15, angle_deg=30))
        u, v = np.fft.rfftfreq(moved.shape[1])[None, :], np.fft.fftfreq(moved.shape[0])[:, None]
        fit = spectrum_of_blurred(moved, length_px=15, angle_deg=30)
        bare = wiener_filtered(moved, Canvas(moved.shape, transfer, fit.texture_psd(u, v), roomy.noise_std))
        continued = wiener.deblur(moved, blur=estimate)
        assert psnr(np.clip(bare, 0, 1), sharp) < psnr(continued, sharp) - 2
        assert psnr(continued, sharp) < psnr(mmse.deblur(moved, blur=estimate), sharp) - 0.3

    def test_channels_together_beat_channels_alone(self):
        from skimage import data

        picture = data.astronaut()[100:292, 150:342] / 255
        moved, sharp = seen(picture, length_px=6, angle_deg=30)
        together = mmse.deblur(moved, blur=Estimate(6, 30))
        alone = np.stack([mmse.deblur(moved[..., band], blur=Estimate(6, 30)) for band in range(3)], axis=-1)
        assert psnr(together, sharp) > psnr(alone, sharp) + 0.3

    def test_gamma_smooths(self):
        moved, _ = seen(photograph(128), length_px=6, angle_deg=0)
        rough, smooth = (wiener.deblur(moved, blur=Estimate(6, 0), gamma=gamma) for gamma in (1.0, 10.0))
        assert np.abs(np.diff(smooth)).mean() < 0.9 * np.abs(np.diff(rough)).mean()
        with pytest.raises(ValueError, match="wiener: got gamma"):
            wiener.deblur(moved, blur=Estimate(6, 0), gamma=0.0)

    def test_spectrum_of_the_estimate_is_used(self):
        class Richer(NamedTuple):
            length_px: float
            angle_deg: float
            spectrum: object

        moved, _ = seen(photograph(128), length_px=6, angle_deg=0)
        told = mmse.deblur(moved, blur=Richer(6, 0, Known(0.3)))
        np.testing.assert_array_equal(told, mmse.deblur(moved, blur=Estimate(6, 0), spectrum=Known(0.3)))
        assert np.abs(told - mmse.deblur(moved, blur=Estimate(6, 0))).max() > 0.05
        three = np.repeat(moved[..., None], 3, axis=2)
        np.testing.assert_allclose(mmse.deblur(three, blur=Richer(6, 0, Known(0.3)))[..., 1], told, atol=1e-3)


class TestRichardsonLucy:
    def canvas(self, noise, length_px=8):
        shape = (64, 64)
        u, v = np.fft.rfftfreq(64)[None, :], np.fft.fftfreq(64)[:, None]
        transfer = otf(shape, length_px=length_px, angle_deg=0)[:, :33]
        return Canvas(shape, transfer, Known(0, 0.05).texture_psd(u, v), noise)

    def test_noise_takes_iterations_away(self):
        line = kernel(9, length_px=8, angle_deg=0)
        numbers = [richardson_lucy.best_iterations(self.canvas(noise), line) for noise in (0.003, 0.03, 0.1, 1.0)]
        assert numbers == sorted(numbers, reverse=True)
        assert numbers[0] > 5 * numbers[2] > 0
        line = kernel(3, length_px=1, angle_deg=0)
        assert richardson_lucy.best_iterations(self.canvas(0.05, length_px=1), line) == 0

    def test_the_chosen_number_is_near_the_best(self, monkeypatch):
        """Model tolerance 0.3 dB: a fifth and three times the chosen number are no better."""
        moved, sharp = seen(photograph(), length_px=8, angle_deg=30)
        chosen = psnr(richardson_lucy.deblur(moved, blur=Estimate(8, 30)), sharp)
        number = richardson_lucy.best_iterations(
            canvas_of(moved, Estimate(8, 30)), kernel(9, length_px=8, angle_deg=30)
        )
        for other in (number // 5, 3 * number):
            monkeypatch.setattr(richardson_lucy, "best_iterations", lambda canvas, line, n=other: n)
            assert psnr(richardson_lucy.deblur(moved, blur=Estimate(8, 30)), sharp) < chosen + 0.3


def highlights(radius_px):
    """Return a photograph at 0.6 of its light with lamps in it, up to seven times white."""
    sharp, rng = 0.6 * photograph(), np.random.default_rng(3)
    row, column = np.mgrid[:192, :192]
    for _ in range(6):
        y, x = rng.uniform(50, 142, 2)
        sharp[(row - y) ** 2 + (column - x) ** 2 < radius_px**2] += rng.uniform(1, 6)
    return sharp


class TestWhite:
    def test_masked_pixels_do_not_ring(self, monkeypatch):
        """Control: without the mask the same method makes the picture worse than it was."""
        moved, sharp = seen(highlights(3), length_px=8, angle_deg=30)
        assert 0.005 < np.mean(moved >= WHITE_FROM) < 0.1
        masked = psnr(mmse.deblur(moved, blur=Estimate(8, 30)), sharp)
        assert masked > psnr(moved, sharp) + 0.5
        monkeypatch.setattr(unknown_boundary, "white_pixels", lambda image: np.zeros(image.shape[:2], bool))
        assert psnr(mmse.deblur(moved, blur=Estimate(8, 30)), sharp) < masked - 2

    def test_inside_of_a_lamp_stays_white(self, monkeypatch):
        """Control: one round, without looking back, takes its inside for unknown and makes it grey."""
        sharp = 0.3 + 0.2 * texture(192)
        row, column = np.mgrid[:192, :192]
        sharp[(row - 96) ** 2 + (column - 96) ** 2 < 25**2] = 1.02
        moved, _ = seen(sharp, length_px=6, angle_deg=0)
        middle = (slice(59, 70), slice(59, 70))
        moved[middle] = 1.0
        assert mmse.deblur(moved, blur=Estimate(6, 0))[middle].mean() > 0.97
        monkeypatch.setattr(unknown_boundary, "_ROUNDS", 1)
        assert mmse.deblur(moved, blur=Estimate(6, 0))[middle].mean() < 1.0


class TestTiles:
    FIELD = BlurField(
        np.array([[x, y] for y in (32.0, 96.0) for x in (16, 48, 80, 112, 144, 176)]),
        np.array([[8, 0]] * 3 + [[0, 8]] * 3 + [[8, 0]] * 3 + [[0, 8]] * 3, float),
    )

    def two_blurs(self):
        """Return (image, sharp), 128 x 192: the left half moved to the right, the right half up."""
        sharp = photograph(256)
        halves = [seen(sharp, length_px=8, angle_deg=angle) for angle in (0, 90)]
        return np.hstack([halves[0][0][:128, :96], halves[1][0][:128, 96:]]), halves[0][1][:128]

    def test_two_blurs_in_one_picture(self):
        """No single blur does; where the blur jumps both halves ring, 24 px from there the tiles are right."""
        image, sharp = self.two_blurs()
        by_tiles = deblur_tiles(image, field=self.FIELD, deblur=mmse.deblur)
        for angle_deg in (0, 45, 90):
            assert psnr(by_tiles, sharp) > psnr(mmse.deblur(image, blur=Estimate(8, angle_deg)), sharp) + 3
        away = np.abs(np.arange(192) - 95.5) > 24
        assert psnr(by_tiles[:, away], sharp[:, away]) > psnr(image[:, away], sharp[:, away]) + 1
        swapped = self.FIELD._replace(displacements_px=self.FIELD.displacements_px[:, ::-1])
        assert psnr(deblur_tiles(image, field=swapped, deblur=wiener.deblur), sharp) < psnr(by_tiles, sharp) - 3

    def test_blur_that_grows_across_the_picture(self):
        lengths_px, along = np.linspace(3, 13, 11), np.linspace(0, 10, 192)
        steps = np.stack([seen(photograph(256), length_px=length, angle_deg=20)[0] for length in lengths_px])
        low = np.minimum(along.astype(int), 9)
        column, share = np.arange(192), along - low
        image = (1 - share) * steps[low, :, column].T + share * steps[low + 1, :, column].T
        sharp = photograph(256)[32:-32, 32:-32]
        centres = np.array([[x, y] for y in (48.0, 144) for x in range(16, 192, 32)])
        length_px = np.interp(centres[:, 0], column + 0.5, 3 + along)[:, None]
        field = BlurField(centres, length_px * [np.cos(np.radians(20)), np.sin(np.radians(20))])
        by_tiles = psnr(deblur_tiles(image, field=field, deblur=mmse.deblur), sharp)
        assert by_tiles > psnr(image, sharp) + 1.5
        for single_px in (4, 8):
            assert by_tiles > psnr(mmse.deblur(image, blur=Estimate(single_px, 20)), sharp) + 1.5

    def test_weights_sum_to_one_and_any_order_will_do(self):
        image, _ = self.two_blurs()
        same = deblur_tiles(image, field=self.FIELD, deblur=lambda tile, blur: tile)
        np.testing.assert_allclose(same, image, atol=1e-12)
        shuffled = BlurField(*(values[::-1] for values in self.FIELD))
        first, second = (deblur_tiles(image, field=field, deblur=wiener.deblur) for field in (self.FIELD, shuffled))
        np.testing.assert_allclose(first, second, atol=1e-12)

    def test_one_blur_by_tiles_is_nearly_the_whole(self):
        moved, sharp = seen(photograph(256), length_px=6, angle_deg=0)
        field = BlurField(np.array([[x, y] for y in (40.5, 140) for x in (50, 140)]), np.array([[6.0, 0]] * 4))
        by_tiles = deblur_tiles(moved, field=field, deblur=mmse.deblur)
        assert psnr(by_tiles, sharp) > psnr(mmse.deblur(moved, blur=Estimate(6, 0)), sharp) - 0.3

    def test_tiles_without_texture_or_of_white_stay(self):
        image = np.random.default_rng(0).random((96, 200, 3)).astype(np.float32)
        image[:, :70], image[:, 130:] = 0.5, 1.0
        field = BlurField(np.array([[x, 48.0] for x in (5, 45, 100, 155, 195)]), np.array([[4.0, 0]] * 5))
        result = deblur_tiles(image, field=field, deblur=wiener.deblur)
        assert result.dtype == np.float32
        np.testing.assert_array_equal(result[:, :5], image[:, :5])
        np.testing.assert_array_equal(result[:, 195:], image[:, 195:])
        assert np.abs(result - image)[:, 80:120].max() > 0.1

    @pytest.mark.parametrize(
        "field, text",
        [
            (BlurField(np.zeros((2, 3)), np.zeros((2, 3))), "allowed: \\(n, 2\\)"),
            (BlurField(np.array([[1.0, 1], [9, 1], [1, 9]]), np.zeros((3, 2))), "a grid"),
            (BlurField(np.array([[1.0, 1], [1, 1]]), np.zeros((2, 2))), "a grid"),
            (BlurField(np.array([[1.0, 1]]), np.full((1, 2), np.nan)), "finite"),
            (BlurField(np.array([[-90.0, 1], [-50, 1]]), np.zeros((2, 2))), "meet the image"),
        ],
    )  # fmt: skip
    def test_refuses_what_is_no_field(self, field, text):
        with pytest.raises(ValueError, match=f"blur field: .*{text}"):
            deblur_tiles(np.random.default_rng(0).random((64, 64)), field=field, deblur=wiener.deblur)


@pytest.mark.parametrize("name", [*METHODS, "none"])
class TestEveryDeconvolver:
    def deblur(self, name, image, **options):
        return discover(deconvolvers)[name].deblur(image, **options)

    def test_refuses_bad_input(self, name):
        image, estimate = np.random.default_rng(0).random((32, 40, 3)).astype(np.float32), Estimate(4, 30)
        broken = image.copy()
        broken[3, 3, 1] = np.nan
        white = image.copy()
        white[:20] = 1.0
        for wrong, text in (
            (np.full_like(image, 0.4), "constant"), (broken, "NaN"), (image[:8, :8], ">= 16"),
            (white, "% of the image"), ((255 * image).astype(np.uint8), "float image"),
        ):  # fmt: skip
            with pytest.raises(ValueError, match=f"^{name}: .*{text}"):
                self.deblur(name, wrong, blur=estimate)
        for wrong in (Estimate(-1, 0), Estimate(np.nan, 0), Estimate(17, 0), Estimate(3, np.inf)):
            with pytest.raises(ValueError, match=f"^{name}: got a blur"):
                self.deblur(name, image, blur=wrong)

    def test_nothing_to_undo(self, name):
        class Judged(NamedTuple):
            length_px: float
            angle_deg: float
            verdict: str

        image = np.random.default_rng(0).random((32, 40, 3)).astype(np.float32)
        for estimate in (Estimate(0, 0), Judged(1.2, 30, "no blur")):
            result = self.deblur(name, image, blur=estimate)
            np.testing.assert_array_equal(result, image)
            assert not np.shares_memory(result, image)
        assert leaves_unchanged(image, Judged(1.2, 30, "blur"), where="test") is False

    def test_kinds_and_empty_channels(self, name):
        moved, _ = seen(photograph(112), length_px=3, angle_deg=0)
        grey = self.deblur(name, moved.astype(np.float32), blur=Estimate(3, 0))
        assert (grey.shape, grey.dtype) == (moved.shape, np.float32)
        colour = np.stack([moved, 0.5 * moved, 0 * moved], axis=-1)
        result = self.deblur(name, colour, blur=Estimate(3, 0))
        assert (result.shape, result.dtype) == (colour.shape, np.float64)
        assert np.all(np.isfinite(result))
        assert np.abs(result[..., 2]).max() < 0.03


def test_sampler_has_a_seed():
    moved, _ = seen(photograph(112), length_px=4, angle_deg=0)
    first, again, other = (unsupervised_wiener.deblur(moved, blur=Estimate(4, 0), seed=seed) for seed in (0, 0, 1))
    np.testing.assert_array_equal(first, again)
    assert 0 < np.abs(first - other).max() < 0.05


def test_total_variation_keeps_edges():
    """A picture of flat pieces: far better than the reference, which knows of no edges."""
    sharp = 0.2 + 0.6 * (np.add.outer(np.arange(176) // 22, np.arange(176) // 22) % 2)
    moved, truth = seen(sharp, length_px=7, angle_deg=20)
    flat, wavy = (psnr(module.deblur(moved, blur=Estimate(7, 20)), truth) for module in (plug_and_play_tv, mmse))
    assert flat > wavy + 2


def test_half_spectra_count_every_frequency_once():
    for width in (8, 9):
        picture = np.random.default_rng(0).standard_normal((6, width))
        power = np.abs(np.fft.rfft2(picture)) ** 2
        total = (weights_of_half(picture.shape) * power).sum() / picture.size
        assert total == pytest.approx((picture**2).sum(), rel=1e-12)


class TestCommand:
    def prepared(self, folder):
        sharp = np.repeat(photograph(160)[..., None], 3, axis=2)
        moved, truth = seen(sharp, length_px=8, angle_deg=30, noise=0.002, bits=False)
        write_png(folder / "a.png", srgb_uint8_from_linear(moved))
        return linear_from_srgb_uint8(srgb_uint8_from_linear(moved)), truth

    def run(self, monkeypatch, *arguments):
        monkeypatch.setattr("sys.argv", ["uwsim", *map(str, arguments)])
        with pytest.raises(SystemExit) as stop:
            cli.main()
        return stop.value.code

    def test_writes_sharper_pictures_and_says_what_it_took_the_blur_for(self, tmp_path, monkeypatch, capsys):
        moved, truth = self.prepared(tmp_path)
        out = tmp_path / "out"
        arguments = ("deblur", "mmse", tmp_path / "a.png", "--out", out, "--json", tmp_path / "rows.json")
        assert self.run(monkeypatch, *arguments, "--length-px", 8, "--angle-deg", 210) == 0
        assert "| a.png | 8.00 | 30.0 | blur | uniform |" in capsys.readouterr().out
        assert psnr(linear_from_srgb_uint8(read_srgb(out / "a.png")), truth) > psnr(moved, truth) + 3
        (row,) = json.loads((tmp_path / "rows.json").read_text())
        assert (row["image"], row["method"], row["blur_from"], row["length_px"]) == ("a.png", "mmse", "given", 8.0)
        assert self.run(monkeypatch, *arguments, "--estimator", "cepstrum_minimum") == 0
        (row,) = json.loads((tmp_path / "rows.json").read_text())
        assert row["blur_from"] == "cepstrum_minimum"
        assert row["length_px"] == pytest.approx(8, abs=0.5)

    def test_halves_blurred_differently_are_undone_by_tiles(self, tmp_path, monkeypatch, capsys):
        """Where the blur jumps the tiles ring, 40 px from there they are better than the picture.

        Control: the best single blur, and the true blur of either half, are far worse.
        """
        from skimage import data

        gravel = data.gravel()[:320, :432] / 255
        (left, sharp), (right, _) = (seen(gravel, length_px=9, angle_deg=angle_deg) for angle_deg in (20, 110))
        half = left.shape[1] // 2
        picture = srgb_uint8_from_linear(np.repeat(np.hstack([left[:, :half], right[:, half:]])[..., None], 3, axis=2))
        write_png(tmp_path / "a.png", picture)
        arguments = ("deblur", "mmse", tmp_path / "a.png", "--out", tmp_path / "out")
        assert self.run(monkeypatch, *arguments, "--json", tmp_path / "rows.json") == 0
        assert "every tile has its own" in (printed := capsys.readouterr().out)
        (row,) = json.loads((tmp_path / "rows.json").read_text())
        # a tile across the seam may have no blur that can be told
        assert row["verdict"] == "not uniform"
        undone, _, tiles = row["how"].partition(" of ")
        assert tiles == "12 tiles" and int(undone) >= 8
        assert f"| not uniform | {row['how']} |" in printed
        moved = linear_from_srgb_uint8(picture)
        written = linear_from_srgb_uint8(read_srgb(tmp_path / "out/a.png"))[..., 0]
        away = np.abs(np.arange(2 * half) + 0.5 - half) > 40
        assert psnr(written[:, away], sharp[:, away]) > psnr(moved[:, away, 0], sharp[:, away]) + 2
        by_tiles = psnr(written, sharp)
        for blur_ in (Estimate(row["length_px"], row["angle_deg"]), Estimate(9, 20), Estimate(9, 110)):
            assert by_tiles > psnr(mmse.deblur(moved, blur=blur_)[..., 0], sharp) + 5

    def test_a_picture_without_blur_is_left_alone(self, tmp_path, monkeypatch, capsys):
        from skimage import data

        write_png(tmp_path / "a.png", data.astronaut()[:200, 100:300])
        arguments = ("deblur", "mmse", tmp_path / "a.png", "--out", tmp_path / "out")
        assert self.run(monkeypatch, *arguments) == 0
        assert "| no blur | left alone |" in (printed := capsys.readouterr().out)
        assert "the picture is as it was" in printed
        np.testing.assert_array_equal(read_srgb(tmp_path / "out/a.png"), read_srgb(tmp_path / "a.png"))

    def test_all_or_nothing(self, tmp_path, monkeypatch, capsys):
        self.prepared(tmp_path)
        write_png(tmp_path / "b.png", np.full((64, 64, 3), 90, np.uint8))
        arguments = (tmp_path / "a.png", tmp_path / "b.png", "--out", tmp_path / "out")
        assert self.run(monkeypatch, "deblur", "wiener", *arguments, "--length-px", 4, "--angle-deg", 0) == 2
        error = capsys.readouterr().err
        assert error.count("\n") == 1
        assert "b.png" in error
        assert not (tmp_path / "out").exists()

    @pytest.mark.parametrize("table", ["a.png", "out/a.png"])
    def test_the_table_does_not_take_the_place_of_a_picture(self, tmp_path, monkeypatch, capsys, table):
        self.prepared(tmp_path)
        before = (tmp_path / "a.png").read_bytes()
        (tmp_path / "out").mkdir()
        arguments = (tmp_path / "a.png", "--out", tmp_path / "out", "--json", tmp_path / table)
        assert self.run(monkeypatch, "deblur", "wiener", *arguments, "--length-px", 4, "--angle-deg", 0) == 2
        assert "is a picture, allowed: another file" in " ".join(capsys.readouterr().err.split())
        assert (tmp_path / "a.png").read_bytes() == before and not list((tmp_path / "out").iterdir())

    def test_a_folder_in_the_place_of_a_picture_is_seen_before_anything_is_written(self, tmp_path, monkeypatch, capsys):
        self.prepared(tmp_path)
        write_png(tmp_path / "b.png", read_srgb(tmp_path / "a.png"))
        (tmp_path / "out" / "b.png").mkdir(parents=True)
        arguments = (
            tmp_path / "a.png",
            tmp_path / "b.png",
            "--out",
            tmp_path / "out",
            "--length-px",
            4,
            "--angle-deg",
            0,
        )
        assert self.run(monkeypatch, "deblur", "wiener", *arguments) == 2
        assert "is a folder, allowed" in " ".join(capsys.readouterr().err.split())
        assert not (tmp_path / "out" / "a.png").exists()

    def test_a_photograph_is_turned_as_it_says(self, tmp_path):
        """EXIF orientation 6: the camera was held upright. Control: without the tag it stays."""
        import cv2

        lying = np.zeros((32, 48, 3), np.uint8)
        lying[:16] = 200
        jpeg = cv2.imencode(".jpg", lying)[1].tobytes()
        # TIFF header, one entry: tag 0x0112, short, one value
        exif = b"Exif\0\0MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x06\0\0\0\0\0\0"
        tagged = jpeg[:2] + b"\xff\xe1" + (len(exif) + 2).to_bytes(2, "big") + exif + jpeg[2:]
        (tmp_path / "tagged.jpg").write_bytes(tagged)
        (tmp_path / "plain.jpg").write_bytes(jpeg)
        upright = read_srgb(tmp_path / "tagged.jpg")
        assert upright.shape == (48, 32, 3) and upright[:, -8:].mean() > 150 and upright[:, :8].mean() < 50
        assert read_srgb(tmp_path / "plain.jpg").shape == (32, 48, 3)

    def test_a_file_of_ones_own(self, tmp_path):
        self.prepared(tmp_path)
        (tmp_path / "mine.py").write_text("NEEDS = ()\ndef deblur(image):\n    return 255 - image\n")
        photographs.deblur_photographs(
            str(tmp_path / "mine.py"), [tmp_path / "a.png"], tmp_path / "out", estimator="none", length_px=None,
            angle_deg=None, report=lambda *state: None,
        )  # fmt: skip
        np.testing.assert_array_equal(read_srgb(tmp_path / "out/a.png"), 255 - read_srgb(tmp_path / "a.png"))
