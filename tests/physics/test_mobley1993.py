"""Underwater light of the sun through a flat surface: the canonical problems of Mobley et al. 1993."""

import numpy as np
import pytest

from tests.physics import slabs
from tests.references.monte_carlo import assert_mean_matches
from tests.references.tables import read_table
from uwsim.optics.natural_light import below_surface
from uwsim.optics.phase_functions.petzold import petzold

ROWS = read_table("oracle_mobley1993")
PHASES = {"1": {"type": "rayleigh", "depolarisation": 0.0}, "2": {"type": "petzold", "name": "average"}}
INDEX, ZENITH_DEG = 1.34, 60.0
SUN = {"sun_irradiance_w_per_m2": 0.5, "sun_zenith_deg": ZENITH_DEG}
PRINTED_DIGITS = 5e-3  # of the table: half a unit of three digits, at most

# (problem, albedo, optical depth): rays of each of 8 replicates
FAST = {("1", 0.2, 1.0): 20_000, ("1", 0.9, 1.0): 20_000, ("2", 0.2, 1.0): 20_000}
SLOW = {
    ("1", 0.2, 5.0): 30_000, ("1", 0.2, 10.0): 400_000, ("1", 0.9, 5.0): 200_000, ("2", 0.2, 5.0): 300_000,
}  # fmt: skip
CASES = [pytest.param(*key, rays, id="-".join(map(str, key))) for key, rays in FAST.items()]
CASES += [pytest.param(*key, rays, id="-".join(map(str, key)), marks=pytest.mark.slow) for key, rays in SLOW.items()]


@pytest.fixture(scope="module", autouse=True)
def _variant(llvm_spectral):
    pass


def scene_of(problem: str, albedo: float, **more):
    water = slabs.tabulated(absorption_per_m=1 - albedo, scattering_per_m=albedo, phase=PHASES[problem])
    return slabs.scene_under(SUN, water=water, refractive_index=INDEX, **more)


def unscattered(depth_m: float) -> float:
    sun = below_surface(direct_w_per_m2=0.5, diffuse_w_per_m2=0.0, sun_zenith_rad=np.radians(ZENITH_DEG), n_water=INDEX)
    return float(sun.direct_w_per_m2 * np.exp(-depth_m / sun.sun_cosine))


def measured(scene, depth_m: float, rays: int, *, peak) -> dict[str, np.ndarray]:
    options = {"depth_m": depth_m, "seeds": 8, "count": rays}
    return {
        "Ed": unscattered(depth_m) + slabs.irradiance(scene, side=1, peak=peak, **options),
        "Eou": slabs.irradiance(scene, side=-1, scalar=True, **options),
        "Lu": slabs.radiances_towards(scene, cosines=[-1.0], **options)[:, 0],
    }


@pytest.mark.parametrize(("problem", "albedo", "depth", "rays"), CASES)
def test_light_at_depth(problem, albedo, depth, rays):
    """Setup: endless water of 1 /m below a flat surface (n = 1.34), sun at 60 deg, black sky; Rayleigh or Petzold's
    average particle. Expected: downward irradiance, upward scalar irradiance and nadir radiance as an independent
    Monte-Carlo code found them, and as seven codes did on average. Tolerance: Monte Carlo; model: three standard
    errors of that code and 3e-3; twice the scatter of the seven and their printed digits. Negative control: 4 % more,
    and twice what the independent code cannot tell."""
    rows = {
        row["quantity"]: row
        for row in ROWS
        if (row["problem"], float(row["albedo"]), float(row["tau"])) == (problem, albedo, depth)
    }
    assert sorted(rows) == ["Ed", "Eou", "Lu"]
    found = measured(scene_of(problem, albedo), depth, rays, peak=petzold("average") if problem == "2" else None)
    for name, row in rows.items():
        own, codes = float(row["own_mc_value"]), float(row["mean_of_7_codes"])
        exact = 3 * float(row["own_mc_stderr"]) / own + 3e-3
        noise = {"max_relative_standard_error": max(6e-3, exact / 4)}
        assert_mean_matches(found[name], own, model_tolerance=exact, **noise)
        scatter = 2 * float(row["cv_between_codes"]) + PRINTED_DIGITS
        assert_mean_matches(found[name], codes, model_tolerance=scatter, **noise)
        with pytest.raises(AssertionError, match="biased"):
            assert_mean_matches(found[name], (1.04 + 2 * exact) * own, model_tolerance=exact, **noise)


def test_the_surface_sends_upwelling_light_down_again(monkeypatch):
    """Setup: problem 1 with albedo 0.9 at depth 1. Expected: as in the table. Negative control: a surface that lets all
    light out from below is told apart by the downward irradiance (about 10 % of it comes back from there)."""
    from uwsim.render.lights import Surface

    row = next(r for r in ROWS if (r["problem"], r["albedo"], r["tau"], r["quantity"]) == ("1", "0.9", "1", "Ed"))
    monkeypatch.setattr(Surface, "reflectance", lambda self, cosine: 0 * cosine)
    found = measured(scene_of("1", 0.9), 1.0, 20_000, peak=None)["Ed"]
    with pytest.raises(AssertionError, match="biased"):
        assert_mean_matches(found, float(row["own_mc_value"]), max_relative_standard_error=6e-3, model_tolerance=3e-3)
    assert found.mean() < 0.95 * float(row["own_mc_value"])


def test_above_a_lambertian_bottom():
    """Setup: problem 6, Petzold's particle with albedo 0.2 over a bottom of reflectance 0.5 at depth 5; 0.1 mm above
    it. Expected: nadir radiance R E_d / pi and upward scalar irradiance 2 R E_d; E_d that of problem 2, to the share
    of upwelling light that water and surface turn back (1 %). Tolerance: Monte Carlo (1 %), model 3e-3. Negative
    control: reflectance 0.45."""
    bottom = {
        "name": "bottom", "kind": "rectangle", "width_m": 60.0, "height_m": 60.0, "reflectance": 0.5,
        "position_m": [0.0, 0.0, -5.0],
    }  # fmt: skip
    found = measured(scene_of("2", 0.2, bodies=(bottom,)), 5.0 - 1e-4, 60_000, peak=petzold("average"))
    down = found["Ed"].mean()
    key = ("2", "0.2", "5", "Ed")
    in_deep_water = next(r for r in ROWS if (r["problem"], r["albedo"], r["tau"], r["quantity"]) == key)
    assert down == pytest.approx(float(in_deep_water["own_mc_value"]), rel=0.01)
    rule = {"max_relative_standard_error": 0.01, "model_tolerance": 5e-3}
    for name, factor in (("Lu", 1 / np.pi), ("Eou", 2.0)):
        assert_mean_matches(found[name], 0.5 * factor * down, **rule)
        with pytest.raises(AssertionError, match="biased"):
            assert_mean_matches(found[name], 0.45 * factor * down, **rule)
