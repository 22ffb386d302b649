"""Limits of the Jaffe-McGlamery and multistage models, their printed forms, tables of two paths."""

import dataclasses

import numpy as np
import pytest
from scipy import integrate

from tests.references import jaffe_mcglamery_literal
from tests.unit import formation_views as views
from uwsim.formation import airlight, daylight_field, small_angle
from uwsim.formation.bands import fine
from uwsim.formation.direct import direct, water_free
from uwsim.formation.light import Daylight
from uwsim.formation.models import jaffe_mcglamery, multistage
from uwsim.formation.slabs import Lattice, Slabs
from uwsim.formation.spread import spread
from uwsim.formation.two_paths import TwoPaths, medium
from uwsim.optics.phase import henyey_greenstein
from uwsim.optics.sources import illuminant
from uwsim.optics.water import named_water

MODELS = (jaffe_mcglamery, multistage)
BOTH = pytest.mark.parametrize("model", MODELS, ids=["jaffe_mcglamery", "multistage"])
NAMES = {"direct", "forward_scatter", "backscatter", "radiance"}


def colour(view_kind="tank_low", **changes):
    return views.view(water=named_water(view_kind), **changes)


def daylit(**changes):
    sun = np.array([0.3, 0.2, np.sqrt(1 - 0.13)])
    given = {
        "towards_sun": sun, "sun_irradiance": illuminant("D65"), "sky_irradiance": np.zeros(61)
    } | changes  # fmt: skip
    return Daylight(**given)


@BOTH
def test_layers_are_finite_float32_and_sum_to_radiance(model):
    found = model.layers(colour())
    assert set(found) == NAMES
    assert all(image.shape == (12, 16, 3) and image.dtype == np.float32 for image in found.values())
    assert all(np.all(np.isfinite(image)) and image.min() >= 0 for image in found.values())
    np.testing.assert_array_equal(
        found["direct"] + found["forward_scatter"] + found["backscatter"], found["radiance"]
    )  # fmt: skip


@BOTH
def test_without_scattering_only_direct_light_is_left(model):
    """b -> 0: no scattered layer, direct light dimmed by absorption. Negative control: with scattering there is."""
    view = views.view(water=views.grey_water(absorption_per_m=0.4, scattering_per_m=0.0))
    found = model.layers(view)
    assert not found["backscatter"].any()
    assert found["forward_scatter"].max() < 1e-6 * found["direct"].max()
    np.testing.assert_allclose(found["direct"], direct(view), rtol=1e-3)
    assert model.layers(views.view())["forward_scatter"].max() > 0.1 * model.layers(views.view())["direct"].max()


@BOTH
def test_clear_water_is_no_water(model):
    """c -> 0: the picture without water."""
    view = views.view(water=views.grey_water(absorption_per_m=0.0, scattering_per_m=0.0))
    np.testing.assert_allclose(model.layers(view)["radiance"], water_free(view), rtol=1e-3)
    nearly = views.view(water=views.grey_water(absorption_per_m=1e-6, scattering_per_m=1e-6))
    np.testing.assert_allclose(model.layers(nearly)["radiance"], water_free(view), rtol=1e-3)


@BOTH
def test_black_body_leaves_backscatter(model):
    """Albedo 0: nothing but backscatter, that of any other body."""
    black = model.layers(colour(albedo=0.0))
    assert not black["direct"].any()
    assert not black["forward_scatter"].any()
    np.testing.assert_array_equal(black["backscatter"], model.layers(colour())["backscatter"])


@BOTH
def test_near_wall_scatters_nothing(model):
    """R -> 0: forward scatter in proportion to R b; backscatter goes too. Lamp behind the camera, as it must."""
    lamps = (views.lamp(position_m=(0, 0, -0.3)),)
    far, near = (model.layers(views.view(wall_m=metres, lamps=lamps)) for metres in (1.0, 1e-4))
    assert near["forward_scatter"].max() < 2e-4 * near["direct"].max()
    assert near["backscatter"].max() < 1e-2 * far["backscatter"].max()
    assert far["forward_scatter"].max() > 0.1 * far["direct"].max()


