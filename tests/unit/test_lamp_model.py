"""The lamp-aware method on pictures made by the model that it uses, and what it believes of noise."""

import numpy as np
import pytest

from uwsim.camera.lens import Lens, pixel_centres
from uwsim.images import srgb_encode
from uwsim.restoration import noise_aware
from uwsim.restoration.algorithms import lamp_model
from uwsim.restoration.lamp_view import backscatter, excess, lamp_light, white_view

WIDTH_PX, HEIGHT_PX = 64, 48


def rig(absorption_per_m=0.3, scattering_per_m=0.5, electrons=1e12, radiance=20.0, offset_m=0.2):
    return {
        "lens": Lens(K=np.array([[60.0, 0, 32], [0, 60, 24], [0, 0, 1]])), "width_px": WIDTH_PX,
        "height_px": HEIGHT_PX, "response": "Nikon 5100 (NPL)", "linear_per_radiance": np.full(3, radiance),
        "lamps": [
            {
                "name": "lamp", "position_m": np.array([offset_m, 0, 0]), "direction": np.array([0, 0, 1.0]),
                "radiant_intensity_w_per_sr": 2.0, "relative_spectrum_per_nm": np.full(61, 1 / 61),
                "half_angle_deg": 50.0,
            }
        ],
        "water": {
            "name": "grey", "wavelengths_nm": np.arange(400.0, 701, 5),
            "absorption_per_m": np.full(61, absorption_per_m), "scattering_per_m": np.full(61, scattering_per_m),
            "phase_function": {"type": "hg_mixture", "g": [0.9], "weights": np.ones((1, 61))},
        },
        "noise": {"electrons": np.full(3, electrons), "dark_variance_e2": 16.0},
    }  # fmt: skip


@pytest.fixture(scope="module")
def scene():
    """Return (reflectance, range, light, backscatter, picture) of coarse squares on a slanted wall."""
    squares = np.random.default_rng(0).uniform(0.1, 0.9, (6, 8, 3)).repeat(8, axis=0).repeat(8, axis=1)
    range_m = np.broadcast_to(np.linspace(0.8, 1.4, WIDTH_PX, dtype=np.float32), (HEIGHT_PX, WIDTH_PX)).copy()
    range_m[:4] = np.inf
    squares[:4] = 0
    view = white_view(range_m, rig())
    light, back = lamp_light(view, rig()), backscatter(view, rig())
    picture = back + squares * light.direct + light.spread.blur(squares * light.scattered)
    return squares, range_m, light, back, picture.astype(np.float32)


# the squares stand still in `_SMOOTH` and are far brighter than usual: what the model may err by is left out
CERTAIN = {"_BACKSCATTER_ERROR": 0.0, "_ILLUMINATION_ERROR": 0.0, "_LEAST_STRAIGHT": 1e-3}


@pytest.fixture
def certain(monkeypatch):
    for name, value in CERTAIN.items():
        monkeypatch.setattr(lamp_model, name, value)
    # the edges of so small a picture are taken for noise
    monkeypatch.setattr(lamp_model, "measured_variance", lamp_model.noise_variance)


def by_model_alone(picture, *, range_m, rig):
    return lamp_model.restore(
        picture, range_m=range_m, rig=rig, corrections=20, shaped=False, usual_contrast=False
    )  # fmt: skip


def test_turns_its_own_model_around(scene, certain):
    """With enough corrections and no noise the reflectance comes back."""
    squares, range_m, light, _, picture = scene
    restored = by_model_alone(picture, range_m=range_m, rig=rig())
    expected = np.clip(squares * light.water_free, 0, 1)
    assert np.abs(restored - expected).max() < 0.04 * expected.max()
    assert np.all(restored[:4] == 0)


def test_each_correction_gives_detail_back(scene, certain):
    squares, _, light, back, picture = scene
    errors = [np.abs(lamp_model.reflected(picture - back, light, count) - squares)[4:].mean() for count in (0, 1, 3)]
    assert errors[0] > 1.5 * errors[1] > 1.5 * errors[2] > 0


