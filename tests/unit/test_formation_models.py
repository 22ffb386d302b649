"""Limits and symmetries of the closed-form models and the simplified model: no term has a scale of its own."""

import dataclasses

import numpy as np
import pytest

from tests.unit import formation_views as views
from uwsim.formation import airlight, as_printed, direct
from uwsim.formation.bands import band_values
from uwsim.formation.light import Daylight
from uwsim.formation.models import beer_lambert, revised, simplified
from uwsim.formation.veil import veiling_light
from uwsim.optics.water import named_water

MODELS = {
    "beer_lambert": (beer_lambert, {}),
    "revised": (revised, {}),
    "simplified": (simplified, {}),
    "simplified, forward scatter": (simplified, {"forward_scatter": True}),
    "simplified, as printed": (simplified, {"form": "as_printed", "forward_scatter": True}),
}
SUN = Daylight(towards_sun=np.array([0.6, 0, 0.8]), sun_irradiance=views.FLAT, sky_irradiance=0 * views.FLAT)


@pytest.fixture(params=MODELS)
def layers(request):
    model, options = MODELS[request.param]
    return lambda view, **more: model.layers(view, **options | more)


def test_layers_are_pictures_that_sum_to_the_radiance(layers):
    view = views.view()
    for spectral in (True, False):
        found = layers(view, spectral=spectral)
        assert {"direct", "backscatter", "radiance"} <= set(found) <= {
            "direct", "forward_scatter", "backscatter", "radiance"
        }  # fmt: skip
        for layer in found.values():
            assert (layer.shape, layer.dtype) == ((12, 16, 3), np.float32)
            assert np.all(np.isfinite(layer) & (layer >= 0))
        total = sum(layer for name, layer in found.items() if name != "radiance")
        np.testing.assert_allclose(found["radiance"], total, rtol=1e-6)


def test_water_that_does_nothing_scatters_nothing(layers):
    """Expected: for c -> 0 no scattered light. Negative control: water."""
    view = views.view(water=views.grey_water(absorption_per_m=1e-7, scattering_per_m=1e-7))
    found, free = layers(view), direct.water_free(view)
    for name in ("forward_scatter", "backscatter"):
        assert not np.any(found.get(name, 0) > 1e-5 * free.max())
    assert layers(views.view())["backscatter"].max() > 1e-3 * free.max()


@pytest.mark.parametrize("name", [name for name in MODELS if "printed" not in name])
def test_the_direct_light_of_clear_water_is_the_picture_without_water(name):
    """Expected: `water_free` and 0.5 / pi I cos(gamma) / r^2. Tolerance: 1e-5. Negative control: as printed, without
    the cosine."""
    model, options = MODELS[name]
    view = views.view(water=views.grey_water(absorption_per_m=0.0, scattering_per_m=0.0))
    found = model.layers(view, **options)["direct"]
    came = view.lamps[0].arriving(view.points_m)
    cosine = np.sum(view.normals * came.towards, axis=-1)
    expected = (0.5 / np.pi * came.irradiance_per_intensity * cosine)[..., None] * band_values(
        view, view.lamps[0].spectrum
    )
    np.testing.assert_allclose(found, expected, rtol=1e-5)
    printed = simplified.layers(view, form="as_printed")["direct"]
    assert np.abs(printed / expected - 1).max() > 0.1


def test_without_scattering_there_is_no_scattered_light(layers):
    found = layers(views.view(water=views.grey_water(absorption_per_m=0.5, scattering_per_m=0.0)))
    assert found["direct"].min() > 0
    for name in ("forward_scatter", "backscatter"):
        assert not np.any(found.get(name, 0) > 1e-7 * found["direct"].max())


def test_black_bodies_leave_the_backscatter(layers):
    grey, black = layers(views.view()), layers(views.view(albedo=0.0))
    assert not black["direct"].any()
    assert not np.any(black.get("forward_scatter", 0))
    np.testing.assert_array_equal(black["backscatter"], grey["backscatter"])
    assert black["backscatter"].min() > 0


