"""Single-scattered light of lamps along the rays of a view, against quadrature ray by ray."""

import dataclasses

import numpy as np
import pytest
from scipy import integrate

from tests.unit import formation_views as views
from uwsim.formation import airlight
from uwsim.formation.bands import band_values
from uwsim.optics import airlight as oracle
from uwsim.optics import beam_profile, phase
from uwsim.optics.phase_functions.fournier_forand import FournierForand
from uwsim.optics.phase_functions.petzold import petzold
from uwsim.optics.water import Water, named_water
from uwsim.optics.window import DomeWindow, FlatWindow

WINDOW = FlatWindow(air_gap_m=0.01, thickness_m=0.006, n_glass=1.52, n_water=1.334, radius_m=0.012)
LAMPS = {
    "above": {},
    "close": {"position_m": (0.02, 0.0, 0.0)},
    "ahead": {"position_m": (0.3, 0.1, 0.4)},
    "behind": {"position_m": (-0.1, 0.0, -0.3)},
    "window with an edge": {"window": WINDOW, "position_m": (0.1, 0.0, 0.0)},
    "window ahead of the camera": {"window": WINDOW, "position_m": (0.15, 0.0, 0.3)},
    "dome": {"window": DomeWindow(0.02, 0.003, 1.52, 1.334, half_aperture_rad=0.8), "position_m": (0.1, 0.0, 0.0)},
    "table": {"profile": beam_profile.from_table(angles_deg=[0, 10, 20, 30], values=[1.0, 0.8, 0.3, 0.0])},
}
FUNCTIONS = {
    "isotropic": phase.constant([0.0], [1.0]),
    "henyey_greenstein": phase.constant([0.75], [1.0]),
    "fournier_forand": phase.grey(FournierForand(n=1.10, mu=3.5835)),
    "petzold": phase.grey(petzold("average")),
}
B, C = 0.3, 0.5


def water_of(function) -> Water:
    return Water("grey", (C - B) * views.FLAT, B * views.FLAT, function)


def quadrature(view, lamp, pixel) -> float:
    """Light of one ray relative to the lamp's spectrum, in grey water: b p(angle) E exp(-c (s + path)) by `quad`."""
    origin, direction = view.origins_m[pixel], view.directions[pixel]

    def scattered(s):
        came = lamp.arriving(origin + s * direction)
        density = view.water.phase.density(np.array([came.towards @ direction]))[0, 0]
        return float(B * density * came.irradiance_per_intensity * np.exp(-C * (s + came.path_m)))

    # pieces: edges of beams are steps that quad must not be asked to find
    edges = np.concatenate([[0.0], np.geomspace(1e-3, float(view.range_m[pixel]), 50)])
    return sum(
        integrate.quad(scattered, a, b, epsrel=1e-5, limit=100)[0] for a, b in zip(edges, edges[1:], strict=False)
    )


@pytest.mark.parametrize("name", FUNCTIONS)
def test_isotropic_lamps_give_the_reference(name):
    """Setup: isotropic lamp 0.2 m beside the camera, the ray along the axis. Expected: `optics.airlight`. Tolerance:
    1e-3, as documented. Negative control: the printed saturation 1 - exp(-c R) of eq. 2.65."""
    lamp = views.lamp(position_m=(0.2, 0, 0), profile=views.isotropic)
    found, truth = [], []
    for wall_m in (0.2, 0.5, 1.0, 30.0):
        view = views.view(width_px=3, height_px=3, wall_m=wall_m, water=water_of(FUNCTIONS[name]), lamps=(lamp,))
        found.append(airlight.single(view, lamp)[1, 1] / band_values(view, lamp.spectrum))
        truth.append(
            oracle.airlight(
                lamp_offset_m=0.2, path_m=wall_m, scattering_per_m=B, attenuation_per_m=C,
                phase=lambda cosine: FUNCTIONS[name].density(cosine)[..., 0],
            )
        )  # fmt: skip
    np.testing.assert_allclose(found, np.repeat(truth, 3).reshape(4, 3), rtol=1e-3)
    printed = found[-1] * (1 - np.exp(-C * np.array([0.2, 0.5, 1.0])))[:, None]
    assert np.all(np.abs(printed / found[:3] - 1) > 0.3)


@pytest.mark.parametrize("name", LAMPS)
def test_lamps_of_all_kinds(name):
    """Setup: beams, windows with a narrow exit aperture and a lamp ahead of the camera; rays in the corners and the
    middle. Expected: adaptive quadrature along the ray. Tolerance: 1e-3 of the ray and of 2 % of the brightest ray.
    Negative control: the light taken as isotropic."""
    lamp = views.lamp(**LAMPS[name])
    view = views.view(width_px=7, height_px=5, water=water_of(FUNCTIONS["henyey_greenstein"]), lamps=(lamp,))
    pixels = [(0, 0), (2, 3), (4, 6)]
    relative = airlight.single(view, lamp) / band_values(view, lamp.spectrum)
    truth = np.array([quadrature(view, lamp, pixel) for pixel in pixels])
    found = np.array([relative[pixel] for pixel in pixels])
    np.testing.assert_allclose(found, truth[:, None] * np.ones(3), rtol=1e-3, atol=1e-3 * 0.02 * relative.max())
    other = airlight.single(view, dataclasses.replace(lamp, profile=views.isotropic))
    assert np.abs(other / airlight.single(view, lamp).clip(1e-30) - 1).max() > 0.05


