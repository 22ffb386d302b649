"""Phase functions of any kind in the renderer: tables hold them, the plugin states and samples what they hold."""

import numpy as np
import pytest
from scipy import stats

from uwsim.optics import phase as phases
from uwsim.optics.phase_functions.fournier_forand import FournierForand
from uwsim.optics.phase_functions.henyey_greenstein import HenyeyGreenstein
from uwsim.optics.phase_functions.mixture import four_term
from uwsim.optics.phase_functions.petzold import WATERS, Tabulated, petzold
from uwsim.optics.phase_functions.rayleigh import Rayleigh
from uwsim.optics.spectrum import WAVELENGTHS_NM
from uwsim.render import phase_tables

COUNT = 1_000_000
CHOSEN_NM = (410.0, 500.0, 555.0, 690.0)
DIRECTION = np.array([0.36, 0.48, 0.8])

TERMS = {
    "rayleigh": Rayleigh(depolarisation=0.0),
    "sea water": Rayleigh(),
    "ff particles": FournierForand(n=1.10, mu=3.5835),
    "ff extreme": FournierForand(n=1.021, mu=3.0742),
    "hg forward": HenyeyGreenstein(0.95),
    "hg backward": HenyeyGreenstein(-0.6),
    "hg mirror": HenyeyGreenstein(-0.9),
    "four term": four_term("average"),
    **{f"petzold {water}": petzold(water) for water in WATERS},
}


@pytest.fixture(scope="module", autouse=True)
def _variant(llvm_spectral):
    pass


def alone(term) -> phases.PhaseMixture:
    return phases.PhaseMixture((term,), np.ones((1, len(WAVELENGTHS_NM))))


def coloured() -> phases.PhaseMixture:
    """Particles whose share rises with wavelength, two kinds of them, and molecules."""
    molecules = np.linspace(0.9, 0.1, len(WAVELENGTHS_NM))
    weights = np.stack([0.7 * (1 - molecules), molecules, 0.3 * (1 - molecules)])
    return phases.PhaseMixture((FournierForand(n=1.10, mu=3.5835), Rayleigh(), petzold("harbor")), weights)


def plugin(phase):
    import mitsuba as mi

    description = phase_tables.phase_description(mi, phase)
    assert description["type"] == "tabulated_mixture"
    return mi.load_dict(description)


def tabulated_plugin(term):
    """The tables of one term, also of those that have a plugin of their own."""
    if isinstance(term, HenyeyGreenstein):
        # an opposite lobe without any share: no longer a mixture of Henyey-Greenstein terms alone
        weights = np.stack([np.ones(len(WAVELENGTHS_NM)), np.zeros(len(WAVELENGTHS_NM))])
        return plugin(phases.PhaseMixture((term, Rayleigh()), weights))
    return plugin(alone(term))


def interaction(direction, wavelengths_nm=CHOSEN_NM):
    """A point in the medium that light travelling along `direction` has reached."""
    import drjit as dr
    import mitsuba as mi

    mei = dr.zeros(mi.MediumInteraction3f)
    mei.wavelengths = mi.Spectrum(*wavelengths_nm)
    mei.wi = -mi.Vector3f(*map(float, direction))
    mei.sh_frame = mi.Frame3f(mei.wi)
    return mei


def sampled(loaded, seed=5):
    """Return scattering angles (COUNT,) of directions drawn, weights (4, COUNT) and densities (COUNT,)."""
    import mitsuba as mi

    rng = np.random.default_rng(seed)
    first, x, y = (mi.Float(rng.random(COUNT).astype(np.float32)) for _ in range(3))
    wo, weight, pdf = loaded.sample(mi.PhaseFunctionContext(), interaction(DIRECTION), first, mi.Point2f(x, y))
    wo, ahead = wo.numpy().astype(float).T, DIRECTION.astype(np.float32).astype(float)
    angle = 2 * np.arctan2(np.linalg.norm(wo - ahead, axis=1), np.linalg.norm(wo + ahead, axis=1))
    return angle, weight.numpy(), pdf.numpy()


def directions(angles):
    return np.stack([np.sin(angles), 0 * angles, np.cos(angles)]).astype(np.float32)


def evaluated(loaded, angles):
    """Return the angles of single-precision directions, and value (4, n) and density (n,) there."""
    import mitsuba as mi

    wo = directions(angles)
    value, pdf = loaded.eval_pdf(mi.PhaseFunctionContext(), interaction((0.0, 0.0, 1.0)), mi.Vector3f(wo))
    across, along = np.abs(wo[0].astype(float)), wo[2].astype(float)
    return np.arctan2(across, along), value.numpy(), pdf.numpy()