@BOTH
@pytest.mark.parametrize("form", ["corrected", "as_printed"])
def test_infinite_range(model, form):
    """R -> infinity: no light of bodies, backscatter that no farther wall would change."""
    empty = model.layers(colour(wall_m=np.inf), form=form)
    assert not empty["direct"].any()
    assert not empty["forward_scatter"].any()
    assert np.all(np.isfinite(empty["backscatter"]))
    assert empty["backscatter"].min() > 0
    if form == "corrected":
        wall = model.layers(colour(wall_m=12.0), form=form)
        np.testing.assert_allclose(wall["backscatter"], empty["backscatter"], rtol=0.01)


@BOTH
@pytest.mark.parametrize("form", ["corrected", "as_printed"])
def test_pixels_without_a_ray_stay_dark(model, form):
    """Setup: a corner of the picture that no ray reaches (NaN), as behind a wide lens. Expected: 0 there, all finite,
    and the pixels far from it as before (5 %: less light is spread)."""
    view = colour(daylight=daylit() if model is multistage else None)
    directions, factor = view.directions.copy(), view.factor.copy()
    directions[:3, :4], factor[:3, :4] = np.nan, 0.0
    found = model.layers(dataclasses.replace(view, directions=directions, factor=factor), form=form)
    whole = model.layers(view, form=form)
    for name in NAMES:
        assert np.all(np.isfinite(found[name]))
        assert not found[name][:3, :4].any()
    np.testing.assert_allclose(found["backscatter"][6:, 8:], whole["backscatter"][6:, 8:], rtol=0.05)


@BOTH
def test_without_forward_scatter_models_are_single_scattering(model):
    """Expected: unscattered direct light (`formation.direct`) and `airlight.single`. Tolerance: tables, 1e-3. Negative
    control: with forward scattering."""
    view = colour()
    found = model.layers(view, forward_scatter=False)
    single = sum(airlight.single(view, lamp) for lamp in view.lamps)
    np.testing.assert_allclose(found["direct"], direct(view), rtol=1e-3)
    np.testing.assert_allclose(found["backscatter"], single, rtol=1e-3)
    assert not found["forward_scatter"].any()
    assert not np.allclose(model.layers(view)["direct"], direct(view), rtol=0.1)


@BOTH
def test_no_forward_share_is_no_forward_scatter(model):
    """G = c: the point-spread function has no light, so that B does not matter."""
    view = colour()
    none = model.layers(view, forward_share=0.0, damping_rad_per_m=0.3)
    without = model.layers(view, forward_scatter=False)
    for name in NAMES:
        np.testing.assert_allclose(none[name], without[name], rtol=1e-3, atol=1e-7 * without["radiance"].max())


@BOTH
def test_energy_of_forward_scatter(model):
    """Setup: G = a (`forward_share` 1), a lamp far away, so that the wall's light is nearly even. Expected: direct and
    forward scatter together are the wall's light dimmed by absorption only, on average. Tolerance: 1 % (beam's edge).
    Negative control: the printed form."""
    lamps = (views.lamp(position_m=(0, 0, -8.0), profile=views.isotropic),)
    view = views.view(lamps=lamps, water=views.grey_water(absorption_per_m=0.05, scattering_per_m=0.15))
    only_absorbing = views.view(lamps=lamps, water=views.grey_water(absorption_per_m=0.05, scattering_per_m=0.0))
    expected = direct(only_absorbing).mean(axis=(0, 1))

    def kept(**settings):
        found = model.layers(view, forward_share=1.0, **settings)
        return (found["direct"] + found["forward_scatter"]).mean(axis=(0, 1)) / expected

    np.testing.assert_allclose(kept(), 1.0, rtol=0.01)
    assert np.all(np.abs(kept(form="as_printed") - 1) > 0.1)


def literal(view, *, slabs=60, **losses):
    """Return the layers of the literal transcription with the model's physical G and B."""
    angles = {"source": small_angle.HEMISPHERE_RAD, "camera": small_angle.VIEW_ANGLE_RAD}
    weights = view.band_light.mean(axis=1)[::2]

    def width_of(angle):
        def width(path_m):
            damping = small_angle.damping_rad_per_m(path_m, water=view.water, weights=weights, forward_angle_rad=angle)
            return np.asarray(path_m) * damping

        return width

    given = {f"{side}_loss": small_angle.loss_per_m(view.water, forward_angle_rad=angles[side]) for side in angles}
    widths = {f"{side}_width": width_of(angles[side]) for side in angles}
    return jaffe_mcglamery_literal.layers(view, slabs=slabs, **given | losses, **widths)


