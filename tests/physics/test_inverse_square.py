"""Irradiance from a small lamp falls as 1 / d^2, and follows the beam profile."""

import numpy as np
import pytest

from tests.physics import scenes
from tests.references.monte_carlo import assert_mean_matches


@pytest.fixture(scope="module", autouse=True)
def _variant(llvm_spectral):
    pass


DISTANCES_M = (0.5, 1.0, 2.0, 4.0)


def found_at(distance_m, **lamp):
    scene = scenes.wall(distance_m=distance_m, **lamp)
    return scenes.replicates(scene, water=None, samples=64, count=8)


def test_wall_radiance_falls_with_the_square_of_the_distance():
    """Setup: lamp in the camera's place, wall at four distances, no water. Expected: L d^2 is constant and equal to
    rho I_0 / pi. Tolerance: Monte Carlo (wavelengths), model 1e-3 (float32; the 0.2 deg view)."""
    found = np.stack([found_at(d) for d in DISTANCES_M], axis=1)
    truth = np.array([[scenes.wall_radiance(distance_m=d)[0]] * 3 for d in DISTANCES_M])
    assert_mean_matches(found, truth, max_relative_standard_error=0.004, model_tolerance=1e-3)
    wrong = truth * (np.array(DISTANCES_M)[:, None] / DISTANCES_M[0]) ** 0.03  # negative control: power 1.97
    with pytest.raises(AssertionError, match="biased"):
        assert_mean_matches(found, wrong, max_relative_standard_error=0.004, model_tolerance=1e-3)


@pytest.mark.parametrize(("side_m", "half_angle_deg"), [(0.5, 40.0), (1.0, 40.0), (0.3, 15.0)])
def test_beam_profile_and_cosine_off_axis(side_m, half_angle_deg):
    """Setup: lamp beside the camera, wall at 1 m. Expected: I_0 cos^m cos / d^2 (generalised Lambertian).
    Tolerance: as above; the profile is tabulated in steps of 0.1 deg."""
    lamp = {"lamp_m": (side_m, 0.0, 0.0), "half_angle_deg": half_angle_deg}
    found = found_at(1.0, **lamp)
    truth = np.full(3, scenes.wall_radiance(distance_m=1.0, **lamp)[0])
    assert_mean_matches(found, truth, max_relative_standard_error=0.004, model_tolerance=1.5e-3)
    wrong = np.full(
        3, scenes.wall_radiance(distance_m=1.0, lamp_m=lamp["lamp_m"], half_angle_deg=half_angle_deg + 1)[0]
    )
    with pytest.raises(AssertionError, match="biased"):  # negative control: a beam one degree wider
        assert_mean_matches(found, wrong, max_relative_standard_error=0.004, model_tolerance=1.5e-3)
