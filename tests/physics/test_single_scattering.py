"""Light scattered once, from a lamp beside the camera: the airlight integral."""

import numpy as np
import pytest
from scipy import integrate

from tests.physics import scenes
from tests.references.monte_carlo import assert_mean_matches
from uwsim.optics.phase import henyey_greenstein

OFFSET_M, DEPTH_M, SCATTERING, ATTENUATION = 0.2, 1.0, 0.3, 0.5


@pytest.fixture(scope="module", autouse=True)
def _variant(llvm_spectral):
    pass


@pytest.fixture
def integrator():
    from uwsim.render import integrator

    return integrator


def airlight(*, g: float) -> float:
    """Return the integral over the ray of b p(angle) exp(-c (z + d)) / d^2, for an isotropic lamp of 1 W/sr."""

    def along(z):
        distance = np.hypot(z, OFFSET_M)
        # light goes on by -z / d of the direction back to the camera
        phase = henyey_greenstein(-z / distance, g=g)
        return SCATTERING * phase * np.exp(-ATTENUATION * (z + distance)) / distance**2

    return integrate.quad(along, 0, DEPTH_M, epsabs=0, epsrel=1e-10)[0]


@pytest.mark.parametrize(("g", "printed"), [(0.75, 0.0160638806), (0.924, 0.00408968776)])
def test_airlight_integral_agrees_with_published_digits(g, printed):
    """The quadrature against the digits of an independent evaluation of the same case (round-off of ten digits)."""
    assert airlight(g=g) == pytest.approx(printed, rel=1e-8)


@pytest.mark.parametrize("g", [0.75, -0.5])
def test_one_scattering_from_an_isotropic_lamp(g, integrator, monkeypatch):
    """Setup: isotropic lamp 0.2 m beside the camera, wall at 1 m, paths of one segment. Expected: the backscatter is
    the airlight integral. Tolerance: Monte Carlo (0.5 %), model 2e-3 (narrow view, float32). Negative control: 2 % more
    scattering."""
    monkeypatch.setattr(integrator, "MOST_SEGMENTS", 1)
    scene = scenes.wall(distance_m=DEPTH_M)
    isotropic = scene.rig.lamps[0].model_dump() | {
        "position_m": (OFFSET_M, 0.0, 0.0),
        "look_at_m": (OFFSET_M, 0.0, 1.0),
        "half_angle_deg": None,
        "beam": {"angles_deg": (0.0, 180.0), "values": (1.0, 1.0)},
    }
    rig = scene.rig.model_dump() | {"lamps": (isotropic,)}
    scene = type(scene).model_validate(scene.model_dump() | {"rig": rig})
    water = scenes.water(absorption_per_m=ATTENUATION - SCATTERING, scattering_per_m=SCATTERING, g=g)
    found = scenes.replicates(scene, water=water, samples=1024, layer="backscatter")
    truth = np.full(3, airlight(g=g) / 300.0)  # 1 W/sr over 300 nm
    assert_mean_matches(found, truth, max_relative_standard_error=0.005, model_tolerance=2e-3)
    with pytest.raises(AssertionError, match="biased"):
        assert_mean_matches(found, 1.02 * truth, max_relative_standard_error=0.005, model_tolerance=2e-3)


def test_water_without_attenuation_at_some_wavelengths_keeps_its_scattered_light():
    """Setup: absorption and scattering exactly 0 above 600 nm. Expected: the backscatter of the green and blue bands is
    that of water with 1e-4 /m there instead (a zero once lost nearly all of it). Tolerance: Monte Carlo."""
    from uwsim.optics.spectrum import WAVELENGTHS_NM

    scene = scenes.wall(distance_m=1.0, lamp_m=(OFFSET_M, 0.0, 0.0))
    base = scenes.water(absorption_per_m=0.2, scattering_per_m=0.3, g=0.5)

    def backscatter(least, count):
        spectrum = np.where(WAVELENGTHS_NM > 600, least, 1.0)
        water = type(base)("cut", base.absorption * spectrum, base.scattering * spectrum, base.phase)
        options = {"water": water, "samples": 1024, "count": count}
        return scenes.replicates(scene, layer="backscatter", **options)[:, 1:]

    rule = {"max_relative_standard_error": 0.01, "model_tolerance": 0.02}  # the reference has its own error
    found, truth = backscatter(0.0, 16), backscatter(1e-4, 16).mean(axis=0)
    assert_mean_matches(found, truth, **rule)
    with pytest.raises(AssertionError, match="biased"):
        assert_mean_matches(found, 1.1 * truth, **rule)
