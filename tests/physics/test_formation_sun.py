"""The sun in a view: what bodies reflect and what the water scatters once, against quadrature along the rays."""

import dataclasses

import numpy as np
import pytest
from scipy import integrate

from tests.unit import formation_views as views
from uwsim.formation import as_printed, sunlight
from uwsim.formation.light import Daylight
from uwsim.formation.models import simplified

TOWARDS = np.array([0.48, 0.36, 0.8])
SUN = Daylight(towards_sun=TOWARDS, sun_irradiance=views.FLAT, sky_irradiance=0 * views.FLAT)
A, B, G = 0.2, 0.4, 0.75
C = A + B
VIEW = views.view(
    width_px=7, height_px=5, fov_deg=80.0, lamps=(), daylight=SUN,
    water=views.grey_water(absorption_per_m=A, scattering_per_m=B, g=G),
)  # fmt: skip
PIXELS = [(0, 0), (2, 3), (4, 6), (1, 2), (0, 6)]


def quadrature(view, pixel, *, end: float) -> float:
    """Sun scattered once on a ray: b p(angle) E exp(-c (s + depth(s) / mu))."""
    origin, direction = view.origins_m[pixel], view.directions[pixel]
    density = view.water.phase.density(np.array([direction @ TOWARDS]))[0, 0]
    depth = lambda s: -(origin + s * direction)[2]  # noqa: E731
    return integrate.quad(lambda s: B * density * np.exp(-C * (s + depth(s) / TOWARDS[2])), 0, end, epsrel=1e-10)[0]


def test_backscatter_of_the_sun():
    """Setup: grey water, a wall at 1 m, rays up and down. Expected: quadrature. Tolerance: 2e-4 (tables, 1e-4 each).
    Negative control: the printed form of eqs. 2.59-2.60."""
    found = sunlight.sun_backscatter(VIEW)
    truth = np.array([quadrature(VIEW, pixel, end=float(VIEW.range_m[pixel])) for pixel in PIXELS])
    np.testing.assert_allclose([found[pixel][1] for pixel in PIXELS], truth, rtol=2e-4)
    printed = as_printed.sun_backscatter(VIEW)
    assert np.all(np.abs([printed[pixel][1] / t - 1 for pixel, t in zip(PIXELS, truth, strict=True)]) > 0.05)


def test_without_a_body_rays_end_at_the_surface_or_never():
    """Expected: quadrature up to the surface for rays that rise, to 60 m for those that sink; along the horizontal
    b p E e^(-c z / mu) / c. Tolerance: 2e-4. Negative control: rays that rise, without their end."""
    view = dataclasses.replace(VIEW, range_m=np.full(VIEW.shape, np.inf, np.float32))
    found = sunlight.sun_backscatter(view)
    for pixel in PIXELS:
        up = view.directions[pixel][2]
        end = views.DEPTH_M / up if up > 0 else 60.0
        assert found[pixel][1] == pytest.approx(quadrature(view, pixel, end=min(end, 60.0)), rel=2e-4)
    assert quadrature(view, (0, 0), end=2 * views.DEPTH_M / view.directions[0, 0][2]) > 1.01 * found[0, 0, 1]
    level = view.directions[2, 3]
    density = view.water.phase.density(np.array([level @ TOWARDS]))[0, 0]
    expected = B * density * np.exp(-C * views.DEPTH_M / TOWARDS[2]) / C
    assert found[2, 3, 1] == pytest.approx(expected, rel=2e-3)


def test_a_ray_along_which_the_light_does_not_change():
    """Expected: looking along the sun's own direction, mirrored, the path of light stays the same: its value times the
    length. Tolerance: 2e-4."""
    directions = np.broadcast_to(TOWARDS, (*VIEW.shape, 3))
    view = dataclasses.replace(VIEW, directions=directions)
    found = sunlight.sun_backscatter(view)
    assert found[2, 3, 0] == pytest.approx(quadrature(view, (2, 3), end=float(view.range_m[2, 3])), rel=2e-4)


def test_direct_light_of_the_sun():
    """Expected: albedo / pi E cos(gamma) exp(-c (depth / mu + range)). Tolerance: 1e-4. Negative control: the vertical
    depth in place of the sun's path."""
    facing = -np.array([TOWARDS[0], TOWARDS[1], 0])
    turned = np.broadcast_to(-facing / np.linalg.norm(facing), (*VIEW.shape, 3)).astype(np.float32)
    view = dataclasses.replace(VIEW, normals=turned)
    found = simplified.layers(view)["direct"]
    depth = -view.points_m[..., 2]
    cosine = np.hypot(TOWARDS[0], TOWARDS[1])
    expected = 0.5 / np.pi * cosine * np.exp(-C * (depth / TOWARDS[2] + view.range_m))
    np.testing.assert_allclose(found[..., 0], expected, rtol=2e-4)
    vertical = 0.5 / np.pi * cosine * np.exp(-C * (depth + view.range_m))
    assert np.all(np.abs(vertical / found[..., 0] - 1) > 0.1)
    assert not sunlight.sun_direct(VIEW).any()  # the wall of VIEW turns its back to the sun