@pytest.mark.parametrize("wrong", ["absorption_per_m", "scattering_per_m", "offset_m"])
def test_control_another_rig_is_seen(scene, wrong, certain):
    squares, range_m, light, _, picture = scene
    changed = {"absorption_per_m": 0.5, "scattering_per_m": 0.8, "offset_m": 0.05}[wrong]
    restored = by_model_alone(picture, range_m=range_m, rig=rig(**{wrong: changed}))
    expected = np.clip(squares * light.water_free, 0, 1)
    assert np.abs(restored - expected).max() > 0.1 * expected.max()


def test_clear_water_is_nothing_to_take_out():
    nothing = rig(absorption_per_m=0.0, scattering_per_m=0.0)
    view = white_view(np.full((HEIGHT_PX, WIDTH_PX), 1.0, np.float32), nothing)
    light = lamp_light(view, nothing)
    assert np.all(backscatter(view, nothing) == 0)
    assert np.all(light.scattered == 0)
    np.testing.assert_allclose(light.direct, light.water_free, rtol=1e-4)
    np.testing.assert_allclose(light.unscattered, light.white, rtol=1e-4)


def test_light_falls_with_water_and_distance():
    near, far = (
        lamp_light(white_view(np.full((HEIGHT_PX, WIDTH_PX), d, np.float32), rig(offset_m=1e-3)), rig(offset_m=1e-3))
        for d in (1.0, 2.0)
    )
    ratio = far.water_free[24, 32] / near.water_free[24, 32]
    np.testing.assert_allclose(ratio, 0.25, rtol=0.01)
    np.testing.assert_allclose(far.unscattered[24, 32] / near.unscattered[24, 32] / ratio, np.exp(-2 * 0.8), rtol=0.01)
    # unscattered on the way back, and what was scattered on its way there (less than c, more than a)
    lost = -np.log(far.direct[24, 32] / near.direct[24, 32] / ratio)
    assert np.all((lost > 2 * 0.3) & (lost < 2 * 0.8))


def test_excess_of_multiple_scattering_in_closed_form():
    """0.141 b d^(3/4) R^(1/4): b 0.5 per metre, lamp at 0.16 m, wall at 0.81 m."""
    here = rig(offset_m=0.16)
    view = white_view(np.full((HEIGHT_PX, WIDTH_PX), 0.81, np.float32), here)
    np.testing.assert_allclose(excess(view, here), 0.141 * 0.5 * 0.16**0.75 * 0.81**0.25, rtol=1e-6)
    nobody = white_view(np.full((HEIGHT_PX, WIDTH_PX), np.inf, np.float32), here)
    assert np.all(excess(nobody, here) == 0)


class TestShaped:
    """A sheet 4 cm before a wall, lit from the left: its shadow falls to the right of it."""

    def lights(self):
        here = rig(absorption_per_m=0.05, scattering_per_m=0.05, offset_m=-0.4)
        directions = here["lens"].rays(pixel_centres(width_px=WIDTH_PX, height_px=HEIGHT_PX))[1]
        range_m = (1.0 / directions[..., 2]).astype(np.float32)
        range_m[16:32, 24:32] = (0.96 / directions[16:32, 24:32, 2]).astype(np.float32)
        view = white_view(range_m, here)
        return lamp_light(view, here), lamp_light(view, here, shaped=True)

    def test_shadow_beside_a_body_and_none_elsewhere(self):
        plain, shaped = self.lights()
        share = (shaped.unscattered / plain.unscattered)[..., 1]
        # 0.4 m / 0.96 m x 4 cm = 1.7 cm of shadow on the wall, one pixel wide at 60 pixels of focal length
        assert np.all(share[18:30, 32] < 0.5)
        assert np.all(share[2:14, :] > 0.6)
        assert np.all(share[18:30, 40:62] > 0.6)
        # control: the side that faces the lamp is lit
        assert np.all(share[18:30, 22] > 0.6)

    def test_a_wall_square_to_the_camera_receives_by_the_cosine(self):
        plain, shaped = self.lights()
        rays = rig()["lens"].rays(pixel_centres(width_px=WIDTH_PX, height_px=HEIGHT_PX))[1]
        row = rays[8, 40:60]
        points = row / row[:, 2:]
        to_lamp = np.array([-0.4, 0, 0]) - points
        to_lamp /= np.linalg.norm(to_lamp, axis=-1, keepdims=True)
        expected = -to_lamp[:, 2] / np.sum(-row * to_lamp, axis=-1)
        found = (shaped.unscattered / plain.unscattered)[8, 40:60, 1]
        np.testing.assert_allclose(found, expected, rtol=2e-3)
        assert np.abs(found - 1).max() > 0.02

    def test_bodies_lend_each_other_light_where_the_lamp_does_not_shine(self):
        plain, shaped = self.lights()
        dark = shaped.water_free[18:30, 32, 1]
        assert np.all(dark > 0.02 * plain.water_free[..., 1].mean())
        widened, of_plain = (one.direct - one.unscattered for one in (shaped, plain))
        assert np.all(widened[18:30, 32] > 0.29 * of_plain[18:30, 32])


