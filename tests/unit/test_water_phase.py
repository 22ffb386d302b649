"""Phase functions of the water in a scene: by type, for all of the scattering or for the particles."""

import json

import numpy as np
import pytest

from tests.physics import scenes
from uwsim.optics import phase as phases
from uwsim.optics.phase_functions.fournier_forand import FournierForand
from uwsim.optics.phase_functions.henyey_greenstein import HenyeyGreenstein
from uwsim.optics.phase_functions.mixture import Mixture, four_term
from uwsim.optics.phase_functions.petzold import petzold
from uwsim.optics.phase_functions.rayleigh import Rayleigh
from uwsim.optics.phase_functions.two_term import two_term
from uwsim.optics.spectrum import WAVELENGTHS_NM
from uwsim.optics.water import named_water
from uwsim.scene.models import Scene
from uwsim.validation import validated

ANGLES = np.radians([0.01, 0.3, 5.0, 60.0, 120.0, 179.0])
TABULATED = {"wavelengths_nm": [400, 700], "absorption_per_m": [0.1, 0.2], "scattering_per_m": [0.3, 0.2]}


def scene(water: dict) -> Scene:
    values = scenes.wall(distance_m=1.0).model_dump() | {"water": water}
    return validated(Scene, values, where="scene.toml")


def tabulated(phase: dict) -> phases.PhaseMixture:
    return scene(TABULATED | {"phase": phase}).water.optical().phase


@pytest.mark.parametrize(
    ("values", "function"),
    [
        ({"type": "hg", "g": 0.9}, HenyeyGreenstein(0.9)),
        (
            {"type": "hg_mixture", "g": [0.9, -0.4], "weights": [0.98, 0.02]},
            Mixture((HenyeyGreenstein(0.9), HenyeyGreenstein(-0.4)), (0.98, 0.02)),
        ),
        (
            {"type": "two_term", "share": 0.97, "g_forward": 0.92, "g_backward": -0.3},
            two_term(share=0.97, g_forward=0.92, g_backward=-0.3),
        ),
        ({"type": "fournier_forand", "n": 1.1, "mu": 3.5835}, FournierForand(n=1.1, mu=3.5835)),
        ({"type": "petzold", "name": "harbor"}, petzold("harbor")),
        ({"type": "rayleigh"}, Rayleigh()),
        ({"type": "rayleigh", "depolarisation": 0.0}, Rayleigh(depolarisation=0.0)),
        ({"type": "isotropic"}, HenyeyGreenstein(0.0)),
    ],
    ids=lambda value: value["type"] if isinstance(value, dict) else "",
)
def test_a_phase_function_by_its_type(values, function):
    found = tabulated(values)
    for column in (0, 60):
        assert found.density_at(ANGLES)[:, column] == pytest.approx(function.density(ANGLES), rel=1e-12)
    assert found.mean_cosine == pytest.approx(np.full(61, function.mean_cosine), abs=1e-12)
    assert found.backscatter_fraction == pytest.approx(np.full(61, function.backscatter_fraction), abs=1e-12)


@pytest.mark.parametrize(
    ("phase", "message"),
    [
        ({"type": "mie"}, r"water.phase.type: got 'mie', allowed: 'hg', .*'isotropic'"),
        ({"g": 0.9}, r"water.phase.type: missing, allowed: .*'hg'"),
        ({"type": "fournier_forand", "n": 0.9, "mu": 3.5}, r"water.phase: .*n is 0.9, allowed: above 1"),
        ({"type": "fournier_forand", "n": 1.1}, r"water.phase.mu: missing"),
        ({"type": "petzold", "name": "lake"}, r"water.phase.name: got 'lake', allowed: 'clear'"),
        ({"type": "two_term", "share": 1.2, "g_forward": 0.9, "g_backward": 0.0}, r"water.phase.share: got 1.2"),
        ({"type": "two_term", "share": 0.9, "g_forward": 1.0, "g_backward": 0.0}, r"water.phase: .*g is 1.0"),
        ({"type": "rayleigh", "depolarisation": 1.0}, r"water.phase.depolarisation: got 1.0, allowed: < 1"),
        ({"type": "isotropic", "g": 0.0}, r"water.phase.g: unknown key, allowed: type"),
        ({"type": "hg", "g": [0.5, 0.9, 0.9]}, r"phase.g: got 2 wavelengths and 3 values"),
        (
            {"type": "hg_mixture", "g": [0.5, 0.9], "weights": [1.0]},
            r"water.phase: .*weights are \(1.0,\), allowed: one",
        ),
    ],
)
def test_bad_phase_functions_are_refused_in_one_line(phase, message):
    with pytest.raises(ValueError, match=message) as refusal:
        tabulated(phase)
    assert "\n" not in str(refusal.value)


