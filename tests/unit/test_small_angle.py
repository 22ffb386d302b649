"""The small-angle rule of eq. 2.33: energy of the point-spread function, blur of images, beams widened, defaults."""

import numpy as np
import pytest
from scipy import integrate, optimize, special

from uwsim.formation import small_angle, widened
from uwsim.formation.lens_factor import lens_factor
from uwsim.optics import phase
from uwsim.optics.phase import henyey_greenstein
from uwsim.optics.spectrum import WAVELENGTHS_NM
from uwsim.optics.water import Water, named_water

RULE = {"damping_rad_per_m": 0.05, "loss_per_m": 0.3, "attenuation_per_m": 1.1}
RANGE_M = 1.3
ONES = np.ones(len(WAVELENGTHS_NM))
PIXEL_RAD = 2e-3


def grey(*, absorption_per_m=0.1, scattering_per_m=1.0, g=0.98) -> Water:
    return Water("grey", absorption_per_m * ONES, scattering_per_m * ONES, phase.constant([g], [1.0]))


def test_energy_of_the_point_spread_function():
    """Expected: its integral over the plane is the modulation at 0, and with the unscattered e^(-c R) that is e^(-G R).
    Tolerance: quadrature 1e-6. Negative control: the sign of eq. 2.54, + c."""
    total, _ = integrate.quad(
        lambda t: 2 * np.pi * np.exp(2 * t) * small_angle.psf(np.exp(t), RANGE_M, **RULE), -20, 20, limit=200
    )
    at_zero = small_angle.modulation(0.0, RANGE_M, **RULE)
    assert total == pytest.approx(float(at_zero), rel=1e-6)
    unscattered = np.exp(-1.1 * RANGE_M)
    assert at_zero + unscattered == pytest.approx(np.exp(-0.3 * RANGE_M), rel=1e-12)
    printed = np.exp(-0.3 * RANGE_M) - np.exp(1.1 * RANGE_M)
    assert printed + unscattered != pytest.approx(np.exp(-0.3 * RANGE_M), rel=0.5)


@pytest.mark.parametrize("omega", [1.0, 10.0, 60.0])
def test_point_spread_function_and_modulation_are_a_pair(omega):
    """Expected: the Hankel transform of the one is the other. Tolerance: quadrature 1e-4 of the value at 0. Negative
    control: omega in cycles per radian."""
    angle = np.concatenate([[0], np.geomspace(1e-6, 300, 400_001)])
    values = 2 * np.pi * angle * small_angle.psf(angle, RANGE_M, **RULE) * special.j0(omega * angle)
    found = integrate.simpson(values, x=angle)
    scale = small_angle.modulation(0.0, RANGE_M, **RULE)
    assert found / scale == pytest.approx(small_angle.modulation(omega, RANGE_M, **RULE) / scale, abs=1e-3)
    assert found / scale != pytest.approx(small_angle.modulation(omega / 2 / np.pi, RANGE_M, **RULE) / scale, abs=1e-3)


def test_limits_of_the_scattered_share():
    share = small_angle.scattered_share
    assert share(0.0, loss_per_m=0.1, attenuation_per_m=2.0) == 0
    assert share(np.inf, loss_per_m=0.0, attenuation_per_m=2.0) == 0
    assert share(3.0, loss_per_m=0.4, attenuation_per_m=0.4) == 0
    assert share(3.0, loss_per_m=0.0, attenuation_per_m=0.0) == 0
    # little scattering: (c - G) R, with all its digits
    assert share(1.0, loss_per_m=0.5, attenuation_per_m=0.5 + 1e-12) == pytest.approx(1e-12 * np.exp(-0.5), rel=1e-3)


def test_half_of_the_scattered_light_is_within_1_73_widths():
    assert small_angle.encircled(np.sqrt(3) * 0.02, width_rad=0.02) == pytest.approx(0.5)


def test_blur_keeps_energy_and_wraps_nothing():
    """Setup: a bright square at the left edge. Expected: the sum stays (1e-5), nothing is negative, and the far edge
    gets less than 5 % of what a periodic transform (the negative control) puts there. Tolerance: float32."""
    image = np.zeros((48, 96, 3), np.float32)
    image[20:28, :4] = 1.0
    found = small_angle.blur(image, np.full((48, 96), 0.4), PIXEL_RAD, damping_rad_per_m=0.02)
    assert found.sum() == pytest.approx(image.sum(), rel=1e-5)
    assert found.min() > -1e-7 * image.max()
    periodic = np.fft.ifft2(np.fft.fft2(image[..., 0]) * np.exp(-0.4 * 0.02 / PIXEL_RAD * periodic_omega(48, 96))).real
    assert found[24, -1, 0] < 0.05 * periodic[24, -1]


