"""Light found from the lamps' side is the light that paths from the camera find."""

import numpy as np
import pytest
from scipy import stats

from tests.physics import scenes
from uwsim.render import film, integrator
from uwsim.render.accumulate import accumulate
from uwsim.render.build import build


@pytest.fixture(scope="module", autouse=True)
def _variant(llvm_spectral):
    pass


_COUNT = 12
_POWER = 0.02  # a difference that the test must be able to see
_MODEL = 0.002  # float32 transport


def _wall_near_the_origin():
    """A wall at 1 m and a lamp beside the camera, 1 m below the origin: float32 has its digits there."""
    scene = scenes.wall(distance_m=1.0, lamp_m=(0.3, 0.0, 0.1))
    rig = scene.rig.model_copy(update={"position_m": (0.0, 0.0, -1.0), "look_at_m": (0.0, 1.0, -1.0)})
    wall = scene.bodies[0].model_copy(update={"position_m": (0.0, 1.0, -1.0), "towards_m": (0.0, 0.0, -1.0)})
    return scene.model_copy(update={"rig": rig, "bodies": (wall,)})


def _layers(monkeypatch, *, deep: float, seed: int, without_first: bool = False) -> np.ndarray:
    """Return direct, forward_scatter and backscatter, means over a small picture, (replicates, 3)."""
    monkeypatch.setattr(integrator, "_DEEP", deep)
    scene = _wall_near_the_origin()
    water = scenes.water(absorption_per_m=0.3, scattering_per_m=1.0, g=0.5)
    built = build(scene, water=water, rig_poses=scene.rig.world_from_rig[None])
    walk, view = integrator.LampWalk(built), film.view_of(scene)
    if without_first:
        monkeypatch.setattr(walk, "_reflected_once", lambda *_: 0.0)

    def estimate(rays, sampler, sets):
        return walk(rays, sampler, sets)[:3]

    def means(k):
        sums = accumulate(built, view, estimate, samples_per_pixel=1024, batches=4, seed=seed + k)
        return sums.means.mean(axis=(1, 2, 3))

    return np.stack([means(k) for k in range(_COUNT)])


def _agree(first: np.ndarray, second: np.ndarray, *, least_error: float) -> bool:
    """Whether means agree by Welch's test at 1 % over the layers (Sidak), beyond the model tolerance."""
    difference = np.abs(first.mean(axis=0) - second.mean(axis=0))
    error = np.sqrt(first.var(axis=0, ddof=1) / _COUNT + second.var(axis=0, ddof=1) / _COUNT)
    assert np.all(error <= least_error * second.mean(axis=0)), f"no power: {error / second.mean(axis=0)}"
    level = 1 - (1 - 0.01) ** (1 / first.shape[1])
    allowed = stats.t.ppf(1 - level / 2, _COUNT - 1) * error + _MODEL * second.mean(axis=0)
    return bool(np.all(difference <= allowed))


def test_both_sides_find_the_same_light(monkeypatch):
    """Setup: grey water (c = 1.3 /m, HG 0.5), a wall at 1 m, a lamp aside; bodies served from the lamp or not at all.

    Expected: equal layers. Tolerance: Monte Carlo (12 replicates, Sidak over three layers, standard errors up to 2 %)
    and 2e-3 for float32. Control: without the light scattered once, the lamp's side is told apart.
    """
    by_paths = _layers(monkeypatch, deep=1e9, seed=100)
    by_lamp_side = _layers(monkeypatch, deep=0.0, seed=500)
    assert _agree(by_lamp_side, by_paths, least_error=_POWER)
    lacking = _layers(monkeypatch, deep=0.0, seed=900, without_first=True)
    assert not _agree(lacking, by_paths, least_error=_POWER)


@pytest.mark.parametrize("angle", [1e-3, 0.1, 1.0, 3.0])
def test_the_phase_of_a_table_is_the_phase_function(angle):
    """Setup: table of HG 0.9. Expected: its formula. Tolerance: 2 % (bins). Control: another g is not it."""
    from uwsim.optics import phase
    from uwsim.render.angles import scattering_tables

    table, _ = scattering_tables(phase.constant([0.9], [1.0]))
    found = float(table.phase(angle)[0])
    formula = float(phase.henyey_greenstein(np.cos(angle), g=0.9))
    assert found == pytest.approx(formula, rel=0.02)
    assert found != pytest.approx(float(phase.henyey_greenstein(np.cos(angle), g=0.8)), rel=0.02)
