"""Single-scattered light of a point lamp against a reference quadrature."""

import math

import numpy as np
import pytest
from scipy import integrate

from tests.references.tables import read_table
from uwsim.optics import airlight
from uwsim.optics.phase import henyey_greenstein

# printed digits of the reference: 9 significant
DIGITS = 6e-9


def fournier_forand(cosine, n=1.10, mu=3.5835):
    """Return the phase function of Fournier & Jonasz 1999, Proc. SPIE 3761:62, for a power law of particles."""
    nu, sine_square = (3 - mu) / 2, (1 - cosine) / 2
    delta = 4 * sine_square / (3 * (n - 1) ** 2)
    back = 4 / (3 * (n - 1) ** 2)
    power = delta**nu
    bracket = nu * (1 - delta) - (1 - power) + (delta * (1 - power) - nu * (1 - delta)) / sine_square
    forward = bracket / (4 * np.pi * (1 - delta) ** 2 * power)
    return forward + (1 - back**nu) * (3 * cosine**2 - 1) / (16 * np.pi * (back - 1) * back**nu)


PHASES = {
    "L_isotropic": lambda cosine: np.full_like(cosine, 1 / (4 * np.pi)),
    "L_rayleigh": lambda cosine: 3 / (16 * np.pi) * (1 + cosine**2),
    "L_HG0.75": lambda cosine: henyey_greenstein(cosine, g=0.75),
    "L_HG0.924": lambda cosine: henyey_greenstein(cosine, g=0.924),
    "L_FF_n1.10_mu3.5835": fournier_forand,
}
KEYS = {"lamp_offset_m": "lamp_offset_h_m", "path_m": "path_D_m"}


def arguments(row):
    named = {name: float(row[key]) for name, key in KEYS.items()}
    return named | {"scattering_per_m": float(row["b_per_m"]), "attenuation_per_m": float(row["c_per_m"])}


@pytest.mark.parametrize("name", PHASES)
@pytest.mark.parametrize("row", read_table("oracle_airlight_point_source"), ids=lambda row: row["path_D_m"])
def test_airlight_agrees_with_the_reference(row, name):
    """Setup: isotropic lamp of 1 W/sr beside the camera, homogeneous water. Expected: reference table.
    Tolerance: printed digits. Negative control: light towards the lamp's far side, the angle's supplement."""
    found = airlight.airlight(**arguments(row), phase=PHASES[name])
    assert found == pytest.approx(float(row[name]), rel=DIGITS)
    turned = airlight.airlight(**arguments(row), phase=lambda cosine: PHASES[name](-cosine))
    if name not in ("L_isotropic", "L_rayleigh"):
        assert turned != pytest.approx(float(row[name]), rel=0.5)


@pytest.mark.parametrize("row", read_table("oracle_airlight_point_source"), ids=lambda row: row["path_D_m"])
def test_closed_form_of_isotropic_scattering(row):
    """Expected: Sun et al. 2005 equals the quadrature. Tolerance: printed digits. Negative control: c 1 % off."""
    truth = float(row["L_isotropic_Sun2005_F"])
    assert airlight.airlight_isotropic_sun2005(**arguments(row)) == pytest.approx(truth, rel=DIGITS)
    wrong = arguments(row) | {"attenuation_per_m": 1.01 * float(row["c_per_m"])}
    assert airlight.airlight_isotropic_sun2005(**wrong) != pytest.approx(truth, rel=1e-3)


def test_lamp_at_the_camera():
    """Expected: exponential integrals equal quadrature. Tolerance: 1e-9 (quadrature)."""
    truth, _ = integrate.quad(lambda s: 0.3 * 0.02 * math.exp(-2 * 0.5 * s) / s**2, 0.1, 3.0, epsrel=1e-12)
    named = {"start_m": 0.1, "path_m": 3.0, "scattering_per_m": 0.3, "phase_at_180_per_sr": 0.02}
    assert airlight.airlight_colocated(**named, attenuation_per_m=0.5) == pytest.approx(truth, rel=1e-9)
    assert airlight.airlight_colocated(**named, attenuation_per_m=1.0) < 0.95 * truth  # negative control
    clear = airlight.airlight_colocated(**(named | {"scattering_per_m": 0.0}), attenuation_per_m=0.0)
    assert clear == 0


@pytest.mark.parametrize("ahead_m", [0.4, -0.3])
def test_a_lamp_ahead_of_or_behind_the_camera(ahead_m):
    """Expected: adaptive quadrature along the ray, the scattering angle from lamp, point and camera. Tolerance: 1e-9
    (quadrature). Negative control: the lamp beside the camera, or as far on the other side."""
    lamp, path = np.array([0.2, ahead_m]), 1.5

    def scattered(s):
        to_point = np.array([0.0, s]) - lamp
        r = math.hypot(*to_point)
        return 0.3 * henyey_greenstein(-to_point[1] / r, g=0.75) * math.exp(-0.5 * (s + r)) / r**2

    truth, _ = integrate.quad(scattered, 0, path, epsrel=1e-12, limit=200)
    named = {"lamp_offset_m": 0.2, "path_m": path, "scattering_per_m": 0.3, "attenuation_per_m": 0.5}
    found, *wrong = (
        airlight.airlight(**named, phase=PHASES["L_HG0.75"], lamp_ahead_m=z) for z in (ahead_m, 0.0, -ahead_m)
    )
    assert found == pytest.approx(truth, rel=1e-9)
    assert all(abs(value / truth - 1) > 0.1 for value in wrong)


def test_saturation_is_set_by_the_lamps_offset():
    """Expected: L(d)/L(inf) = 0.65, 0.89, 0.97 at 0.2, 0.5, 1 m for h = 0.2 m, c = 0.5 /m and Fournier-Forand.
    Tolerance: printed digits. Negative control: 1 - exp(-c d) of eq. 2.65 is 0.10, 0.22, 0.39."""
    water = {"lamp_offset_m": 0.2, "scattering_per_m": 0.3, "attenuation_per_m": 0.5}
    phase = PHASES["L_FF_n1.10_mu3.5835"]
    distance = np.array([0.2, 0.5, 1.0])
    share = np.array([airlight.airlight(**water, path_m=d, phase=phase) for d in distance])
    share /= airlight.airlight(**water, path_m=60.0, phase=phase)
    np.testing.assert_allclose(share, [0.65, 0.89, 0.97], atol=0.0051)
    assert np.all(share - (1 - np.exp(-0.5 * distance)) > 0.5)


def test_bad_input_is_refused():
    good = {"lamp_offset_m": 0.2, "path_m": 1.0, "scattering_per_m": 0.3, "attenuation_per_m": 0.5}
    for wrong in ({"lamp_offset_m": 0.0}, {"path_m": -1.0}, {"scattering_per_m": -0.1}, {"attenuation_per_m": 0.2}):
        with pytest.raises(ValueError, match=f"airlight {next(iter(wrong))}.*: got .*, allowed: "):
            airlight.airlight(**(good | wrong), phase=PHASES["L_isotropic"])
