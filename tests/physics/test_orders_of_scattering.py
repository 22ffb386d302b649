"""The layers split by order of scattering: what met no particle, or one, has a closed form."""

import numpy as np
import pytest
from scipy import integrate

from tests.physics import scenes
from tests.references.monte_carlo import assert_mean_matches
from uwsim.optics.phase import henyey_greenstein
from uwsim.render import film, transport
from uwsim.render.accumulate import accumulate
from uwsim.render.build import build

OFFSET_M, DEPTH_M, ABSORPTION, SCATTERING, G = 0.2, 1.0, 0.2, 0.4, 0.75
RULE = {"max_relative_standard_error": 0.005, "model_tolerance": 2e-3}  # narrow view, float32
NAMES = ("direct", "direct_unscattered", "backscatter", "backscatter_single")


@pytest.fixture(scope="module")
def layers(llvm_spectral):
    """Means over the image of each layer, {name: (replicates, 3)}: a lamp of 1 W/sr beside the camera, a grey wall."""
    scene = scenes.wall(distance_m=DEPTH_M, lamp_m=(OFFSET_M, 0.0, 0.0), half_angle_deg=89.0)
    water = scenes.water(absorption_per_m=ABSORPTION, scattering_per_m=SCATTERING, g=G)
    built, view = build(scene, water=water, rig_poses=scene.rig.world_from_rig[None]), film.view_of(scene)
    walk = transport.estimate(built, orders=True)
    found = {name: [] for name in NAMES}
    for seed in range(16):
        images = transport.pictures(accumulate(built, view, walk, samples_per_pixel=1024, batches=2, seed=seed))
        for name in NAMES:
            found[name].append(images[name].mean(axis=(0, 1)))
    return {name: np.stack(values) for name, values in found.items()}


def test_unscattered_direct_light_is_the_wall_dimmed_on_the_whole_way(layers):
    """Expected: the wall's radiance in vacuum times exp(-c (lamp-wall-camera)), all orders of scattering followed.
    Tolerance: Monte Carlo (0.5 %), model 2e-3. Negative control: the direct layer with its scattered light."""
    radiance, path_m = scenes.wall_radiance(distance_m=DEPTH_M, lamp_m=(OFFSET_M, 0.0, 0.0), half_angle_deg=89.0)
    truth = np.full(3, radiance * np.exp(-(ABSORPTION + SCATTERING) * path_m))
    assert_mean_matches(layers["direct_unscattered"], truth, **RULE)
    with pytest.raises(AssertionError, match="biased"):
        assert_mean_matches(layers["direct"], truth, **RULE | {"max_relative_standard_error": 0.05})


def test_single_backscatter_is_the_airlight_integral(layers):
    """Expected: the integral over the ray of b p(angle) I exp(-c (z + d)) / d^2, all orders of scattering followed.
    Tolerance: Monte Carlo (0.5 %), model 2e-3. Negative control: the backscatter of all orders."""
    order = -np.log(2) / np.log(np.cos(np.radians(89.0)))

    def along(z):
        distance = np.hypot(z, OFFSET_M)
        value = SCATTERING * henyey_greenstein(-z / distance, g=G) * (z / distance) ** order
        return value * np.exp(-(ABSORPTION + SCATTERING) * (z + distance)) / distance**2

    truth = np.full(3, integrate.quad(along, 0, DEPTH_M, epsabs=0, epsrel=1e-10)[0] / 300.0)
    assert_mean_matches(layers["backscatter_single"], truth, **RULE)
    with pytest.raises(AssertionError, match="biased"):
        assert_mean_matches(layers["backscatter"], truth, **RULE | {"max_relative_standard_error": 0.05})


def test_a_share_is_not_more_than_its_layer(layers):
    """Expected: the layer holds its share and more. Tolerance: round-off. Negative control: the other way round."""
    for layer, share in (("direct", "direct_unscattered"), ("backscatter", "backscatter_single")):
        assert np.all(layers[share] <= layers[layer] * (1 + 1e-6))
        assert np.any(layers[layer] > layers[share] * 1.01)