def moments(left, right):
    """Integral over the sphere, mean cosine and backscatter fraction of a table."""
    s, width = phase_tables.edges()[0], phase_tables.widths()
    mass = 4 * np.pi * width * (left + right) / 2
    first = 4 * np.pi * width * (s[:-1] * (left + right) / 2 + width * (left / 6 + right / 3))
    middle = int(np.searchsorted(s, 0.5)) - 1
    part = (0.5 - s[middle]) / width[middle]
    nearer = 4 * np.pi * width[middle] * part * (left[middle] + part * (right - left)[middle] / 2)
    return mass.sum(), 1 - 2 * first.sum(), 1 - mass[:middle].sum() - nearer


@pytest.mark.parametrize("name", TERMS)
def test_a_table_keeps_the_moments(name):
    """Expected: integral 1, mean cosine and backscatter fraction of the phase function itself. Tolerance: 1e-7 (linear
    in the bin that holds 90 deg). Negative control: 0.1 % more at the left edges."""
    term = TERMS[name]
    truth = (1, term.mean_cosine, term.backscatter_fraction)
    left, right = phase_tables.tabulate(term)
    assert moments(left, right) == pytest.approx(truth, abs=1e-7)
    assert moments(1.001 * left, right) != pytest.approx(truth, abs=1e-7)


@pytest.mark.parametrize("name", TERMS)
def test_the_value_is_that_of_the_formula(name):
    """Setup: 400 angles from 1e-4 rad to pi. Expected: the density of the formula at the angle of the rounded
    direction. Tolerance: 1e-3 (linear between edges, kinks of tables). Negative control: 1 % more; and angles from the
    cosine, which in single precision cannot tell those below 3e-4 rad from 0."""
    term = TERMS[name]
    angles, value, pdf = evaluated(tabulated_plugin(term), np.geomspace(1e-4, np.pi, 400))
    truth = term.density(np.minimum(angles, np.pi))
    np.testing.assert_allclose(value, np.tile(truth, (4, 1)), rtol=1e-3)
    np.testing.assert_allclose(pdf, truth, rtol=1e-3)
    assert not np.allclose(value, 1.01 * truth, rtol=1e-3, atol=0)
    if name.startswith(("ff", "petzold")):
        cosines = np.clip(directions(angles)[2].astype(float), -1, 1 - 1e-9)
        assert not np.allclose(alone(term).density(cosines)[:, 0], truth, rtol=1e-3, atol=0)


def chi_square_p(term, angles):
    """p value of sampled angles in 60 bins from 1e-5 rad (below it, directions are too coarse), and below and above."""
    edges = np.concatenate([[0], np.geomspace(1e-5, 0.3, 35), np.linspace(0.4, np.pi - 0.05, 25), [np.pi]])
    cdf = term.cdf(edges)
    kept = [0]
    for i in range(1, len(edges)):  # bins of at least 20 expected
        if min(cdf[i] - cdf[kept[-1]], 1 - cdf[i]) * COUNT >= 20:
            kept.append(i)
    edges = np.append(edges[kept], np.pi)
    found, expected = np.histogram(np.minimum(angles, np.pi), edges)[0], np.diff(term.cdf(edges)) * COUNT
    return stats.chisquare(found, expected / expected.sum() * found.sum()).pvalue


def altered(term):
    match term:
        case FournierForand():
            return FournierForand(n=term.n, mu=term.mu + 0.01)
        case Tabulated():
            return Tabulated(term.angles_rad, term.vsf * term.angles_rad**0.02)
        case Rayleigh():
            return HenyeyGreenstein(0.01)
        case HenyeyGreenstein():
            return HenyeyGreenstein(term.g * 0.99)
    return four_term("harbor")


@pytest.mark.parametrize("name", TERMS)
def test_sampling_follows_the_density(name):
    """Setup: a million directions. Expected: chi-square against the CDF of the formula at p > 1e-4; weight 1. Negative
    control: against another parameter they fail."""
    angles, weights, _ = sampled(tabulated_plugin(TERMS[name]))
    np.testing.assert_allclose(weights, 1, atol=1e-5)
    assert chi_square_p(TERMS[name], angles) > 1e-4
    assert chi_square_p(altered(TERMS[name]), angles) < 1e-4


def at_wavelengths(phase, angles):
    """The phase function at CHOSEN_NM, (4, n), shares interpolated."""
    density = phase.density_at(angles)
    return np.stack([[np.interp(nm, WAVELENGTHS_NM, row) for row in density] for nm in CHOSEN_NM])


