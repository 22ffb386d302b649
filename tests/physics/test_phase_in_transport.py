"""Light transport with phase functions that are no Henyey-Greenstein mixtures."""

import numpy as np
import pytest

from tests.physics import scenes
from tests.references.monte_carlo import assert_mean_matches
from tests.references.tables import read_table
from uwsim.optics import phase as phases
from uwsim.optics.airlight import airlight
from uwsim.optics.phase_functions.fournier_forand import FournierForand
from uwsim.optics.phase_functions.henyey_greenstein import HenyeyGreenstein
from uwsim.optics.phase_functions.petzold import Tabulated, petzold
from uwsim.optics.phase_functions.rayleigh import Rayleigh
from uwsim.optics.sources import camera_response
from uwsim.optics.spectrum import WAVELENGTHS_NM, band_mean
from uwsim.optics.water import Water

OFFSET_M, DEPTH_M, SCATTERING, ATTENUATION = 0.2, 1.0, 0.3, 0.5
PRINTED = next(row for row in read_table("oracle_airlight_point_source") if row["c_per_m"] == "0.5")


@pytest.fixture(scope="module", autouse=True)
def _variant(llvm_spectral):
    pass


@pytest.fixture
def one_segment(monkeypatch):
    from uwsim.render import integrator

    monkeypatch.setattr(integrator, "MOST_SEGMENTS", 1)


def water(phase: phases.PhaseMixture) -> Water:
    flat = np.ones(len(WAVELENGTHS_NM))
    return Water("grey", (ATTENUATION - SCATTERING) * flat, SCATTERING * flat, phase)


def lit_sideways():
    """A wall 1 m ahead and an isotropic lamp of 1 W/sr (over 300 nm) 0.2 m beside the camera."""
    scene = scenes.wall(distance_m=DEPTH_M)
    lamp = scene.rig.lamps[0].model_dump() | {
        "position_m": (OFFSET_M, 0.0, 0.0),
        "look_at_m": (OFFSET_M, 0.0, 1.0),
        "half_angle_deg": None,
        "beam": {"angles_deg": (0.0, 180.0), "values": (1.0, 1.0)},
    }
    rig = scene.rig.model_dump() | {"lamps": (lamp,)}
    return type(scene).model_validate(scene.model_dump() | {"rig": rig})


def closed_form(term) -> float:
    return airlight(
        lamp_offset_m=OFFSET_M, path_m=DEPTH_M, scattering_per_m=SCATTERING, attenuation_per_m=ATTENUATION,
        phase=lambda cosine: term.density(np.arccos(np.clip(cosine, -1, 1))),
    )  # fmt: skip


CASES = {
    "fournier-forand": (FournierForand(n=1.10, mu=3.5835), "L_FF_n1.10_mu3.5835"),
    "rayleigh": (Rayleigh(depolarisation=0.0), "L_rayleigh"),
    "petzold": (petzold("harbor"), None),
}


@pytest.mark.parametrize("name", CASES)
def test_light_scattered_once(name, one_segment):
    """Setup: isotropic lamp 0.2 m beside the camera, wall at 1 m, paths of one segment. Expected: the airlight
    integral, which has the printed digits where there are some. Tolerance: Monte Carlo (0.5 %), model 2e-3 (narrow
    view, float32). Negative control: 2 % more."""
    term, printed = CASES[name]
    truth = closed_form(term)
    if printed:
        assert truth == pytest.approx(float(PRINTED[printed]), rel=1e-7)
    phase = phases.grey(term)
    found = scenes.replicates(lit_sideways(), water=water(phase), samples=1024, layer="backscatter")
    expected = np.full(3, truth / 300.0)
    rule = {"max_relative_standard_error": 0.005, "model_tolerance": 2e-3}
    assert_mean_matches(found, expected, **rule)
    with pytest.raises(AssertionError, match="biased"):
        assert_mean_matches(found, 1.02 * expected, **rule)