class TestUsualContrast:
    """A chequerboard a metre away of which the water left a tenth of its contrast, whatever the model says."""

    def spread_of_detail(self, scattering_per_m: float, usual_contrast: bool) -> float:
        range_m = np.ones((HEIGHT_PX, WIDTH_PX), np.float32)
        water = {"absorption_per_m": 0.05, "scattering_per_m": scattering_per_m, "electrons": 1e6}
        white = lamp_light(white_view(range_m, rig(**water)), rig(**water)).white
        # so that white is seen as 0.8
        here = rig(**water, radiance=20.0 * 0.8 / white.max())
        view = white_view(range_m, here)
        rows, columns = np.mgrid[:HEIGHT_PX, :WIDTH_PX]
        board = np.where((rows // 4 + columns // 4) % 2, 1.0, -1.0)[..., None]
        picture = backscatter(view, here) + (0.3 + 0.03 * board) * lamp_light(view, here).white
        found = lamp_model.restore(
            picture.astype(np.float32), range_m=range_m, rig=here, usual_contrast=usual_contrast
        )  # fmt: skip
        return float(np.diff(srgb_encode(found[12:36, 16:48, 1]), axis=1).std())

    def test_shown_where_little_comes_straight(self):
        assert self.spread_of_detail(6.0, True) > 0.1 > 2 * self.spread_of_detail(6.0, False)

    def test_left_alone_in_clear_water(self):
        assert self.spread_of_detail(0.05, True) == pytest.approx(self.spread_of_detail(0.05, False), rel=0.05)


@pytest.mark.parametrize("fault", ["size", "zero", "lamp", "corrections"])
def test_refuses_what_does_not_fit(fault, scene):
    _, range_m, _, _, picture = scene
    given = {"range_m": range_m, "rig": rig()}
    if fault == "size":
        given["range_m"] = range_m[1:]
    elif fault == "zero":
        given["range_m"] = np.zeros_like(range_m)
    elif fault == "lamp":
        given["rig"]["lamps"] = []
    else:
        given["corrections"] = -1
    with pytest.raises(ValueError, match="allowed"):
        lamp_model.restore(picture, **given)


class TestNoise:
    def squares(self):
        return np.random.default_rng(1).uniform(0.2, 0.8, (6, 8)).repeat(20, axis=0).repeat(20, axis=1)

    def test_without_noise_values_come_back(self):
        values = self.squares()
        np.testing.assert_allclose(noise_aware.believed(values, np.full(values.shape, 1e-14)), values, atol=1e-5)

    def test_noise_alone_is_averaged_out(self):
        values = 0.5 + 0.1 * np.random.default_rng(2).standard_normal((120, 160))
        found = noise_aware.believed(values, np.full(values.shape, 0.01))
        assert np.abs(found - 0.5).mean() < 0.01
        # control: called certain, it stays
        assert np.abs(noise_aware.believed(values, np.full(values.shape, 1e-8)) - 0.5).mean() > 0.07

    def test_what_is_there_is_kept_of_a_noisy_picture(self):
        truth = self.squares()
        values = truth + 0.1 * np.random.default_rng(3).standard_normal(truth.shape)
        found = noise_aware.believed(values, np.full(truth.shape, 0.01))
        assert np.square(found - truth).mean() < 0.3 * np.square(values - truth).mean()

    def test_pixels_that_say_nothing_do_not_count(self):
        values, variance = np.full((40, 50), 0.5), np.full((40, 50), 1e-6)
        values[10:20], variance[10:20] = 9.0, np.inf
        np.testing.assert_allclose(noise_aware.believed(values, variance), 0.5, atol=1e-5)

    def test_of_colours_the_noise_of_their_difference_goes_first(self):
        grey = np.random.default_rng(5).uniform(0.2, 0.8, (12, 16)).repeat(10, axis=0).repeat(10, axis=1)
        truth = grey[..., None] + np.array([0.1, 0.0, -0.1])
        values = truth + 0.1 * np.random.default_rng(6).standard_normal(truth.shape)
        variance = np.full(truth.shape, 0.01)
        found = noise_aware.believed_colour(values, variance)
        apart = np.dstack([noise_aware.believed(values[..., k], variance[..., k]) for k in range(3)])
        assert np.square(found - truth).mean() < 0.6 * np.square(apart - truth).mean()
        # without noise the values come back; what one channel does not know is not known
        np.testing.assert_allclose(noise_aware.believed_colour(truth, np.full(truth.shape, 1e-14)), truth, atol=1e-5)
        values[20:40], variance[20:40, :, 1] = 9.0, np.inf
        assert np.abs(noise_aware.believed_colour(values, variance)[20:40] - truth[20:40]).max() < 0.7

    def test_excess_of_white_noise_beside_edges(self):
        noise = 0.03 * np.random.default_rng(4).standard_normal((120, 160))
        found = noise_aware.noise_excess(self.squares() + noise, np.full(noise.shape, 1e-4))
        # Monte Carlo: tiles of about 2000 pixels
        np.testing.assert_allclose(found, 3.0, rtol=0.15)

    def test_shot_noise_in_closed_form(self):
        """Linear 0.25: 250 electrons and 16 of dark noise in 1000, and a rounding of 1/255 on the sRGB curve there."""
        found = lamp_model.noise_variance(
            np.full((2, 2, 3), 0.25), {"electrons": np.full(3, 1e3), "dark_variance_e2": 16.0}
        )
        from uwsim.images import srgb_encode

        slope = 2e-4 / (srgb_encode(np.array(0.2501)) - srgb_encode(np.array(0.2499)))
        assert found[0, 0, 0] == pytest.approx(266 / 1e6 + (slope / 255) ** 2 / 12, rel=1e-4)

    @pytest.mark.parametrize("times", [1, 3])
    def test_noise_of_a_picture_is_found_although_it_depends_on_the_picture(self, times):
        """Shot noise of 1000 electrons at full scale, or thrice as much; its model alone: the control at 3."""
        noise = {"electrons": np.full(3, 1e3), "dark_variance_e2": 16.0}
        level = np.repeat(np.linspace(0.2, 0.6, 160)[None, :, None], 120, axis=0).repeat(3, axis=2)
        variance = lamp_model.noise_variance(level, noise)
        image = level + times * np.sqrt(variance) * np.random.default_rng(7).standard_normal(level.shape)
        found = lamp_model.measured_variance(np.maximum(image, 0), noise)
        # Monte Carlo: tiles of about 2000 pixels, and means of 25
        assert np.median(found / variance) == pytest.approx(times**2, rel=0.12)
        # of the pixels themselves: half of the noise is lost
        own = lamp_model.noise_variance(np.maximum(image, 0), noise)
        assert noise_aware.noise_excess(image[..., 0], own[..., 0]).mean() < 0.8 * times

    def test_refuses_what_is_no_noise(self):
        with pytest.raises(ValueError, match="variance"):
            noise_aware.believed(np.zeros((4, 4)), np.zeros((4, 4)))
        with pytest.raises(ValueError, match="finite"):
            noise_aware.believed(np.full((4, 4), np.nan), np.ones((4, 4)))