def test_without_a_body_the_backscatter_saturates(layers):
    """Expected: no light of bodies at infinite range, backscatter as at 300 m. The printed form has no distance of the
    lamp there and gives none."""
    far = layers(views.view(wall_m=np.inf))
    assert not far["direct"].any()
    assert not np.any(far.get("forward_scatter", 0))
    assert np.all(np.isfinite(far["backscatter"]))
    if far["backscatter"].any():
        np.testing.assert_allclose(far["backscatter"], layers(views.view(wall_m=300.0))["backscatter"], rtol=2e-3)


def test_at_no_distance_there_is_no_veil(layers):
    """Expected: at range 0 no backscatter. Negative control: 10 cm."""
    view = views.view(lamps=(views.lamp(position_m=(0, -0.15, -0.1)),))
    near = layers(dataclasses.replace(view, range_m=np.zeros(view.shape, np.float32)))
    assert near["backscatter"].max() <= 1e-6 * near["direct"].max()
    a_little = layers(dataclasses.replace(view, range_m=np.full(view.shape, 0.1, np.float32)))
    assert a_little["backscatter"].max() > 1e-5 * a_little["direct"].max()


def test_light_adds_up_and_nothing_else_scales_it(layers):
    """Expected: two lamps are the sum of each alone, a lamp of twice the power gives twice every layer, and the factor
    of the port multiplies all alike. Tolerance: 1e-4 (float32); 2e-3 of the dark side for the mean light of veils.
    Negative control: the lamps taken twice."""
    a, b = views.lamp(), views.lamp(position_m=(0.3, 0.1, 0.0))
    both, first, second = (layers(views.view(lamps=lamps)) for lamps in ((a, b), (a,), (b,)))
    for name, layer in both.items():
        np.testing.assert_allclose(layer, first[name] + second[name], rtol=2e-3, atol=2e-3 * layer.max())
        assert np.abs(2 * first[name] / layer.clip(1e-30) - 1).max() > 0.02
    brighter = layers(views.view(lamps=(dataclasses.replace(a, spectrum=2 * a.spectrum),)))
    view = views.view(lamps=(a,))
    through = layers(dataclasses.replace(view, factor=np.full(view.shape, 0.5)))
    for name, layer in first.items():
        np.testing.assert_allclose(brighter[name], 2 * layer, rtol=1e-4)
        np.testing.assert_allclose(through[name], 0.5 * layer, rtol=1e-6)


def test_pixels_without_a_ray_are_black(layers):
    view = views.view()
    blind = view.directions.copy()
    blind[:, :4] = np.nan
    factor = view.factor.copy()
    factor[:, :4] = 0
    found = layers(dataclasses.replace(view, directions=blind, factor=factor))
    for layer in found.values():
        assert np.all(np.isfinite(layer))
        assert not layer[:, :4].any()
        assert layer[:, 4:].any()


def test_shadows_take_the_light_of_their_lamp():
    """Expected: nothing direct where no lamp is visible, half of it where half of the lamp is."""
    view = views.view()
    share = np.ones((*view.shape, 1))
    share[:, :5], share[:, 5:9] = 0, 0.5
    whole, shadowed = direct.direct(view), direct.direct(dataclasses.replace(view, visibility=share))
    assert not shadowed[:, :5].any()
    np.testing.assert_allclose(shadowed[:, 5:9], 0.5 * whole[:, 5:9], rtol=1e-6)
    np.testing.assert_allclose(shadowed[:, 9:], whole[:, 9:], rtol=1e-6)


def test_beer_lambert_is_its_formula():
    """Expected: J t + A (1 - t) by hand in grey water; without water's share of the way from the lamp. Parameters
    multiply c and A. Negative control: the way from the lamp counted too (the direct light of `simplified`)."""
    view = views.view()
    a, free = veiling_light(view), direct.water_free(view)
    for attenuation, veil in ((1.0, 1.0), (2.0, 0.5)):
        t = np.exp(-0.6 * attenuation * view.range_m)[..., None]
        found = beer_lambert.layers(view, attenuation_relative=attenuation, veil_relative=veil)
        np.testing.assert_allclose(found["direct"], free * t, rtol=1e-4)
        np.testing.assert_allclose(found["backscatter"], veil * a * (1 - t), rtol=1e-4)
    right = simplified.layers(view)["direct"]
    assert np.all(beer_lambert.layers(view)["direct"] > 1.5 * right)


