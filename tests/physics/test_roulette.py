"""Paths that are ended early by chance bring the same light as paths that are followed to the end."""

import numpy as np
import pytest
from scipy import stats

from tests.physics import scenes
from uwsim.render import film, integrator, transport
from uwsim.render.accumulate import accumulate
from uwsim.render.build import build


@pytest.fixture(scope="module", autouse=True)
def _variant(llvm_spectral):
    pass


_COUNT = 12
_POWER = 0.02  # a difference that the test must be able to see
_MODEL = 0.002  # float32 transport


def _layers(monkeypatch, *, roulette_depth: int, most_segments: int = 1 << 20, seed: int) -> np.ndarray:
    """Return direct, forward_scatter and backscatter, means over a small picture, (replicates, 3)."""
    monkeypatch.setattr(integrator, "_ROULETTE_DEPTH", roulette_depth)
    monkeypatch.setattr(integrator, "MOST_SEGMENTS", most_segments)
    scene = scenes.wall(distance_m=1.0, lamp_m=(0.3, 0.0, 0.1))
    water = scenes.water(absorption_per_m=0.3, scattering_per_m=2.0, g=0.8)
    built = build(scene, water=water, rig_poses=scene.rig.world_from_rig[None])
    view, estimate = film.view_of(scene), transport.estimate(built)

    def means(k):
        sums = accumulate(built, view, estimate, samples_per_pixel=1024, batches=4, seed=seed + k)
        return sums.means[1:4].mean(axis=(1, 2, 3))

    return np.stack([means(k) for k in range(_COUNT)])


def _agree(first: np.ndarray, second: np.ndarray, *, least_error: float) -> bool:
    """Whether means agree by Welch's test at 1 % over the layers (Sidak), beyond the model tolerance."""
    difference = np.abs(first.mean(axis=0) - second.mean(axis=0))
    error = np.sqrt(first.var(axis=0, ddof=1) / _COUNT + second.var(axis=0, ddof=1) / _COUNT)
    assert np.all(error <= least_error * second.mean(axis=0)), f"no power: {error / second.mean(axis=0)}"
    level = 1 - (1 - 0.01) ** (1 / first.shape[1])
    allowed = stats.t.ppf(1 - level / 2, _COUNT - 1) * error + _MODEL * second.mean(axis=0)
    return bool(np.all(difference <= allowed))


def test_roulette_keeps_the_light(monkeypatch):
    """Setup: grey water (c = 2.3 /m, HG 0.8), a wall at 1 m, a lamp aside; roulette from the first event on, or none
    before the 60th. Expected: equal layers. Tolerance: Monte Carlo (12 replicates, Sidak over three layers, standard
    errors up to 2 %) and 2e-3 for float32. Control: paths of at most 3 segments are told apart."""
    followed = _layers(monkeypatch, roulette_depth=60, seed=100)
    by_chance = _layers(monkeypatch, roulette_depth=0, seed=500)
    assert _agree(by_chance, followed, least_error=_POWER)
    cut = _layers(monkeypatch, roulette_depth=60, most_segments=3, seed=900)
    assert not _agree(cut, followed, least_error=_POWER)