def test_shares_over_wavelength_colour_the_backscatter(one_segment):
    """Setup: particles alone above 550 nm, molecules alone below (29 times as bright from the side). Expected: each
    band has the two airlight integrals in the shares of its response. Tolerance: Monte Carlo (1 %), model 5e-3 (the
    step is 5 nm wide). Negative control: shares averaged over the wavelengths."""
    particles, molecules = CASES["fournier-forand"][0], CASES["rayleigh"][0]
    red = (WAVELENGTHS_NM > 550).astype(float)
    phase = phases.PhaseMixture((particles, molecules), np.stack([red, 1 - red]))
    found = scenes.replicates(lit_sideways(), water=water(phase), samples=1024, layer="backscatter")
    share = band_mean(red, camera_response(scenes.RESPONSE))
    rule = {"max_relative_standard_error": 0.01, "model_tolerance": 5e-3}

    def radiance(share):
        return (share * closed_form(particles) + (1 - share) * closed_form(molecules)) / 300.0

    assert_mean_matches(found, radiance(share), **rule)
    with pytest.raises(AssertionError, match="biased"):
        assert_mean_matches(found, radiance(np.full(3, red.mean())), **rule)


def test_all_orders_are_those_of_the_formula():
    """Setup: wall at 1 m, a lamp beside the camera, all orders of scattering by Henyey-Greenstein, g = 0.9, once by
    formula and once by table. Expected: equal radiance. Tolerance: Monte Carlo (0.5 %), 4e-3 for the reference's own
    error. Negative control: g = 0.8."""
    scene = scenes.wall(distance_m=1.0, lamp_m=(OFFSET_M, 0.0, 0.0))

    def radiance(*terms):
        shares = np.eye(len(terms))[0]  # a second term without any share, so that the first is tabulated
        phase = phases.PhaseMixture(terms, np.repeat(shares[:, None], len(WAVELENGTHS_NM), axis=1))
        return scenes.replicates(scene, water=water(phase), samples=128)

    found, truth, wrong = (
        radiance(*terms)
        for terms in ((HenyeyGreenstein(0.9), Rayleigh()), (HenyeyGreenstein(0.9),), (HenyeyGreenstein(0.8),))
    )
    rule = {"max_relative_standard_error": 0.005, "model_tolerance": 4e-3}
    assert_mean_matches(found, truth.mean(axis=0), **rule)
    with pytest.raises(AssertionError, match="biased"):
        assert_mean_matches(found, wrong.mean(axis=0), **rule)


@pytest.mark.slow
def test_all_orders_agree_with_the_stock_integrator():
    """Setup: particles with their peak cut off at 10 deg (with it, the stock integrator needs far more samples than a
    test may take), all orders of scattering. Expected: the radiance of Mitsuba's own volumetric path tracer, which
    draws from the same plugin in its own way. Tolerance: Monte Carlo (0.5 %), 1.5 % for the reference's own error (3
    standard errors). Negative control: 5 % more."""
    angles = np.radians(np.concatenate([[5.0], np.geomspace(10, 180, 60)]))
    angles[-1] = np.pi
    vsf = CASES["fournier-forand"][0].density(np.maximum(angles, angles[1]))
    filled = water(phases.grey(Tabulated(angles, vsf)))
    scene = scenes.wall(distance_m=1.0, lamp_m=(OFFSET_M, 0.0, 0.0))
    found = scenes.replicates(scene, water=filled, samples=512)
    reference = scenes.replicates(scene, water=filled, samples=4096, reference=True)
    truth = reference.mean(axis=0)
    assert np.all(reference.std(axis=0, ddof=1) < 0.024 * truth)  # 0.6 % of the mean of 16
    rule = {"max_relative_standard_error": 0.005, "model_tolerance": 0.015}
    assert_mean_matches(found, truth, **rule)
    with pytest.raises(AssertionError, match="biased"):
        assert_mean_matches(found, 1.05 * truth, **rule)