def test_the_veiling_light_is_the_airlight_without_end():
    view = views.view(wall_m=np.inf)
    expected = airlight.single(view, view.lamps[0]).mean(axis=(0, 1))
    np.testing.assert_allclose(veiling_light(view), expected, rtol=0.02)  # a part of the rays
    assert not veiling_light(views.view(lamps=())).any()


def test_the_revised_model_has_its_own_coefficients():
    """Expected: both are c in grey water; in real water beta_D falls with the range, beta_B differs from it, and the
    direct light is right at the range at which they were taken. Tolerance: 1e-4. Negative control: the means of c."""
    np.testing.assert_allclose(revised.coefficients(views.view()), 0.6, rtol=1e-9)
    view = views.view(water=named_water("jerlov_IB"), wall_m=4.0, fov_deg=2.0)
    beta_d, beta_b = revised.coefficients(view)
    near_d, _ = revised.coefficients(views.view(water=named_water("jerlov_IB"), wall_m=0.5))
    assert np.all(beta_d < near_d)
    assert np.abs(beta_d - beta_b).max() > 0.002
    left = revised.layers(view)["direct"] / direct.water_free(view)
    expected = direct.reflected(view, direct.seen_range_m(view)) / direct.water_free(view)
    np.testing.assert_allclose(left, expected, rtol=1e-3)
    plain = revised.layers(view, spectral=False)["direct"] / direct.water_free(view)
    assert np.abs(plain / expected - 1).max() > 0.002
    more = revised.layers(view, direct_relative=2.0, backscatter_relative=0.0, veil_relative=3.0)
    np.testing.assert_allclose(more["direct"] / direct.water_free(view), left**2, rtol=1e-4)
    assert not more["backscatter"].any()


def test_fitted_numbers_have_bounds_that_are_used():
    """Expected: every parameter's bounds are taken, what lies below is refused."""
    view = views.view()
    for model, options in ((beer_lambert, {}), (revised, {}), (simplified, {"forward_scatter": True})):
        for name, ends in model.PARAMETERS.items():
            for value in ends:
                model.layers(view, **options, **{name: value})
            with pytest.raises(ValueError, match="allowed: "):
                model.layers(view, **options, **{name: -0.1})


def test_the_printed_backscatter():
    """Expected: E_a / c x integral of beta d(angle) over 90-180 degrees x (1 - e^(-c R)) by hand in grey water.
    Negative control: the true integral, several times more."""
    view = views.view()
    came = view.lamps[0].arriving(view.points_m)
    angle = np.linspace(np.pi / 2, np.pi, 20001)
    beta = 0.4 * np.trapezoid(view.water.phase.density_at(angle)[:, 0], angle)
    irradiance = came.irradiance_per_intensity * np.exp(-0.6 * came.path_m)
    expected = irradiance * beta / 0.6 * (1 - np.exp(-0.6 * view.range_m))
    found = as_printed.lamp_backscatter(view) / band_values(view, view.lamps[0].spectrum)
    np.testing.assert_allclose(found[..., 1], expected, rtol=1e-3)
    assert np.all(simplified.layers(view)["backscatter"] > 2 * as_printed.lamp_backscatter(view))


def test_what_a_model_does_not_know_is_refused(layers):
    view = views.view()
    sunny = dataclasses.replace(view, daylight=SUN)
    if layers.__closure__ is not None:
        with pytest.raises(ValueError, match="daylight.*, allowed: "):
            layers(dataclasses.replace(view, daylight=dataclasses.replace(SUN, sky_irradiance=views.FLAT)))
    with pytest.raises(ValueError, match="simplified: form is 'other', allowed: "):
        simplified.layers(view, form="other")
    with pytest.raises(ValueError, match="forward_share or damping_rad_per_m, allowed: with forward_scatter"):
        simplified.layers(view, forward_share=0.5)
    with pytest.raises(ValueError, match="daylight with forward_scatter = True, allowed: False"):
        simplified.layers(sunny, forward_scatter=True)