def test_literal_transcription_agrees():
    """Setup: tank_low, the same formulas written out by wavelengths and slabs. Expected: the same layers. Tolerance:
    direct 1e-3, backscatter 2e-3, forward scatter 1.5 % (10 % thick slabs in the transcription). Negative control: G of
    the lamps' side that of the camera's."""
    view = colour()
    found, expected = jaffe_mcglamery.layers(view), literal(view)
    for name, tolerance in (("direct", 1e-3), ("forward_scatter", 0.015), ("backscatter", 2e-3)):
        np.testing.assert_allclose(found[name], expected[name], rtol=tolerance)
    wrong = literal(view, slabs=10, source_loss=small_angle.loss_per_m(view.water))
    assert not np.allclose(found["direct"], wrong["direct"], rtol=0.015)


def test_models_differ_in_backscatter_only():
    """Both have the same light of bodies; Jaffe-McGlamery's backscatter is that of multistage and more."""
    jaffe, stages = (model.layers(colour("tank_medium")) for model in MODELS)
    np.testing.assert_allclose(jaffe["direct"], stages["direct"], rtol=1e-6)
    np.testing.assert_allclose(jaffe["forward_scatter"], stages["forward_scatter"], rtol=1e-6)
    assert np.all(jaffe["backscatter"] > 1.5 * stages["backscatter"])


def test_slabs_are_the_airlight_integral():
    """Expected: the slabs' unscattered light is `airlight.single`. Tolerance: 2 % (lattice, panels). Negative control:
    1/z for 1/z^2, as printed."""
    view = colour(width_px=40, height_px=30)
    rule, lattice = spread(view, spectral=True), Lattice(view)
    single = airlight.single(view, view.lamps[0])

    def light(**settings):
        slabs = Slabs(lattice, rule, 0, wide=False, **settings)
        return lattice.to(lattice.cumulative(slabs.per_length("unscattered", "unscattered")), view.range_m)

    np.testing.assert_allclose(light(), single, rtol=0.02)
    assert not np.allclose(light(one_over_distance=True), single, rtol=0.2)


@pytest.mark.parametrize("laws", [("unscattered", "scattered"), ("both", "saturation"), ("scattered", "both")])
def test_tables_of_two_paths(laws):
    """Expected: the sum over wavelengths. Tolerance: 1e-4. Negative control: the three-band form."""
    view = colour("tank_medium")
    water = medium(view, small_angle.loss_per_m(view.water), spectral=True)
    weighted = fine(view.lamps[0].spectrum)[:, None] * view.weights
    first, second = np.random.default_rng(1).uniform(0, 3, (2, 500))
    exact = np.ones((500, 121))
    for law, path in zip(laws, (first, second), strict=True):
        scale = path[:, None] if law in ("scattered", "saturation") else 1.0
        exact = exact * water.left(law, path) * scale
    exact = exact @ weighted
    found = TwoPaths((water, water), weighted, laws, (3, 3))(first, second)
    np.testing.assert_allclose(found, exact, rtol=1e-4)
    bands = medium(view, small_angle.loss_per_m(view.water), spectral=False)
    assert not np.allclose(TwoPaths((bands, bands), weighted, laws, (3, 3))(first, second), exact, rtol=1e-3)
    with pytest.raises(ValueError, match="two paths"):
        TwoPaths((water, water), weighted, laws, (3, 3))(first + 2, second)


def test_grey_water_is_the_same_by_wavelengths_and_by_bands():
    view = views.view()
    for model in MODELS:
        spectral, bands = (model.layers(view, spectral=choice) for choice in (True, False))
        np.testing.assert_allclose(spectral["radiance"], bands["radiance"], rtol=2e-3)


@BOTH
def test_printed_forms_differ(model):
    """The printed forms count e^(-c R) twice: too little forward scatter, of the wrong sign in the multistage model."""
    view = colour()
    right, printed = model.layers(view), model.layers(view, form="as_printed")
    if model is multistage:
        assert np.all(printed["forward_scatter"] < 0)
    else:
        assert np.all(printed["forward_scatter"] < 0.5 * right["forward_scatter"])


def test_closed_form_lacks_the_light_near_the_lamp():
    """2.64-2.65: less than a third of the true integral at 1 m, c = 1 /m, lamp at 0.15 m."""
    closed = multistage.layers(colour(), lamp_backscatter="closed_form_2_64")["backscatter"]
    assert np.all(closed < 0.33 * multistage.layers(colour())["backscatter"])


