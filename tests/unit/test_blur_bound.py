"""The Cramer-Rao bound of blur length and angle: against closed forms, other bounds, and the scatter of estimates."""

import numpy as np
import pytest

from uwsim.motion_blur.bound import bound, spectrum_of_sharp
from uwsim.motion_blur.kernels import otf
from uwsim.motion_blur.spectrum import TEXTURE_TERMS, Spectrum
from uwsim.motion_blur.whittle.picture import find

LOWEST = 0.01


def power_law(*, amplitude, exponent, lowest_frequency=LOWEST):
    """Return a Spectrum amplitude (r / 0.1)^-exponent without noise."""
    texture = (float(np.log(amplitude)), float(exponent)) + (0.0,) * (TEXTURE_TERMS - 2)
    return Spectrum(noise_std=0.0, texture=texture, lowest_frequency=lowest_frequency)


def realisation(spectrum, side_px, rng):
    """Return a Gaussian picture of the spectrum's texture; its mean is 0."""
    u, v = np.fft.fftfreq(side_px)[None, :], np.fft.fftfreq(side_px)[:, None]
    amplitude = np.sqrt(spectrum.texture_psd(u, v))
    amplitude[0, 0] = 0
    return np.fft.fft2(rng.standard_normal((side_px, side_px))) * amplitude


def stds(*arguments, **options):
    return np.sqrt(np.diag(bound(*arguments, **options)))


class TestClosedForm:
    @pytest.mark.parametrize("length_px, angle_deg", [(8, 37), (16, 112)])
    def test_information_near_the_zeros(self, length_px, angle_deg):
        """Setup: white texture, amplitude of signal over noise 1000: all information lies at the zeros s = k / L.

        Expected, with a across the k-th zero line integrated by hand: F_LL = N^2 sum_k 2 pi k A / L^3 times the length
        of the line, F_aa = N^2 sum_k 2 pi A L / k times the integral of the squared distance from the foot point.
        Model tolerance 10 %: the lobes between the zeros add what the form leaves out, texture unknown takes some.
        """
        side_px, amplitude_ratio = 512, 1000.0
        angle = np.radians(angle_deg)
        across = np.linspace(-0.75, 0.75, 20001)
        step = across[1] - across[0]
        by_length = by_angle = 0.0
        for order in range(1, length_px):
            along = order / length_px
            u = along * np.cos(angle) - across * np.sin(angle)
            v = -(along * np.sin(angle) + across * np.cos(angle))
            inside = (np.abs(u) < 0.5) & (np.abs(v) < 0.5)
            by_length += 2 * np.pi * order * amplitude_ratio / length_px**3 * inside.sum() * step
            by_angle += 2 * np.pi * length_px * amplitude_ratio / order * (across**2)[inside].sum() * step
        expected = 1 / np.sqrt(side_px**2 * np.array([by_length, by_angle]))
        flat = power_law(amplitude=1.0, exponent=0.0)
        found = stds(
            flat, noise_std=1 / amplitude_ratio, length_px=length_px, angle_deg=angle_deg, shape=(side_px, side_px)
        )
        np.testing.assert_allclose(found, expected * np.array([1, np.degrees(1)]), rtol=0.1)
        # control: the form sees a length that is off by a fifth
        wrong = stds(
            flat,
            noise_std=1 / amplitude_ratio,
            length_px=1.2 * length_px,
            angle_deg=angle_deg,
            shape=(side_px, side_px),
        )
        assert not np.allclose(wrong, expected * np.array([1, np.degrees(1)]), rtol=0.1)


class TestScaling:
    def test_goes_as_one_over_the_side(self):
        spectrum = power_law(amplitude=0.01, exponent=2.8)
        options = {"noise_std": 0.01, "length_px": 6, "angle_deg": 20}
        small, large = (stds(spectrum, shape=(side, side), **options) for side in (256, 512))
        np.testing.assert_allclose(small / large, 2, rtol=0.05)

    def test_units_cancel(self):
        options = {"length_px": 6, "angle_deg": 20, "shape": (128, 160)}
        one = bound(power_law(amplitude=0.01, exponent=2.8), noise_std=0.01, **options)
        ten = bound(power_law(amplitude=1.0, exponent=2.8), noise_std=0.1, **options)
        np.testing.assert_allclose(one, ten, rtol=1e-6)

    def test_noise_costs(self):
        spectrum = power_law(amplitude=0.01, exponent=2.8)
        options = {"length_px": 4, "angle_deg": 75, "shape": (256, 256)}
        found = [stds(spectrum, noise_std=noise, **options) for noise in (0.001, 0.01, 0.02)]
        assert np.all(np.diff(found, axis=0) > 0)

    def test_covariance(self):
        covariance = bound(
            power_law(amplitude=0.01, exponent=2.8), noise_std=0.01, length_px=3, angle_deg=33, shape=(200, 256)
        )
        assert covariance.shape == (2, 2)
        np.testing.assert_allclose(covariance, covariance.T)
        assert np.all(np.linalg.eigvalsh(covariance) > 0)


