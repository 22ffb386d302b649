"""Light of the sun scattered once towards an eye in the water: parallel light in closed form."""

import numpy as np
import pytest

from tests.physics import slabs
from tests.references.monte_carlo import assert_mean_matches
from uwsim.optics.natural_light import below_surface
from uwsim.optics.phase_functions.henyey_greenstein import HenyeyGreenstein
from uwsim.optics.phase_functions.petzold import petzold

INDEX, ZENITH_DEG, DEPTH_M = 1.34, 50.0, 3.0
ABSORPTION, SCATTERING = 0.1, 0.3
PHASES = {
    "hg": ({"type": "hg", "g": 0.9}, HenyeyGreenstein(0.9)),
    "petzold": ({"type": "petzold", "name": "average"}, petzold("average")),
}
OFF_SUN_DEG = (0.01, 0.1, 1.0, 20.0, 39.0, 90.0, 150.0)


@pytest.fixture(scope="module", autouse=True)
def _variant(llvm_spectral):
    pass


def scene_of(name: str, *, in_layers: bool):
    """Return one water, or half of it everywhere with the other half as two added layers one above the other."""

    def water(share):
        return slabs.tabulated(
            absorption_per_m=share * ABSORPTION, scattering_per_m=share * SCATTERING, phase=PHASES[name][0]
        )

    layers = (("upper", 0.0, 1.3), ("lower", 1.3, 900.0)) if in_layers else ()
    added = tuple(
        {"name": n, "kind": "layer", "top_water_depth_m": top, "bottom_water_depth_m": bottom, "water": water(0.5)}
        for n, top, bottom in layers
    )
    sun = {"sun_irradiance_w_per_m2": 1.0, "sun_zenith_deg": ZENITH_DEG}
    return slabs.scene_under(sun, water=water(0.5 if in_layers else 1.0), added=added, refractive_index=INDEX)


def closed_form(view: np.ndarray, sun: np.ndarray, phase) -> float:
    """Return E beta(angle) int exp(-c s - c depth(s) / mu) ds along a view from DEPTH_M up to the surface or for
    ever."""
    c = ABSORPTION + SCATTERING
    light = below_surface(
        direct_w_per_m2=1.0, diffuse_w_per_m2=0.0, sun_zenith_rad=np.radians(ZENITH_DEG), n_water=INDEX
    )
    rate = c * (1 - view[2] / sun[2])
    length = DEPTH_M / view[2] if view[2] > 0 else np.inf
    path = length if abs(rate * length) < 1e-9 else -np.expm1(-rate * length) / rate
    angle = 2 * np.arcsin(np.linalg.norm(view - sun) / 2)
    spread = SCATTERING * phase.density(np.array([angle]))[0]
    return float(light.direct_w_per_m2 / sun[2] * spread * np.exp(-c * DEPTH_M / sun[2]) * path)


@pytest.mark.parametrize("in_layers", [False, True])
@pytest.mark.parametrize("name", PHASES)
def test_sun_scattered_once(name, in_layers, monkeypatch):
    """Setup: sun at 50 deg, water of 0.4 /m, seen from 3 m at seven angles off the sun, paths of one segment; the same
    with half of the water in layers. Expected: the closed form. Tolerance: Monte Carlo (0.5 %), model 3e-3 (float32
    angles of 0.01 deg). Negative control: 2 % more."""
    from uwsim.render import integrator

    monkeypatch.setattr(integrator, "MOST_SEGMENTS", 1)
    scene, phase = scene_of(name, in_layers=in_layers), PHASES[name][1]
    sun = slabs.sun_in_water(scene)
    across = np.cross(np.cross(sun, [0.0, 1.0, 0.0]), sun) if in_layers else np.array([0.0, 1.0, 0.0])
    off = np.radians(OFF_SUN_DEG)[:, None]
    views = np.cos(off) * sun + np.sin(off) * across / np.linalg.norm(across)
    count = 20_000
    directions = np.broadcast_to(np.repeat(views, count, axis=0), (8, count * len(views), 3))
    found = slabs.radiances(scene, depth_m=DEPTH_M, directions=directions, seeds=8)
    found = found.reshape(8, len(views), count).mean(axis=2)
    truth = np.array([closed_form(view, sun, phase) for view in views])
    rule = {"max_relative_standard_error": 0.005, "model_tolerance": 3e-3}
    assert_mean_matches(found, truth, **rule)
    with pytest.raises(AssertionError, match="biased"):
        assert_mean_matches(found, 1.02 * truth, **rule)
