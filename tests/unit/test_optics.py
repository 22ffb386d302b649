"""Optics: spectra are never extrapolated, waters have the attenuation of their names, energy is kept."""

import numpy as np
import pytest

from uwsim.camera import port
from uwsim.camera.flat_port import FlatPort
from uwsim.optics import airlight, beam_profile, lamp, lamp_array, natural_light, phase, sources
from uwsim.optics.spectrum import WAVELENGTHS_NM, band_mean, on_grid
from uwsim.optics.water import named_water, water_type, water_type_names
from uwsim.optics.window import DomeWindow

GREEN = int(np.flatnonzero(WAVELENGTHS_NM == 550)[0])


def test_a_table_is_interpolated_on_the_grid():
    assert on_grid([390, 710], [0.39, 0.71], where="t") == pytest.approx(WAVELENGTHS_NM / 1000, rel=1e-12)


@pytest.mark.parametrize(
    ("wavelengths", "values", "message"),
    [
        ([405, 700], [1, 1], "405-700 nm, needed: 400-700 nm"),
        ([400, 699], [1, 1], "no extrapolation"),
        ([400, 500, 500, 700], [1, 1, 1, 1], "increase"),
        ([400, 700], [1, np.nan], "finite"),
        ([400, 700], [1, 1, 1], "2 wavelengths and 3 values"),
        ([400], [1], "at least 2"),
    ],
)
def test_a_table_that_does_not_reach_is_refused(wavelengths, values, message):
    with pytest.raises(ValueError, match=message):
        on_grid(wavelengths, values, where="t")


def test_a_band_mean_weights():
    weights = np.stack([np.ones(61), (WAVELENGTHS_NM >= 600).astype(float)], axis=-1)
    mean = band_mean(WAVELENGTHS_NM, weights)
    assert mean[0] == pytest.approx(550, abs=1e-9)
    assert 645 < mean[1] < 651


@pytest.mark.parametrize(
    ("name", "attenuation_per_m"), [("tank_clear", 0.2), ("tank_low", 1), ("tank_medium", 3), ("tank_high", 6)]
)
def test_tank_waters_have_the_attenuation_they_state(name, attenuation_per_m):
    assert named_water(name).attenuation[GREEN] == pytest.approx(attenuation_per_m, abs=1e-3)


def test_every_water_with_particles_attenuates_and_particles_add_to_the_water_itself():
    # measured waters have no particles of their own to multiply
    names = [name for name in water_type_names() if water_type(name).particles is not None]
    assert len(names) >= 4
    for name in names:
        none, one, two = (named_water(name, particle_factor=factor) for factor in (0, 1, 2))
        assert np.all(one.absorption > 0) and np.all(one.scattering > 0)
        assert two.attenuation - one.attenuation == pytest.approx(one.attenuation - none.attenuation, rel=1e-9)
        assert np.all(one.single_scattering_albedo < 1)
        # pure water absorbs red most: 0.6 /m at 700 nm
        assert none.absorption[-1] == pytest.approx(0.62, abs=0.03)
        assert none.absorption[-1] > 20 * none.absorption[GREEN - 10]


def solid_angle(density: np.ndarray, cosines: np.ndarray) -> np.ndarray:
    return 2 * np.pi * np.trapezoid(density, cosines, axis=0)


def cosines() -> np.ndarray:
    """Cosines that crowd where a phase function peaks."""
    angles = np.geomspace(1e-6, np.pi, 40001)
    return np.cos(np.concatenate([[0.0], angles]))[::-1]


@pytest.mark.parametrize("name", ["tank_clear", "tank_high"])
def test_mixtures_of_phase_functions_integrate_to_one(name):
    mixture, mu = named_water(name).phase, cosines()
    density = mixture.density(mu)
    assert solid_angle(density, mu) == pytest.approx(np.ones(61), abs=1e-4)
    assert solid_angle(density * mu[:, None], mu) == pytest.approx(mixture.mean_cosine, abs=1e-4)
    assert np.all((mixture.mean_cosine > 0.8) & (mixture.mean_cosine < 0.95))


def test_phase_functions_mix_in_proportion_to_scattering():
    forward, backward = phase.constant([0.9], [1.0]), phase.constant([-0.5], [1.0])
    mixed = phase.mix([(np.full(61, 3.0), forward), (np.full(61, 1.0), backward)])
    assert mixed.mean_cosine == pytest.approx(np.full(61, 0.75 * 0.9 - 0.25 * 0.5))
    with pytest.raises(ValueError, match="between -1 and 1"):
        phase.constant([1.0], [1.0])
    with pytest.raises(ValueError, match="sum to 1"):
        phase.constant([0.5, 0.1], [0.5, 0.6])


def test_molecules_scatter_like_one_plus_cosine_squared():
    mu = np.linspace(-1, 1, 201)
    shape = 1 + 0.925 * mu**2
    shape /= 2 * np.pi * np.trapezoid(shape, mu)
    assert phase.molecular().density(mu)[:, 0] == pytest.approx(shape, rel=0.047)  # as its docstring states
    assert phase.constant([0.32, -0.32], [0.5, 0.5]).density(mu)[:, 0] != pytest.approx(shape, rel=0.047)


