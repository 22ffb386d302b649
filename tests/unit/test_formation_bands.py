"""Band values and path tables against plain sums over wavelengths."""

import numpy as np
import pytest

from tests.unit import formation_views as views
from uwsim.formation import bands
from uwsim.formation.bands import FINE_NM, PathTable, band_values
from uwsim.formation.scattering import ScatteringTable, groups
from uwsim.optics.spectrum import WAVELENGTHS_NM
from uwsim.optics.water import named_water, water_type_names

FINER_NM = np.linspace(400, 700, 30001)


def finely(*spectra):
    """Product of spectra, each linear between the nodes, on a hundred times finer grid."""
    return np.prod([np.interp(FINER_NM, WAVELENGTHS_NM, spectrum) for spectrum in spectra], axis=0)


def expected(view, spectra, path_m):
    """Band values by brute force: trapezoids of 0.01 nm."""
    response = np.stack([finely(band) for band in view.response.T], axis=-1)
    left = np.exp(-finely(view.water.attenuation) * path_m)
    values = np.trapezoid((finely(*spectra) * left)[:, None] * response, FINER_NM, axis=0)
    return values / np.trapezoid(response, FINER_NM, axis=0)


@pytest.mark.parametrize("name", water_type_names())
@pytest.mark.parametrize("kind", [np.float32, np.float64])
def test_a_table_is_the_sum_over_wavelengths(name, kind):
    """Expected: the sum over the fine wavelengths, up to an optical depth of 60. Tolerance: 1e-4, as documented.
    Negative control: the three-band form, which leaves out that c changes within a band."""
    view = views.view(water=named_water(name))
    spectra = np.stack([view.lamps[0].spectrum, view.water.scattering])
    path = np.concatenate([[0.0], np.geomspace(1e-4, 60 / view.water.attenuation.min(), 4001)])
    left = np.exp(-path[:, None] * bands.fine(view.water.attenuation))
    truth = left @ (np.prod(bands.fine(spectra), axis=0)[:, None] * view.weights)
    found = PathTable(view, spectra)(path.astype(kind))
    assert found.dtype == kind
    np.testing.assert_allclose(found, truth, rtol=1e-4)
    three = PathTable(view, spectra, spectral=False)(path.astype(kind))
    np.testing.assert_allclose(three[0], truth[0], rtol=1e-5)
    assert np.abs(three / truth - 1).max() > 0.01


@pytest.mark.parametrize("path_m", [0.0, 0.5, 4.0])
def test_band_values_are_integrals_of_linear_spectra(path_m):
    """Expected: the integral by trapezoids of 0.01 nm. Tolerance: 5e-5 (Simpson's rule on 2.5 nm). Negative control:
    trapezoids of 5 nm are off by 4e-4 or more in some band."""
    view = views.view(water=named_water("tank_low"))
    spectra = np.stack([view.lamps[0].spectrum, view.water.scattering])
    truth = expected(view, spectra, path_m)
    np.testing.assert_allclose(PathTable(view, spectra)(np.array(path_m)), truth, rtol=5e-5)
    coarse = np.prod(spectra, axis=0) * np.exp(-path_m * view.water.attenuation)
    trapezoid = np.trapezoid(coarse[:, None] * view.response, WAVELENGTHS_NM, axis=0)
    trapezoid /= np.trapezoid(view.response, WAVELENGTHS_NM, axis=0)
    assert np.abs(trapezoid / truth - 1).max() > 4e-4


def test_a_flat_spectrum_has_its_own_value_in_every_band():
    view = views.view()
    np.testing.assert_allclose(band_values(view, 2.5 * views.FLAT), 2.5, rtol=1e-12)
    assert len(FINE_NM) == 121


def test_water_without_attenuation_leaves_everything():
    view = views.view(water=views.grey_water(absorption_per_m=0, scattering_per_m=0))
    for spectral in (True, False):
        table = PathTable(view, views.FLAT, spectral=spectral)
        np.testing.assert_allclose(table(np.array([0.0, 1.0, 1e3, np.inf])), 1.0, rtol=1e-6)


def test_infinite_paths_leave_nothing():
    view = views.view(water=named_water("tank_low"))
    assert np.all(PathTable(view, views.FLAT)(np.array([np.inf])) < 1e-25)
    assert np.all(PathTable(view, views.FLAT, spectral=False)(np.array([np.inf])) == 0)


def test_three_bands_have_the_coefficients_of_the_frame():
    """Expected: the weighting of `water.bands` in frame.json, trapezoids of 5 nm. Tolerance: 2e-3 (that rule's own)."""
    view = views.view(water=named_water("tank_low"))
    weights = view.response * view.lamps[0].spectrum[:, None]
    total = np.trapezoid(weights, WAVELENGTHS_NM, axis=0)
    c = np.trapezoid(view.water.attenuation[:, None] * weights, WAVELENGTHS_NM, axis=0) / total
    np.testing.assert_allclose(view.band_attenuation, c, rtol=2e-3)


@pytest.mark.parametrize("name", ["tank_low", "jerlov_IB", "petzold_harbor"])
def test_scattering_is_b_times_the_phase_function(name):
    """Expected: spectrum x b p(angle) x exp(-c path) summed over wavelengths. Tolerance: 2e-4 (table, 1e-4, and shares
    of the terms linear between nodes). Negative control: the angle's supplement."""
    view = views.view(water=named_water(name))
    cosine, path = np.array([-1.0, -0.5, 0.0, 0.9]), np.array([0.3, 2.0, 1.0, 5.0])
    beta = bands.fine(view.water.volume_scattering(cosine).T.T)
    light = bands.fine(view.lamps[0].spectrum) * np.exp(-path[:, None] * bands.fine(view.water.attenuation))
    truth = (beta * light) @ view.weights
    table = ScatteringTable(view, view.lamps[0].spectrum)
    np.testing.assert_allclose(table(cosine, path), truth, rtol=2e-4)
    assert np.abs(table(-cosine, path) / truth - 1).max() > 0.5


def test_terms_with_the_same_colour_share_a_table():
    """Expected: particles (4 terms) and molecules (2 terms) make two groups that add up to the phase function."""
    phase = named_water("tank_low").phase
    found = groups(phase)
    assert len(found) == 2 < len(phase.terms)
    angle = np.array([0.3, 1.0, 3.0])
    total = sum(share * sum(weight * term.density(angle) for weight, term in parts)[:, None] for share, parts in found)
    np.testing.assert_allclose(total, phase.density_at(angle), rtol=1e-9)


def test_bad_spectra_are_refused():
    view = views.view()
    for wrong in (np.ones(60), np.ones((2, 2, 61)), -views.FLAT, np.full(61, np.nan)):
        with pytest.raises(ValueError, match="spectrum has shape .*, allowed: "):
            PathTable(view, wrong)
    with pytest.raises(ValueError, match="response .*, allowed: "):
        bands.band_weights(np.ones((61, 4)))
    with pytest.raises(ValueError, match="response: a band sees no light, allowed: "):
        bands.band_weights(np.stack([views.FLAT, views.FLAT, 0 * views.FLAT], axis=-1))