def test_shares_depend_on_wavelength():
    """Setup: three terms, four wavelengths. Expected: the value at each wavelength is the mixture's, the density is
    their mean, and the samples follow it: chi-square, and weights that average to 1 at each wavelength. Tolerance:
    1e-3; Monte Carlo at 4 standard errors. Negative control: the shares of another wavelength."""
    phase = coloured()
    loaded = plugin(phase)
    angles, value, pdf = evaluated(loaded, np.geomspace(1e-4, 3.1, 200))
    truth = at_wavelengths(phase, angles)
    np.testing.assert_allclose(value, truth, rtol=1e-3)
    np.testing.assert_allclose(pdf, truth.mean(axis=0), rtol=1e-3)
    assert not np.allclose(value[0], truth[1], rtol=1e-3, atol=0)
    assert loaded.terms == 2  # the two kinds of particles are in one proportion throughout

    shares = [float(np.mean(np.interp(CHOSEN_NM, WAVELENGTHS_NM, row))) for row in phase.weights]
    drawn, weights, _ = sampled(loaded)
    mean = phases.Mixture(phase.terms, tuple(shares))
    assert chi_square_p(mean, drawn) > 1e-4
    other = phases.Mixture(phase.terms, (shares[0] + 0.01, shares[1] - 0.01, shares[2]))
    assert chi_square_p(other, drawn) < 1e-4
    error = weights.std(axis=1) / np.sqrt(COUNT)
    assert np.all(np.abs(weights.mean(axis=1) - 1) < 4 * error) and error.max() < 1e-3


def test_another_phase_function_does_not_recompile():
    """Setup: the same drawing and evaluation with other parameters. Expected: the same kernels.
    Negative control: another number of terms has others."""
    import drjit as dr
    import mitsuba as mi

    def kernels(phase):
        loaded = plugin(phase)
        rng = mi.PCG32(1024)
        numbers = rng.next_float32(), mi.Point2f(rng.next_float32(), rng.next_float32())
        dr.eval(numbers)
        mei = interaction(DIRECTION)
        dr.make_opaque(mei)
        dr.kernel_history_clear()
        wo, weight, _ = loaded.sample(mi.PhaseFunctionContext(), mei, *numbers)
        dr.eval(wo, weight, loaded.eval_pdf(mi.PhaseFunctionContext(), mei, wo))
        return {entry["hash"] for entry in dr.kernel_history([dr.KernelType.JIT])}

    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        first = kernels(alone(FournierForand(n=1.10, mu=3.5835)))
        assert first and kernels(alone(FournierForand(n=1.05, mu=3.3))) == first
        assert kernels(alone(petzold("clear"))) == first
        assert not kernels(coloured()) & first


@pytest.mark.parametrize("name", ["ff particles", "petzold clear", "rayleigh"])
def test_angles_past_a_lamp_follow_the_phase_function(name):
    """Expected: the share of scattering angles beyond 0.1, 1 and 2 rad among those beyond 0.01 rad is the integral of p
    over the angle. Tolerance: 1 % (piecewise constant). Negative control: the supplement of the angles."""
    import mitsuba as mi

    from uwsim.render.angles import scattering_tables

    term, angles = TERMS[name], np.array([0.01, 0.1, 1.0, 2.0])
    along, _ = scattering_tables(alone(term))
    grid = np.geomspace(0.01, np.pi, 100_001)
    middle, step = (grid[1:] + grid[:-1]) / 2, np.diff(grid)
    truth = np.array([np.sum((term.density(middle) * step)[middle > angle]) for angle in angles])
    beyond = along.mass_beyond(mi.Float(angles.astype(np.float32))).numpy()
    assert beyond / beyond[0] == pytest.approx(truth / truth[0], rel=0.01)
    if name != "rayleigh":
        assert (beyond / beyond[0])[2] != pytest.approx(1 - (truth / truth[0])[2], rel=0.01)


def test_bad_phase_functions_are_refused():
    import mitsuba as mi

    from uwsim.render.shapes import tensor

    class TooMuch(Rayleigh):
        def cdf(self, angle_rad):
            return 1.01 * super().cdf(angle_rad)

    with pytest.raises(ValueError, match="TooMuch: .* integral 1"):
        phase_tables.tabulate(TooMuch())

    description = phase_tables.phase_description(mi, alone(Rayleigh()))
    with pytest.raises(Exception, match=r"allowed: \(k, BINS\)"):
        mi.load_dict(description | {"left": tensor(mi, np.ones((1, 7)))})