@pytest.mark.parametrize("half_angle_deg", [5, 35, 60, 85])
def test_a_lamps_flux_integrates_back(half_angle_deg):
    profile = lamp.profile_from_half_angle(half_angle_deg=half_angle_deg)
    intensity = lamp.intensity_from_flux(radiant_flux_w=7.0, profile=profile)
    angles = np.radians(lamp.PROFILE_ANGLES_DEG)
    assert intensity * 2 * np.pi * np.trapezoid(profile * np.sin(angles), angles) == pytest.approx(7.0, rel=1e-12)
    # in closed form I_0 = (m + 1) flux / 2 pi; the table is a trapezium rule on 0.1 degrees
    order = lamp.lambertian_order(half_angle_deg=half_angle_deg)
    assert intensity == pytest.approx((order + 1) * 7.0 / (2 * np.pi), rel=2e-4)
    assert np.interp(half_angle_deg, lamp.PROFILE_ANGLES_DEG, profile) == pytest.approx(0.5, abs=1e-3)
    assert np.all(profile[lamp.PROFILE_ANGLES_DEG > 90] == 0)


def test_a_measured_beam_is_relative_to_its_axis():
    profile = lamp.profile_from_table(angles_deg=[0, 10, 20], values=[4, 4, 2])
    assert np.interp([0, 15, 19.9, 25], lamp.PROFILE_ANGLES_DEG, profile) == pytest.approx([1, 0.75, 0.505, 0])
    for angles, values in (([1, 10], [1, 1]), ([0, 0], [1, 1]), ([0, 10], [0, 1]), ([0, 10], [1, -1]), ([0], [1])):
        with pytest.raises(ValueError, match="beam table"):
            lamp.profile_from_table(angles_deg=angles, values=values)


def test_illuminants_have_unit_power_and_responses_unit_peak():
    assert np.trapezoid(sources.illuminant("LED-B3"), WAVELENGTHS_NM) == pytest.approx(1, rel=1e-12)
    response = sources.camera_response("Nikon 5100 (NPL)")
    assert response.shape == (61, 3) and response.max() == 1 and response.min() >= 0
    assert list(WAVELENGTHS_NM[response.argmax(axis=0)]) == sorted(WAVELENGTHS_NM[response.argmax(axis=0)])[::-1]
    with pytest.raises(ValueError, match="illuminant: got 'LED-B9', allowed: .*LED-B3"):
        sources.illuminant("LED-B9")


def test_the_colorchecker_has_its_grey_row_last():
    patches = sources.colorchecker()
    assert len(patches) == sources.COLORCHECKER_ROWS * sources.COLORCHECKER_COLUMNS
    means = [reflectance.mean() for _, reflectance in patches[18:]]
    assert means == sorted(means, reverse=True) and means[0] > 0.8 and means[-1] < 0.05


WATER_M = {"path_m": 1.0, "scattering_per_m": 0.1, "attenuation_per_m": 0.2}
BEAM = beam_profile.Beam(1.0, beam_profile.from_table(angles_deg=[0, 60], values=[1, 1]))
WINDOW = FlatPort(gap_m=0.01, thickness_m=0.01, n_glass=1.5, n_water=1.34)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (
            lambda: airlight.airlight(lamp_offset_m=0.1, phase=np.ones_like, lamp_ahead_m=np.nan, **WATER_M),
            "airlight lamp_ahead_m: got nan, allowed: finite",
        ),
        (
            lambda: airlight.airlight_colocated(start_m=0.1, phase_at_180_per_sr=-1.0, **WATER_M),
            "airlight phase_at_180_per_sr: got -1, allowed: finite, at least 0",
        ),
        (
            lambda: DomeWindow(0.05, 0.005, n_glass=1.5, n_water=1.34, glass_absorption_per_m=-1),
            "dome window glass_absorption_per_m: got -1, allowed",
        ),
        (
            lambda: natural_light.upward_view(0.1, sky=lambda zenith: -np.ones_like(zenith), n_water=1.34),
            "sky radiance: got -1, allowed: finite, at least 0",
        ),
        (
            lambda: named_water("tank_low").volume_scattering(np.array([0.0, 1.1])),
            "water tank_low: cos_angle: got 1.1, allowed: finite, at least -1, at most 1$",
        ),
        (lambda: named_water("tank_low").volume_scattering(np.array([-1.1])), "cos_angle: got -1.1, allowed"),
        (lambda: named_water("tank_low", particle_factor=1.1e6), r"particle_factor is 1100000.0, allowed: .* 1e\+06$"),
        (lambda: named_water("tank_low", particle_factor=np.nan), "particle_factor is nan, allowed"),
        (lambda: lamp_array.ring(BEAM, count=np.inf, radius_m=0.1), "lamp array count: got inf, allowed: a whole"),
        (lambda: lamp_array.ring(BEAM, count=np.nan, radius_m=0.1), "lamp array count: got nan, allowed: a whole"),
        (lambda: lamp_array.ring(BEAM, count=0, radius_m=0.1), "lamp array count: got 0, allowed: a whole"),
        (
            lambda: port.project(np.ones((5, 2)), port=WINDOW, K=np.eye(3)),
            r"port points_camera_m: got shape \(5, 2\), allowed: \(..., 3\)$",
        ),
        (lambda: port.project(1.0, port=WINDOW, K=np.eye(3)), r"points_camera_m: got shape \(\), allowed"),
    ],
)
def test_numbers_out_of_range_are_refused_in_one_line(call, message):
    with pytest.raises(ValueError, match=message) as caught:
        call()
    assert "\n" not in str(caught.value)
