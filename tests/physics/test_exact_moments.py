"""Photons that walk by the renderer's own draws of free path and direction: the exact moments of where they end."""

import dataclasses

import numpy as np
import pytest

from tests.physics import slabs
from tests.references.monte_carlo import assert_mean_matches
from uwsim.optics import phase as phases
from uwsim.optics.phase_functions.henyey_greenstein import HenyeyGreenstein
from uwsim.optics.phase_functions.petzold import petzold
from uwsim.optics.spectrum import WAVELENGTHS_NM
from uwsim.optics.water import Water
from uwsim.render.build import Added, build, load_medium

ABSORPTION, SCATTERING = 0.1, 0.9
PHASES = {
    "hg": ({"type": "hg", "g": 0.924}, HenyeyGreenstein(0.924)),
    "petzold": ({"type": "petzold", "name": "average"}, petzold("average")),
}
REPLICATES, PHOTONS = 16, 20_000


@pytest.fixture(scope="module", autouse=True)
def _variant(llvm_spectral):
    pass


def built_of(*, share: float, name: str):
    """Return water that makes up `share` of absorption and scattering, without the rest."""
    water = slabs.tabulated(
        absorption_per_m=share * ABSORPTION, scattering_per_m=share * SCATTERING, phase=PHASES[name][0]
    )
    scene = slabs.scene_under({"sky_irradiance_w_per_m2": 1.0}, water=water, refractive_index=1.34)
    return build(scene, water=scene.water.optical(), rig_poses=scene.rig.world_from_rig[None])


def in_cells(*, name: str, added_name: str, whole: float = 1.0):
    """Return water of which 30 % fill the world, and 70 % are shared at random by two added waters, cell by cell."""
    import mitsuba as mi

    rng = np.random.default_rng(0)
    edges = tuple(np.concatenate([[-400.0], np.sort(rng.uniform(-12, 12, 8)), [400.0]]) for _ in range(3))
    first = rng.random((9, 9, 9))
    flat = np.ones(len(WAVELENGTHS_NM))
    phase = phases.grey(PHASES[added_name][1])
    water = Water("added", 0.7 * whole * ABSORPTION * flat, 0.7 * whole * SCATTERING * flat, phase)
    functions = tuple(load_medium(mi, water).phase_function() for _ in range(2))
    added = Added((water, water), functions, edges, np.stack([first, 1 - first]))
    return dataclasses.replace(built_of(share=0.3, name=name), added=added)


def ends(built) -> np.ndarray:
    """Return where photons of a beam along z from the origin are absorbed, (REPLICATES, PHOTONS, 3)."""
    import drjit as dr
    import mitsuba as mi

    from uwsim.render.medium import Medium

    medium, sampler = Medium(built), mi.load_dict({"type": "independent"})
    count = REPLICATES * PHOTONS
    sampler.seed(1, count)
    wavelengths = mi.Spectrum(*slabs.WAVELENGTHS_OF_RAYS_NM)
    k = medium.coefficients(wavelengths)
    place, direction = dr.zeros(mi.Point3f, count), dr.repeat(mi.Vector3f(0, 0, 1), count)
    alive = dr.full(mi.Bool, True, count)
    for _ in range(400):
        depth = -dr.log(1 - sampler.next_1d())
        place = dr.select(alive, place + direction * medium.free_path(k, 0, place, direction, depth, alive), place)
        alive &= sampler.next_1d() >= ABSORPTION / (ABSORPTION + SCATTERING)
        at = dr.zeros(mi.MediumInteraction3f)
        at.p, at.wi, at.wavelengths, at.sh_frame = place, -direction, wavelengths, mi.Frame3f(-direction)
        direction = medium.scattered_direction(k, at, sampler.next_1d(), sampler.next_2d(), alive)
        dr.eval(place, direction, alive)
        if not dr.any(alive):
            return np.array(place).T.reshape(REPLICATES, PHOTONS, 3)
    raise AssertionError("photons that are never absorbed")


def moments(built) -> np.ndarray:
    """Return <z> and <r^2> of independent replicates, (REPLICATES, 2)."""
    places = ends(built).astype(float)
    return np.stack([places[..., 2].mean(axis=1), (places**2).sum(axis=2).mean(axis=1)], axis=1)


def truth(g: float, *, absorption_per_m: float = ABSORPTION) -> np.ndarray:
    a, transport = absorption_per_m, absorption_per_m + SCATTERING * (1 - g)
    return np.array([1 / transport, 2 / (a * transport)])


RULE = {"max_relative_standard_error": 0.006, "model_tolerance": 2e-3}


@pytest.mark.parametrize("name", PHASES)
def test_moments_in_homogeneous_water(name):
    """Setup: a pencil beam in endless water, photons absorbed with a/c at each collision. Expected: <z> = 1/(a +
    b(1-g)), <r^2> = 2/(a(a + b(1-g))) for any phase function with mean cosine g. Tolerance: Monte Carlo (0.6 %),
    model 2e-3. Negative control: a mean cosine 0.01 larger."""
    found, g = moments(built_of(share=1.0, name=name)), PHASES[name][1].mean_cosine
    assert_mean_matches(found, truth(g), **RULE)
    with pytest.raises(AssertionError, match="biased"):
        assert_mean_matches(found, truth(g + 0.01), **RULE)


@pytest.mark.parametrize(
    ("name", "added_name"), [("petzold", "hg"), pytest.param("hg", "petzold", marks=pytest.mark.slow)]
)
def test_moments_across_cells(name, added_name):
    """Setup: the same, but 70 % of absorption and scattering belong to two waters that share them at random among
    729 cells of all sizes, with a phase function of their own. Expected: the same moments, g the mean over the
    scattering. Tolerance: as above. Negative control: cells with 5 % more."""
    g = 0.3 * PHASES[name][1].mean_cosine + 0.7 * PHASES[added_name][1].mean_cosine
    assert_mean_matches(moments(in_cells(name=name, added_name=added_name)), truth(g), **RULE)
    with pytest.raises(AssertionError, match="biased"):
        assert_mean_matches(moments(in_cells(name=name, added_name=added_name, whole=1.05)), truth(g), **RULE)