def periodic_omega(height, width):
    y, x = (2 * np.pi * np.fft.fftfreq(size) for size in (height, width))
    return np.hypot(y[:, None], x[None])


def test_blur_is_the_convolution_with_the_point_spread_function():
    """Setup: a point in the middle, width of 4 pixels. Expected: the point-spread function per pixel. Tolerance: 2 % at
    2 to 20 pixels (pixels are no points; mirror images add). Negative control: half the width."""
    size, width_px = 401, 4.0
    image = np.zeros((size, size, 1), np.float32)
    image[200, 200] = 1.0
    ranges = np.ones((size, size))
    found = small_angle.blur(image, ranges, PIXEL_RAD, damping_rad_per_m=width_px * PIXEL_RAD, **light())
    offset = np.arange(2, 21)

    def expected(factor):
        rule = {"damping_rad_per_m": factor * width_px * PIXEL_RAD} | light()
        return small_angle.psf(offset * PIXEL_RAD, 1.0, **rule) * PIXEL_RAD**2

    np.testing.assert_allclose(found[200, 200 + offset, 0], expected(1.0), rtol=0.02)
    assert not np.allclose(found[200, 200 + offset, 0], expected(0.5), rtol=0.02)


def light() -> dict:
    return {"loss_per_m": 0.2, "attenuation_per_m": 1.2}


def test_each_pixel_is_spread_by_its_own_range():
    """Setup: two points at ranges 1 and 2.9 m, the latter between the widths of slabs. Expected: each as if the whole
    picture were at its range, within 3 % of its peak (cosh ln 1.25 between slabs). Negative control: one range."""
    ranges = np.ones((120, 200))
    ranges[:, 100:] = 2.9
    image = np.zeros((120, 200, 1), np.float32)
    image[60, 40] = image[60, 160] = 1.0
    found = small_angle.blur(image, ranges, PIXEL_RAD, damping_rad_per_m=4e-3, **light())
    parts = []
    for column, metres in ((40, 1.0), (160, 2.9)):
        one = np.zeros_like(image)
        one[60, column] = 1.0
        parts.append(small_angle.blur(one, np.full((120, 200), metres), PIXEL_RAD, damping_rad_per_m=4e-3, **light()))
    np.testing.assert_allclose(found, parts[0] + parts[1], atol=0.03 * parts[1].max())
    one_range = small_angle.blur(image, np.ones((120, 200)), PIXEL_RAD, damping_rad_per_m=4e-3, **light())
    assert not np.allclose(found, one_range, atol=0.03 * parts[1].max())


def test_blur_of_a_uniform_scene_is_uniform_and_infinite_range_dark():
    ranges = np.full((20, 30), 2.0)
    found = small_angle.blur(np.ones((20, 30, 3)), ranges, PIXEL_RAD, damping_rad_per_m=0.1, **light())
    np.testing.assert_allclose(found, np.exp(-0.4) - np.exp(-2.4), rtol=1e-5)
    ranges[:] = np.inf
    assert not small_angle.blur(np.ones((20, 30, 3)), ranges, PIXEL_RAD, damping_rad_per_m=0.1, **light()).any()


def test_blur_refuses():
    image, ranges = np.ones((4, 5, 3)), np.ones((4, 5))
    with pytest.raises(ValueError, match="shape"):
        small_angle.blur(image[..., 0], ranges, PIXEL_RAD, damping_rad_per_m=0.1)
    with pytest.raises(ValueError, match="both or none"):
        small_angle.blur(image, ranges, PIXEL_RAD, damping_rad_per_m=0.1, loss_per_m=0.1)
    with pytest.raises(ValueError, match="infinite range"):
        small_angle.blur(image, ranges + np.inf, PIXEL_RAD, damping_rad_per_m=0.1)
    with pytest.raises(ValueError, match="allowed: 0 to c"):
        small_angle.scattered_share(1.0, loss_per_m=0.5, attenuation_per_m=0.4)
    with pytest.raises(ValueError, match="range_m"):
        small_angle.scattered_share(-1.0, loss_per_m=0.1, attenuation_per_m=0.4)


