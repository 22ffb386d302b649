"""Furnace: in uniform light, water that scatters without absorbing is invisible (medium, phase function, reference)."""

import numpy as np
import pytest

from tests.physics import scenes
from tests.references.monte_carlo import assert_mean_matches
from uwsim.render import film, transport
from uwsim.render.build import Built, integrator_description, load_medium

RADIUS_M = 1.0


@pytest.fixture(scope="module", autouse=True)
def _variant(llvm_spectral):
    pass


def ball(*, albedo: float) -> np.ndarray:
    """Return replicates (16, 3) of the centre of a ball of water seen from outside in radiance 1 from everywhere."""
    import mitsuba as mi

    water = scenes.water(absorption_per_m=2 * (1 - albedo), scattering_per_m=2 * albedo)
    description = {
        "type": "scene",
        "integrator": integrator_description("volpathmis"),
        "light": {"type": "constant", "radiance": {"type": "uniform", "value": 1.0}},
        "ball": {
            "type": "sphere",
            "radius": RADIUS_M,
            "bsdf": {"type": "null"},
            "interior": load_medium(mi, water),
        },
    }
    camera = np.eye(4)
    camera[2, 3] = -5.0  # looks along +z
    view = film.view_of(scenes.wall(distance_m=1.0))
    built = Built(mi.load_dict(description, optimize=False), None, camera[None])
    images = [transport.reference_radiance(built, view, samples_per_pixel=512, batches=2, seed=s)[0] for s in range(16)]
    return np.stack([image.mean(axis=(0, 1)) for image in images])


def test_scattering_water_is_invisible_in_uniform_light():
    """Setup: ball of optical radius 2, g = 0.9, unlimited orders of scattering. Expected: radiance 1 in every band.
    Tolerance: Monte Carlo (0.3 %), model 2e-3 (float32 transport)."""
    assert_mean_matches(ball(albedo=1.0), np.ones(3), max_relative_standard_error=0.004, model_tolerance=2e-3)


def test_two_percent_of_absorption_is_seen():
    """Negative control: single-scattering albedo 0.98 must fail the same test."""
    with pytest.raises(AssertionError, match="biased"):
        assert_mean_matches(ball(albedo=0.98), np.ones(3), max_relative_standard_error=0.004, model_tolerance=2e-3)
