"""Light in absorbing water is dimmed by exp(-c r), also with the camera inside it."""

import dataclasses

import numpy as np
import pytest

from tests.physics import scenes
from tests.references.monte_carlo import assert_mean_matches
from uwsim.optics.sources import camera_response
from uwsim.optics.spectrum import WAVELENGTHS_NM, band_mean
from uwsim.render import film, selfcheck, transport
from uwsim.render.build import build

LAMP_M = (0.3, -0.2, 0.1)
# linear interpolation of the tabulated spectra and float32 transport
MODEL = 2e-3


@pytest.fixture(scope="module", autouse=True)
def _variant(llvm_spectral):
    pass


def expected(distance_m, attenuation):
    radiance, path_m = scenes.wall_radiance(distance_m=distance_m, lamp_m=LAMP_M)
    return radiance * band_mean(np.exp(-attenuation * path_m), camera_response(scenes.RESPONSE))


@pytest.mark.parametrize(("distance_m", "low", "high"), [(1.0, 0.5, 0.5), (2.0, 0.2, 1.4)])
def test_lamp_wall_camera_in_absorbing_water(distance_m, low, high):
    """Setup: camera and lamp in absorbing water before a grey wall. Expected: Lambert's law times exp(-c path),
    averaged over each band. Tolerance: Monte Carlo (0.3 %), model 2e-3 (tabulated spectra, float32)."""
    water = scenes.spectral_water(low_per_m=low, high_per_m=high)
    scene = scenes.wall(distance_m=distance_m, lamp_m=LAMP_M)
    found = scenes.replicates(scene, water=water, samples=1024)
    truth = expected(distance_m, water.absorption)
    assert_mean_matches(found, truth, max_relative_standard_error=0.01, model_tolerance=MODEL)
    with pytest.raises(AssertionError, match="biased"):  # negative control: a path 4 % too long
        wrong = truth * np.exp(-0.04 * (low + high) / 2 * 2 * distance_m)
        assert_mean_matches(found, wrong, max_relative_standard_error=0.01, model_tolerance=MODEL)


def test_transmission_buffer_is_exponential():
    """Setup: same wall. Expected: the transmission buffer is the band mean of exp(-c (r + r_lamp)) under response x
    lamp. Tolerance: model 2e-3; wavelengths are sampled, 16 per pixel."""
    water = scenes.spectral_water(low_per_m=0.2, high_per_m=1.4)
    scene = scenes.wall(distance_m=1.0, lamp_m=LAMP_M)
    built = build(scene, water=None, rig_poses=scene.rig.world_from_rig[None])
    found = transport.transmission(
        built, film.view_of(scene), attenuation=water.absorption, samples_per_pixel=1024, seed=1
    )
    vacuum, _ = scenes.wall_radiance(distance_m=1.0, lamp_m=LAMP_M)
    truth = expected(1.0, water.absorption) / vacuum
    np.testing.assert_allclose(found.mean(axis=(0, 1)), truth, rtol=3e-3)
    assert not np.allclose(found.mean(axis=(0, 1)), truth**0.98, rtol=3e-3)  # negative control


def test_camera_without_its_medium_is_seen():
    """Negative control of the law itself: an image without the medium around the camera must not pass."""
    scene = scenes.wall(distance_m=1.0, lamp_m=LAMP_M)
    found = scenes.replicates(scene, water=None, samples=64)
    truth = expected(1.0, np.full(len(WAVELENGTHS_NM), 0.5))
    with pytest.raises(AssertionError, match="biased"):
        assert_mean_matches(found, truth, max_relative_standard_error=0.1)


def test_self_check_passes_in_water_and_refuses_what_ignores_it(monkeypatch):
    """Setup: the check that precedes every render. Expected: it passes in scattering and in strongly coloured water; a
    camera that lost its medium is refused, and so is water 5 % clearer than described."""
    scene = scenes.wall(distance_m=1.0)
    murky = {"name": "tank_high"}
    for water in ({"name": "tank_low"}, murky):
        selfcheck.check_medium(type(scene).model_validate(scene.model_dump() | {"water": water}), seed=1)

    def build_with(change):
        return lambda target, *, water, rig_poses: build(target, water=change(water), rig_poses=rig_poses)

    monkeypatch.setattr(selfcheck, "build", build_with(lambda water: None))
    with pytest.raises(ValueError, match="self-check"):
        selfcheck.check_medium(scene, seed=1)
    clearer = build_with(lambda water: dataclasses.replace(water, absorption=0.95 * water.absorption))
    monkeypatch.setattr(selfcheck, "build", clearer)
    with pytest.raises(ValueError, match="self-check"):
        selfcheck.check_medium(scene, seed=1)