def test_loss_is_absorption_and_what_leaves_forward_directions():
    """Expected: a + b_b within the hemisphere; between a and c, falling with the angle; Henyey-Greenstein's CDF."""
    water = named_water("tank_medium")
    hemisphere = small_angle.loss_per_m(water, forward_angle_rad=small_angle.HEMISPHERE_RAD)
    np.testing.assert_allclose(hemisphere, water.absorption + water.backscattering, rtol=1e-9)
    values = [small_angle.loss_per_m(water, forward_angle_rad=np.radians(angle)) for angle in (1, 10, 30, 90, 180)]
    assert np.all(np.diff(values, axis=0) < 0)
    np.testing.assert_allclose(values[-1], water.absorption, rtol=1e-9)
    assert np.all(values[0] < water.attenuation)
    one = grey(g=0.9)
    beyond = 1 - one.phase.terms[0].cdf(np.radians(30.0))
    np.testing.assert_allclose(small_angle.loss_per_m(one), 0.1 + beyond, rtol=1e-9)


@pytest.mark.parametrize("optical", [1e-3, 1.0, 4.0])
def test_damping_is_that_of_wells(optical):
    """Setup: Henyey-Greenstein of g 0.998, whose forward part is th0 / (2 pi (th0^2 + th^2)^1.5), transform
    e^(-th0 omega), mean over the path (1 - e^-x) / x, x = th0 omega. Expected: where Wells's modulation of the
    scattered part falls to 1/e. Tolerance: 4 % (light beyond 30 degrees cut). Negative control: all
    scattering at one end of the path, e^-x for its mean."""
    theta = (1 - 0.998) / np.sqrt(0.998)

    def width(mean):
        return theta / optimize.brentq(
            lambda x: np.expm1(optical * mean(x)) / np.expm1(optical) - np.exp(-1), 1e-3, 20
        )  # fmt: skip

    water = grey(absorption_per_m=0.0, g=0.998)
    found = small_angle.damping_rad_per_m(np.array([optical]), water=water, weights=ONES)[0] * optical
    assert found == pytest.approx(width(lambda x: -np.expm1(-x) / x), rel=0.04)
    assert found != pytest.approx(width(lambda x: np.exp(-x)), rel=0.2)


def test_damping_without_scattering_and_between_ranges():
    ranges = np.array([[0.3, 1.0], [2.0, np.inf]])
    assert not small_angle.damping_rad_per_m(ranges, water=grey(scattering_per_m=0.0), weights=ONES).any()
    water = named_water("tank_low")
    found = small_angle.damping_rad_per_m(ranges, water=water, weights=ONES)
    alone = [small_angle.damping_rad_per_m(np.array([r]), water=water, weights=ONES)[0] for r in (0.3, 1.0, 2.0, 1.0)]
    np.testing.assert_allclose(found.ravel(), alone, rtol=5e-3)


def test_widened_beam_on_the_sphere():
    """Setup: a beam shaped like Henyey-Greenstein's g 0.8, on the axis and tilted by 40 degrees. Expected: one of
    g 0.8 e^(-width), so that flux stays. Tolerance: 1e-3 of the peak (azimuths). Negative control: twice the width."""
    cosine, weights = widened.nodes()
    azimuth = 2 * np.pi * np.arange(16) / 16
    polar = np.linspace(0, np.pi, 361)
    for tilt, g in ((0.0, 0.8), (np.radians(40), 0.5)):

        def beam(cosine, g, tilt=tilt):
            sine = np.sqrt(1 - cosine**2)[:, None]
            along = cosine[:, None] * np.cos(tilt) + sine * np.sin(tilt) * np.cos(azimuth)
            return henyey_greenstein(along, g=g)

        found = widened.widen(beam(cosine, g), width_rad=0.2)
        expected = beam(np.cos(polar), g * np.exp(-0.2))
        np.testing.assert_allclose(found, expected, atol=1e-3 * expected.max())
        assert not np.allclose(found, beam(np.cos(polar), g * np.exp(-0.4)), atol=1e-3 * expected.max())
        flux = 2 * np.pi * np.trapezoid(found.mean(axis=1) * np.sin(polar), polar)
        assert flux == pytest.approx(2 * np.pi * np.sum(weights * beam(cosine, g).mean(axis=1)), rel=1e-4)


def test_lens_factor():
    """Expected: pi cos^4 / (4 N^2) and the bracket of the focus. Negative control: the printed one of a particle near
    the lens, which diverges."""
    assert lens_factor(1.0, f_number=2.0) == pytest.approx(np.pi / 16)
    assert lens_factor(0.5, f_number=2.0) == pytest.approx(np.pi / 16 / 16)
    focused = lens_factor(1.0, f_number=2.0, focal_length_m=0.02, focus_distance_m=1.0)
    assert focused == pytest.approx(np.pi / 16 * 0.98**2)
    assert ((0.001 - 0.02) / 0.001) ** 2 > 100 * 0.98**2
    with pytest.raises(ValueError, match="focal length"):
        lens_factor(1.0, f_number=2.0, focal_length_m=0.02, focus_distance_m=0.01)