@pytest.mark.parametrize("name", [*LAMPS, "in the picture"])
def test_interpolation_between_rays(name):
    """Setup: a relief whose range jumps from pixel to pixel. Expected: every ray integrated by itself, twice as finely.
    Tolerance: 1.5e-3 of a ray's light and of 2 % of a bright one's, 3e-3 where a narrow window stands ahead of the
    camera. Negative control: the ranges of the neighbours."""
    lamp = views.lamp(**LAMPS.get(name, {"position_m": (0.1, 0.05, 0.5)}))
    view = views.view(width_px=80, height_px=60, water=named_water("tank_low"), lamps=(lamp,))
    ranges = np.random.default_rng(3).uniform(0.3, 2.0, view.shape).astype(np.float32)
    view = dataclasses.replace(view, range_m=ranges)
    truth = airlight.single(view, lamp, stride_px=1, panels=96)
    found = airlight.single(view, lamp)
    worst = 3e-3 if name == "window ahead of the camera" else 1.5e-3
    allowed = worst * (truth + 0.02 * np.quantile(truth, 0.9, axis=(0, 1)))
    assert np.all(np.abs(found - truth) <= allowed)
    shifted = airlight.single(dataclasses.replace(view, range_m=np.roll(ranges, 1, axis=1)), lamp)
    assert np.any(np.abs(shifted - truth) > 10 * allowed)


def test_saturation_is_set_by_the_lamps_offset():
    """Expected: L(d)/L(inf) = 0.65, 0.89, 0.97 at 0.2, 0.5, 1 m for h = 0.2 m, c = 0.5 /m. Tolerance: printed digits.
    Negative control: 1 - exp(-c d) of eq. 2.65 is 0.10, 0.22, 0.39."""
    lamp = views.lamp(position_m=(0.2, 0, 0), profile=views.isotropic)
    water = water_of(FUNCTIONS["fournier_forand"])
    light = [
        airlight.single(views.view(width_px=3, height_px=3, wall_m=wall, water=water, lamps=(lamp,)), lamp)[1, 1, 1]
        for wall in (0.2, 0.5, 1.0, np.inf)
    ]
    share = np.array(light[:3]) / light[3]
    np.testing.assert_allclose(share, [0.65, 0.89, 0.97], atol=0.0051)
    assert np.all(share - (1 - np.exp(-0.5 * np.array([0.2, 0.5, 1.0]))) > 0.5)


def test_limits():
    """Expected: nothing without scattering, nor at range 0, nor on pixels without a ray; in thin water in proportion to
    b, whatever c. Tolerance: 1e-3 (first order in c R). Negative control: not in proportion in dense water."""
    lamp = views.lamp()
    still = views.grey_water(absorption_per_m=0.3, scattering_per_m=0.0)
    assert not airlight.single(views.view(water=still), lamp).any()
    view = views.view()
    assert not airlight.single(dataclasses.replace(view, range_m=np.zeros(view.shape)), lamp).any()
    blind = view.directions.copy()
    blind[:, :3] = np.nan
    partly = airlight.single(dataclasses.replace(view, directions=blind), lamp)
    assert not partly[:, :3].any()
    np.testing.assert_allclose(partly[:, 3:], airlight.single(view, lamp)[:, 3:], rtol=1e-3)
    thin, twice, dense, denser = (
        airlight.single(views.view(water=views.grey_water(absorption_per_m=0.0, scattering_per_m=b)), lamp)
        for b in (1e-4, 2e-4, 1.0, 2.0)
    )
    np.testing.assert_allclose(twice, 2 * thin, rtol=1e-3)
    assert np.abs(denser / (2 * dense) - 1).min() > 0.1


def test_three_bands_are_the_spectrum_in_grey_water():
    """Expected: no difference where c is the same at all wavelengths. Negative control: real water."""
    lamp = views.lamp()
    grey, real = views.view(), views.view(water=named_water("jerlov_IB"), wall_m=3.0)
    np.testing.assert_allclose(
        airlight.single(grey, lamp), airlight.single(grey, lamp, spectral=False), rtol=2e-5
    )  # fmt: skip
    assert np.abs(airlight.single(real, lamp, spectral=False) / airlight.single(real, lamp) - 1).max() > 0.003


def test_bad_numbers_are_refused():
    view = views.view()
    for wrong in ({"panels": 0}, {"stride_px": 0}):
        with pytest.raises(ValueError, match="airlight: got .*, allowed: at least 1"):
            airlight.single(view, view.lamps[0], **wrong)
