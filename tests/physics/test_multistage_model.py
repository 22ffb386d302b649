"""The multistage model against light transport: daylight and lamps, unscattered and scattered once."""

import dataclasses

import numpy as np
import pytest

from tests.physics import formation_scenes as scenes
from tests.physics import scenes as scenes_of_physics
from tests.references.monte_carlo import assert_mean_matches
from uwsim.formation.light import Daylight
from uwsim.formation.models import multistage
from uwsim.optics.fresnel import snell
from uwsim.optics.natural_light import below_surface
from uwsim.scene import daylight as scene_daylight

NAMES = ("direct_unscattered", "backscatter_single")
SUN = {"sun_irradiance_w_per_m2": 50.0, "sun_zenith_deg": 40.0, "sun_azimuth_deg": -60.0}
SKY = {"sky_irradiance_w_per_m2": 30.0}


def daylit(given: dict, *, lamps: bool, **changes):
    """Return a scene under sun or sky and its view, with or without the lamp."""
    scene = scenes.scene(lamps=[scenes.lamp()], **changes)
    view = scenes.view_of(scene)
    day = scene_daylight.Daylight(spectrum="D65", **given)
    rig = scene.rig if lamps else scene.rig.model_copy(update={"lamps": ()})
    scene = scene.model_copy(update={"daylight": day, "rig": rig})
    below = below_surface(
        direct_w_per_m2=day.sun_irradiance_w_per_m2, diffuse_w_per_m2=day.sky_irradiance_w_per_m2,
        sun_zenith_rad=np.radians(day.sun_zenith_deg), n_water=scene.water.refractive_index,
    )  # fmt: skip
    angle = float(snell(np.radians(day.sun_zenith_deg), n_from=1.0, n_to=scene.water.refractive_index))
    across = day.towards_sun_in_air[:2] / max(np.linalg.norm(day.towards_sun_in_air[:2]), 1e-12)
    light = Daylight(
        towards_sun=np.array([*(np.sin(angle) * across), np.cos(angle)]),
        sun_irradiance=float(below.direct_w_per_m2) / np.cos(angle) * day.relative_spectrum,
        sky_irradiance=float(below.diffuse_w_per_m2) * day.relative_spectrum,
    )
    return scene, dataclasses.replace(view, daylight=light, lamps=view.lamps if lamps else ())


@pytest.fixture(scope="module")
def sunny(llvm_spectral):
    scene, view = daylit(SUN, lamps=False)
    return view, scenes.rendered(scene, samples=2048, names=NAMES)


@pytest.mark.parametrize(("layer", "name"), [("direct", NAMES[0]), ("backscatter", NAMES[1])])
def test_sun_scattered_nowhere_and_once(sunny, layer, name):
    """Setup: sun on a wall at 1 m, 2 m deep in tank_low; the model without point-spread functions (G = c). Expected:
    the renderer's unscattered direct light and single backscatter. Tolerance: Monte Carlo (2 %), model 1 % (pixel
    centres). Negative control: c 5 % higher."""
    view, truth = sunny
    rule = {"max_relative_standard_error": 0.02, "model_tolerance": 0.01}

    def model(view):
        return scenes.region_means(multistage.layers(view, forward_scatter=False)[layer])

    assert_mean_matches(truth[name], model(view), **rule)
    with pytest.raises(AssertionError, match="biased"):
        assert_mean_matches(truth[name], model(dataclasses.replace(view, water=denser(view.water, 0.05))), **rule)


def denser(water, share):
    """Return water with more attenuation, all of it absorption."""
    return dataclasses.replace(water, absorption=water.absorption + share * water.attenuation)


FLOOR = scenes.wall(at_m=(0.0, 0.0, -2.5), towards_m=(0.0, 0.0, 0.0), size_m=200.0, name="floor")


@pytest.mark.parametrize(
    ("layer", "scattering_per_m", "bodies"), [("direct", 0.0, None), ("backscatter", 0.01, [FLOOR])]
)
def test_sky_scattered_nowhere_and_once(layer, scattering_per_m, bodies, llvm_spectral, monkeypatch):
    """Setup: uniform sky over water that absorbs 0.3 /m, 2 m deep: a wall without scattering; a floor that shades
    nothing, seen at 0 to 17 degrees below the horizon, with hardly any. Expected: the renderer's layers (lower
    regions). Tolerance: Monte Carlo (2 %), model 2 % (a second scattering). Negative control: c 20 % higher."""
    scene, view = daylit(SKY, lamps=False, bodies=bodies)
    water = scenes_of_physics.water(absorption_per_m=0.3, scattering_per_m=scattering_per_m, g=0.5)
    view = dataclasses.replace(view, water=water)
    monkeypatch.setattr(type(scene.water), "optical", lambda self: water)
    truth = scenes._rendered(scene, samples=2048, names=(layer,), count=8)[layer][:, 3:]

    def model(view):
        return scenes.region_means(multistage.layers(view, forward_scatter=False)[layer])[3:]

    rule = {"max_relative_standard_error": 0.02, "model_tolerance": 0.02}
    assert_mean_matches(truth, model(view), **rule)
    with pytest.raises(AssertionError, match="biased"):
        assert_mean_matches(truth, model(dataclasses.replace(view, water=denser(view.water, 0.2))), **rule)


def test_sources_add(llvm_spectral):
    """Setup: sun and lamp together. Expected: the layers of each alone, summed; the renderer's single backscatter and
    unscattered direct light. Tolerance: Monte Carlo (2 %), model 1 %. Negative control: the lamp's alone."""
    scene, view = daylit(SUN, lamps=True)
    parts = [dataclasses.replace(view, lamps=()), dataclasses.replace(view, daylight=None)]
    both = multistage.layers(view, forward_scatter=False)
    alone = [multistage.layers(part, forward_scatter=False) for part in parts]
    rule = {"max_relative_standard_error": 0.02, "model_tolerance": 0.01}
    truth = scenes.rendered(scene, samples=2048, names=NAMES)
    for layer, name in (("direct", NAMES[0]), ("backscatter", NAMES[1])):
        np.testing.assert_allclose(both[layer], alone[0][layer] + alone[1][layer], rtol=1e-3)
        assert_mean_matches(truth[name], scenes.region_means(both[layer]), **rule)
        with pytest.raises(AssertionError, match="biased"):
            assert_mean_matches(truth[name], scenes.region_means(alone[1][layer]), **rule)