class TestScatterOfEstimates:
    @pytest.mark.parametrize(
        "count, lengths",
        [(30, ((9, 120),)), pytest.param(300, ((4, 75), (8, 120)), marks=pytest.mark.slow)],
    )
    def test_estimates_scatter_as_the_bound_says(self, count, lengths):
        """Setup: Gaussian textures f^-2.8 with noise, cut from larger ones, 128 px.

        Expected: root mean square error 1.15 times the bound, what the taper costs. Statistical tolerance: 3.5
        standard errors of a root mean square on top of 1.25. The texture's prior helps short lengths, to 0.7 times;
        lengths over a tenth of the side lose more to the border and are not held to it. Control: the bound of four
        times the noise is not met.
        """
        side_px, border_px, noise_std = 128, 32, 0.005
        spectrum = power_law(amplitude=0.02, exponent=2.8)
        large_px = side_px + 2 * border_px
        error = 3.5 / np.sqrt(2 * count)
        for length_px, angle_deg in lengths:
            rng = np.random.default_rng([length_px, count])
            transfer = otf((large_px, large_px), length_px=length_px, angle_deg=angle_deg)
            deviations = []
            for _ in range(count):
                picture = np.fft.ifft2(realisation(spectrum, large_px, rng) * transfer).real
                picture = picture[border_px:-border_px, border_px:-border_px]
                found = find(picture + noise_std * rng.standard_normal(picture.shape)).estimate()
                deviations.append((found.length_px - length_px, (found.angle_deg - angle_deg + 90) % 180 - 90))
            rms = np.sqrt(np.mean(np.square(deviations), axis=0))
            options = {"length_px": length_px, "angle_deg": angle_deg, "shape": (side_px, side_px)}
            ratio = rms / stds(spectrum, noise_std=noise_std, **options)
            assert np.all(ratio < 1.25 * (1 + error))
            assert np.all(ratio > 0.7)
            assert np.all(rms / stds(spectrum, noise_std=4 * noise_std, **options) < 0.7)


class TestSpectrumOfSharp:
    def test_finds_the_texture(self):
        rng = np.random.default_rng(4)
        spectrum = power_law(amplitude=0.02, exponent=2.4)
        picture = np.fft.ifft2(realisation(spectrum, 256, rng)).real + 0.01 * rng.standard_normal((256, 256))
        found = spectrum_of_sharp(picture)
        assert found.exponent == pytest.approx(2.4, abs=0.1)
        assert found.amplitude == pytest.approx(0.02, rel=0.1)
        options = {"noise_std": 0.01, "length_px": 5, "angle_deg": 20, "shape": (256, 256)}
        np.testing.assert_allclose(stds(found, **options), stds(spectrum, **options), rtol=0.1)
        del options["shape"]
        np.testing.assert_allclose(stds(picture, **options), stds(found, **options, shape=(256, 256)))


class TestRefusals:
    @pytest.mark.parametrize(
        "changed", [{"length_px": 0}, {"length_px": np.nan}, {"noise_std": 0.0}, {"noise_std": np.nan}, {"shape": None}]
    )
    def test_nonsense(self, changed):
        options = {"noise_std": 0.01, "length_px": 3, "angle_deg": 0, "shape": (64, 64)} | changed
        with pytest.raises(ValueError, match="bound: got"):
            bound(power_law(amplitude=0.01, exponent=2.8), **options)

    def test_constant_frame(self):
        with pytest.raises(ValueError, match="constant"):
            bound(np.full((64, 64), 0.5), noise_std=0.01, length_px=3, angle_deg=0)