def sun_truth(view, row, column, sun, *, rate):
    """Return the integral over a ray of beta E e^(-c s) e^(-rate d(s)), grey water and spectrum 1/300 nm."""
    water, direction, origin = view.water, view.directions[row, column], view.origins_m[row, column]
    c, b = float(water.attenuation[0]), float(water.scattering[0])

    def along(s):
        depth = -(origin + s * direction)[2]
        return np.exp(-c * s - rate * depth / sun[2])

    found = integrate.quad(along, 0, float(view.range_m[row, column]), epsrel=1e-10)[0]
    return b * henyey_greenstein(sun @ direction, g=0.9) * found / 300.0


@pytest.mark.parametrize("share", [0.0, 0.6])
def test_backscatter_of_the_sun(share):
    """Expected: the integral over the ray by quadrature, with G on the sun's way. Tolerance: 2e-3 (table). Negative
    control: the closed form 2.60, which is right for horizontal rays only."""
    sun = daylit().towards_sun
    view = views.view(lamps=(), wall_m=3.0, daylight=daylit(sun_irradiance=np.full(61, 1 / 300.0)))
    found = multistage.layers(view, forward_share=share)["backscatter"]
    rate = 0.6 - share * 0.4
    truth = np.array([[sun_truth(view, i, j, sun, rate=rate) for j in (0, 9)] for i in (0, 6, 11)])
    np.testing.assert_allclose(found[[0, 6, 11]][:, [0, 9]], np.broadcast_to(truth[..., None], (3, 2, 3)), rtol=2e-3)
    horizontal = np.array([
        [0.4 * henyey_greenstein(sun @ view.directions[i, j], g=0.9) * np.exp(-rate * 2 / sun[2]) / 300.0
         * (1 - np.exp(-0.6 * view.range_m[i, j])) / 0.6 for j in (0, 9)] for i in (0, 11)
    ])  # fmt: skip
    assert not np.allclose(horizontal, truth[[0, 2]], rtol=0.05)


def test_sun_and_sky_on_a_wall():
    """Expected: albedo / pi E cos e^(-c (d + R)) of the sun; of a uniform sky a tenth to a half on a vertical wall
    of what a plane that looks up receives. Negative control: without cosine."""
    view = views.view(lamps=(), daylight=daylit(sun_irradiance=np.full(61, 1.0)))
    sun = view.daylight.towards_sun
    found = multistage.layers(view, forward_scatter=False)["direct"][..., 0]
    depth = -view.points_m[..., 2]
    # the wall looks along -x, away from this sun
    assert not found.any()
    turned = dataclasses.replace(view, normals=-view.normals)
    found = multistage.layers(turned, forward_scatter=False)["direct"][..., 0]
    expected = 0.5 / np.pi * sun[0] * np.exp(-0.6 * (depth / sun[2] + view.range_m))
    np.testing.assert_allclose(found, expected, rtol=1e-3)
    assert not np.allclose(found, expected / sun[0], rtol=0.1)
    sky = daylit(sun_irradiance=np.zeros(61), sky_irradiance=np.ones(61))
    up = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    parts = [ring.irradiance[0] * daylight_field.received(ring, up) for ring in daylight_field.rings(sky)]
    plane, vertical, below = np.sum(parts, axis=0)
    assert plane == pytest.approx(1.0)
    assert 0.1 < vertical < 0.5
    assert below == pytest.approx(0.0, abs=1e-12)


def test_refusals():
    view = views.view()
    with pytest.raises(ValueError, match="daylight"):
        jaffe_mcglamery.layers(views.view(daylight=daylit()))
    with pytest.raises(ValueError, match="no lamp"):
        jaffe_mcglamery.layers(views.view(lamps=()))
    with pytest.raises(ValueError, match="neither lamps nor daylight"):
        multistage.layers(views.view(lamps=()))
    for model in MODELS:
        with pytest.raises(ValueError, match="form is"):
            model.layers(view, form="printed")
        with pytest.raises(ValueError, match="one of them"):
            model.layers(view, loss_per_m=0.1, forward_share=0.5)
        with pytest.raises(ValueError, match=r"loss_per_m \(G\)"):
            model.layers(view, loss_per_m=0.7)
        with pytest.raises(ValueError, match="damping_rad_per_m"):
            model.layers(view, damping_rad_per_m=-0.1)
    with pytest.raises(ValueError, match="lamp_backscatter"):
        multistage.layers(view, lamp_backscatter="closed")
