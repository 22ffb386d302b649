"""The plugin of Henyey-Greenstein mixtures samples what it states, and states what `uwsim.optics.phase` states."""

import numpy as np
import pytest
from scipy import stats

from uwsim.optics.phase_functions.henyey_greenstein import HenyeyGreenstein
from uwsim.optics.spectrum import WAVELENGTHS_NM
from uwsim.optics.water import named_water
from uwsim.render.phase_tables import phase_description

COUNT = 400_000


@pytest.fixture(scope="module", autouse=True)
def _variant(llvm_spectral):
    pass


@pytest.fixture(scope="module")
def phase():
    return named_water("tank_low").phase


def plugin(phase):
    import mitsuba as mi

    return mi.load_dict(phase_description(mi, phase))


def medium_interaction(wavelength_nm, direction):
    """A point in the medium that light travelling along `direction` has reached."""
    import drjit as dr
    import mitsuba as mi

    mei = dr.zeros(mi.MediumInteraction3f)
    mei.wavelengths = mi.Spectrum(wavelength_nm)
    mei.wi = -mi.Vector3f(*direction)
    mei.sh_frame = mi.Frame3f(mei.wi)
    return mei


def sampled_cosines(phase, wavelength_nm):
    import mitsuba as mi

    direction = (0.36, 0.48, 0.8)
    rng = np.random.default_rng(5)
    first, x, y = (mi.Float(rng.random(COUNT).astype(np.float32)) for _ in range(3))
    wo, weight, _ = plugin(phase).sample(
        mi.PhaseFunctionContext(), medium_interaction(wavelength_nm, direction), first, mi.Point2f(x, y)
    )
    assert np.allclose(weight.numpy(), 1, atol=1e-4)
    return np.array(direction) @ wo.numpy()


def expected_shares(phase, edges, wavelength_nm):
    """Share of the phase function between cosines, in closed form: the CDF of each Henyey-Greenstein term."""
    weights = phase.weights[:, list(WAVELENGTHS_NM).index(wavelength_nm)]
    cosines = [term.g for term in phase.terms]
    cdf = [(1 - g * g) / (2 * g) * (1 / np.sqrt(1 + g * g - 2 * g * edges) - 1 / (1 + g)) for g in cosines]
    return np.diff(weights @ np.array(cdf))


@pytest.mark.parametrize("wavelength_nm", [400.0, 550.0, 700.0])
def test_sampling_follows_the_density(phase, wavelength_nm):
    """Setup: 400,000 samples, 60 bins of equal probability. Expected: chi-square at p > 1e-4. Negative control: the
    sampled cosines fail against terms with g changed by 0.01."""
    cosines = sampled_cosines(phase, wavelength_nm)
    edges = np.unique(np.concatenate([[-1.0], np.quantile(cosines, np.linspace(0, 1, 61)[1:-1]), [1.0]]))
    found = np.histogram(np.clip(cosines, -1, 1), edges)[0]
    shares = expected_shares(phase, edges, wavelength_nm)
    assert stats.chisquare(found, shares / shares.sum() * COUNT).pvalue > 1e-4
    other = type(phase)(tuple(HenyeyGreenstein(max(term.g - 0.01, -0.99)) for term in phase.terms), phase.weights)
    shares = expected_shares(other, edges, wavelength_nm)
    assert stats.chisquare(found, shares / shares.sum() * COUNT).pvalue < 1e-4


def test_value_is_that_of_the_numpy_form(phase):
    """Setup: 200 angles from 0.1 to 180 deg at 550 nm. Expected: same density to 1e-3 (float32 at the forward peak)."""
    import mitsuba as mi

    angles = np.radians(np.geomspace(0.1, 180, 200))
    wo = mi.Vector3f(np.stack([np.sin(angles), 0 * angles, np.cos(angles)]).astype(np.float32))
    value, pdf = plugin(phase).eval_pdf(mi.PhaseFunctionContext(), medium_interaction(550.0, (0.0, 0.0, 1.0)), wo)
    cosines = wo.numpy()[2].astype(float)
    expected = phase.density(cosines)[:, list(WAVELENGTHS_NM).index(550.0)]
    np.testing.assert_allclose(value.numpy()[0], expected, rtol=1e-3)
    np.testing.assert_allclose(pdf.numpy(), expected, rtol=1e-3)
    assert not np.allclose(value.numpy()[0], expected * 1.01, rtol=1e-3)


def test_the_phase_function_is_normalised_and_forward(phase):
    cosines = 1 - np.concatenate([[0], np.geomspace(1e-9, 2, 20000)])
    integral = -2 * np.pi * np.trapezoid(phase.density(cosines), cosines, axis=0)
    np.testing.assert_allclose(integral, 1, rtol=2e-3)
    assert np.all(phase.mean_cosine > 0.85)