FOURNIER_FORAND = {"type": "fournier_forand", "n": 1.1, "mu": 3.5835}


@pytest.mark.parametrize("water", [{"name": "tank_low"}, {"name": "jerlov_II"}, {"minerals_g_per_m3": 1.8}])
def test_the_particles_may_have_another_phase_function(water):
    """Expected: the same coefficients, molecules as before, and of the rest the function asked for."""
    own = scene(water).water.optical()
    other = scene(water | {"particle_phase": FOURNIER_FORAND}).water.optical()
    np.testing.assert_array_equal(own.absorption, other.absorption)
    np.testing.assert_array_equal(own.scattering, other.scattering)
    molecules = other.phase.weights[:2].sum(axis=0)
    assert own.phase.weights[:2].sum(axis=0) == pytest.approx(molecules, abs=1e-12)
    back = 0.5 * molecules + FournierForand(n=1.1, mu=3.5835).backscatter_fraction * (1 - molecules)
    assert other.phase.backscatter_fraction == pytest.approx(back, rel=1e-9)
    assert own.phase.backscatter_fraction != pytest.approx(back, rel=1e-2)


@pytest.mark.parametrize(
    ("water", "message"),
    [
        ({"name": "petzold_harbor", "particle_phase": FOURNIER_FORAND}, "particle_phase.*measured for the whole water"),
        ({"name": "tank_low", "particle_phase": {"type": "hg", "g": [0.9, 0.8]}}, "one number"),
        (
            {"name": "tank_low", "particle_phase": {"type": "petzold", "name": "x"}},
            r"water.particle_phase.name: got 'x'",
        ),
        ({"minerals_g_per_m3": 1.0, "particle_phase": {"type": "hg", "g": 1.0}}, "water.particle_phase: g is 1.0"),
    ],
)
def test_phase_functions_that_particles_cannot_have_are_refused(water, message):
    with pytest.raises(ValueError, match=message) as refusal:
        scene(water)
    assert "\n" not in str(refusal.value)


def test_a_mixture_needs_shares_of_every_term():
    with pytest.raises(ValueError, match=r"shape \(1, 61\), allowed: \(2, 61\)"):
        phases.PhaseMixture((Rayleigh(), petzold("clear")), np.ones((1, 61)))
    with pytest.raises(ValueError, match="sum to 1"):
        phases.PhaseMixture((Rayleigh(),), np.full((1, 61), 0.9))


def test_mixing_any_terms():
    """Expected: shares in proportion to scattering. Negative control: equal shares."""
    rising = np.linspace(0.1, 0.9, len(WAVELENGTHS_NM))
    parts = phases.grey(Rayleigh()), phases.grey(four_term("average")), phases.grey(petzold("clear"))
    mixed = phases.mix([(rising, parts[0]), (0.5 * rising, parts[1]), (1 - rising, parts[2])])
    assert len(mixed.terms) == 6 and mixed.henyey_greenstein_g is None
    total = 1.5 * rising + 1 - rising
    truth = sum(b / total * p.mean_cosine for b, p in zip((rising, 0.5 * rising, 1 - rising), parts, strict=True))
    assert mixed.mean_cosine == pytest.approx(truth, rel=1e-12)
    assert mixed.mean_cosine != pytest.approx(sum(part.mean_cosine for part in parts) / 3, rel=1e-2)


def test_cosines_and_angles_agree():
    mixture = phases.grey(FournierForand(n=1.1, mu=3.5835))
    angles = np.geomspace(1e-3, np.pi, 50)
    np.testing.assert_allclose(mixture.density(np.cos(angles)), mixture.density_at(angles), rtol=1e-9)
    assert not np.allclose(mixture.density(np.cos(angles)), mixture.density_at(1.01 * angles[:-1]).mean(), rtol=1e-2)


def test_the_description_of_a_phase_function():
    own = phases.describe(named_water("tank_low").phase)
    assert own["type"] == "hg_mixture" and len(own["g"]) == len(own["weights"]) == 6
    terms = (Rayleigh(), FournierForand(n=1.1, mu=3.5), petzold("clear"), Mixture((HenyeyGreenstein(0.5),), (1.0,)))
    weights = np.full((4, 61), 0.25)
    found = json.loads(json.dumps(phases.describe(phases.PhaseMixture(terms, weights))))
    assert [term["type"] for term in found["terms"]] == ["rayleigh", "fournier_forand", "table", "mixture"]
    assert found["type"] == "mixture" and found["terms"][1] == {"type": "fournier_forand", "n": 1.1, "mu": 3.5}
    assert len(found["terms"][2]["angles_deg"]) == len(found["terms"][2]["values"])
    with pytest.raises(ValueError, match="no description of a object"):
        phases.describe(phases.PhaseMixture((object(),), np.ones((1, 61))))
