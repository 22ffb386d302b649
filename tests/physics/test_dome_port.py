"""Camera behind a dome port.

Setup: f = 900 px, 1600 x 1200; dome of inner radius 50 mm, 6 mm of acrylic (n 1.49), water n 1.336; the pinhole in the
centre and beside it. Expected: exactly the pinhole in the centre; beside it Snell's law at every face (n r sin i is one
number per ray), a stationary optical path, pixel -> ray -> point -> pixel back to the same pixel, errors that vanish
with the decentring. Tolerance: round-off; paraxial formulas: model. Negative control: the pinhole.
"""

import time

import numpy as np
import pytest

from uwsim.camera import pinhole, refraction
from uwsim.camera import port as ports
from uwsim.camera.dome_port import DomePort
from uwsim.optics import fresnel

WIDTH_PX, HEIGHT_PX = 1600, 1200
K = np.array([[900.0, 0, 810], [0, 905.0, 590], [0, 0, 1]])
DOME = {"inner_radius_m": 0.05, "thickness_m": 0.006, "n_glass": 1.49, "n_water": 1.336}
SHIFTS = [(0, 0, 0.008), (0, 0, -0.008), (0.004, -0.003, 0.0), (-0.01, 0.02, -0.03), (0, 0.045, 0.0)]


def field_px(step: int = 25) -> np.ndarray:
    rows, columns = np.mgrid[0 : HEIGHT_PX + 1 : step, 0 : WIDTH_PX + 1 : step]
    return np.stack([columns, rows], axis=-1).astype(float)


def in_air(pixels: np.ndarray) -> np.ndarray:
    rays = np.concatenate([(pixels - K[:2, 2]) / K[[0, 1], [0, 1]], np.ones_like(pixels[..., :1])], axis=-1)
    return rays / np.linalg.norm(rays, axis=-1, keepdims=True)


def test_around_the_pinhole_a_dome_does_nothing():
    port = DomePort(**DOME)
    origins, directions = ports.rays(field_px(), port=port, K=K)
    assert directions == pytest.approx(in_air(field_px()), abs=1e-15)
    assert origins == pytest.approx(0.056 * directions, abs=1e-16)
    points = np.random.default_rng(0).uniform([-1, -1, 0.1], [1, 1, 20], (1000, 3))
    seen, status = ports.project(points, port=port, K=K)
    assert np.all(status == ports.Status.SEEN)
    assert np.abs(seen - pinhole.project(points, K)).max() < 1e-9
    assert ports.effective_focal_px(np.array([0.1, 1, np.inf]), port=port, focal_px=900) == pytest.approx([900] * 3)
    assert np.all(np.abs(ports.axis_crossing_m(in_air(field_px()), port=port)) < 1e-9)
    # negative control: 8 mm beside the centre
    beside = DomePort(**DOME, decentring_m=SHIFTS[0])
    assert np.abs(ports.project(points, port=beside, K=K)[0] - pinhole.project(points, K)).max() > 5


@pytest.mark.parametrize("shift", SHIFTS)
def test_snells_law_holds_at_both_faces(shift):
    port = DomePort(**DOME, decentring_m=shift)
    air = in_air(field_px())
    outer, water = port.water_rays(air)
    start = (np.zeros_like(air), air)
    inner, glass = refraction.leave_sphere(start, centre_m=-np.array(shift), radius_m=0.05, n_from=1.0, n_to=1.49)
    assert np.linalg.norm(inner + shift, axis=-1) == pytest.approx(np.full(air.shape[:2], 0.05), abs=1e-15)
    assert np.linalg.norm(outer + shift, axis=-1) == pytest.approx(np.full(air.shape[:2], 0.056), abs=1e-15)
    assert np.cross(outer - inner, glass) == pytest.approx(np.zeros(air.shape), abs=1e-15)
    # n r x d is the same vector in all three media
    vector = np.cross(np.array(shift), air)
    assert 1.49 * np.cross(inner + shift, glass) == pytest.approx(vector, abs=1e-15)
    assert 1.336 * np.cross(outer + shift, water) == pytest.approx(vector, abs=1e-15)
    assert np.all(np.sum(water * (outer + shift), axis=-1) > 0)
    # negative control: without refraction
    assert np.abs(1.336 * np.cross(outer + shift, air) - vector).max() > 1e-4


@pytest.mark.parametrize("shift", SHIFTS)
def test_the_optical_path_to_a_point_is_stationary(shift):
    port = DomePort(**DOME, decentring_m=shift)
    points = np.random.default_rng(0).uniform([-0.6, -0.5, 0.3], [0.6, 0.5, 2.0], (500, 3))
    air, _ = port.air_directions(points)
    start = (np.zeros_like(air), air)
    inner, _ = refraction.leave_sphere(start, centre_m=-np.array(shift), radius_m=0.05, n_from=1.0, n_to=1.49)
    outer, _ = port.water_rays(air)

    def path_m(inner, outer):
        pieces = [np.linalg.norm(x, axis=-1) for x in (inner, outer - inner, points - outer)]
        return pieces[0] + 1.49 * pieces[1] + 1.336 * pieces[2]

    def largest_slope(inner, outer):
        slopes = []
        for across in np.eye(3):
            turns = [
                [c * x - shift for c, x in ((1, _turned(inner + shift, s * across)), (1, outer + shift))]
                for s in (1e-6, -1e-6)
            ]
            slopes.append((path_m(*turns[0]) - path_m(*turns[1])) / 2e-6)
            turns = [(inner, _turned(outer + shift, s * across) - shift) for s in (1e-6, -1e-6)]
            slopes.append((path_m(*turns[0]) - path_m(*turns[1])) / 2e-6)
        return np.abs(slopes).max()

    assert largest_slope(inner, outer) < 1e-8
    # negative control: the straight line
    to = points / np.linalg.norm(points, axis=-1, keepdims=True)
    nowhere = {"centre_m": -np.array(shift), "n_from": 1.0, "n_to": 1.0}
    straight = [refraction.leave_sphere((0 * to, to), radius_m=radius, **nowhere)[0] for radius in (0.05, 0.056)]
    assert largest_slope(*straight) > 5e-4


def _turned(vectors: np.ndarray, by_rad: np.ndarray) -> np.ndarray:
    """Vectors (n, 3) turned by a tiny rotation vector at unchanged length."""
    moved = vectors + np.cross(by_rad, vectors)
    return moved * (np.linalg.norm(vectors, axis=-1) / np.linalg.norm(moved, axis=-1))[:, None]


@pytest.mark.parametrize("shift", SHIFTS)
@pytest.mark.parametrize("range_m", [0.2, 1.0, 20.0])
def test_pixel_to_ray_to_point_to_pixel(shift, range_m):
    port = DomePort(**DOME, decentring_m=shift)
    lens = (-0.12, 0.02, 4e-4, -7e-4, -0.001)
    origins, directions = ports.rays(field_px(), port=port, K=K, coefficients=lens)
    points = origins + range_m * directions
    seen, status = ports.project(points, port=port, K=K, coefficients=lens)
    assert np.all(status == ports.Status.SEEN)
    assert np.abs(seen - field_px()).max() < 1e-9
    # negative control: the dome taken for centred
    centred, _ = ports.project(points, port=DomePort(**DOME), K=K, coefficients=lens)
    assert np.nanmax(np.abs(centred - field_px())) > 3


def test_errors_vanish_with_the_decentring():
    points = 2.0 * in_air(field_px(50))
    errors = []
    for size in (1e-4, 1e-5, 1e-6):
        port = DomePort(**DOME, decentring_m=tuple(size * np.array([0.6, 0.0, 0.8])))
        errors.append(np.abs(ports.project(points, port=port, K=K)[0] - pinhole.project(points, K)).max())
    assert errors[0] == pytest.approx(10 * errors[1], rel=0.01)
    assert errors[1] == pytest.approx(10 * errors[2], rel=0.01)
    assert errors[2] < 0.01 < errors[0]


@pytest.mark.parametrize("along_m", [0.008, -0.008, 0.03, -0.03])
def test_paraxial_formulas_agree_with_rays_next_to_the_axis(along_m):
    port = DomePort(**DOME, decentring_m=(0, 0, along_m))
    # 1e-5 rad off the axis: model error of second order, 1e-9
    for distance in (0.1, 1.0, 20.0, 1e6):
        seen, _ = ports.project([1e-5 * distance, 0, distance], port=port, K=K)
        focal = (seen[0] - K[0, 2]) / 1e-5
        assert ports.effective_focal_px(distance, port=port, focal_px=900) == pytest.approx(focal, rel=1e-8)
    far = ports.effective_focal_px(np.inf, port=port, focal_px=900)
    assert far == pytest.approx(focal, rel=1e-6)
    # negative control: behind the centre a dome narrows the field, in front of it it widens it
    assert np.sign(far - 900) == np.sign(along_m) and abs(far - 900) > 10
    crossing = ports.axis_crossing_m(np.array([[1e-5, 0, 1.0], [0.0, 0, 1.0]]), port=port)
    assert crossing == pytest.approx(np.full(2, port.paraxial_crossing_m), abs=1e-9)
    assert np.isnan(port.paraxial_magnification(0.01))


@pytest.mark.parametrize("shift", SHIFTS)
def test_every_ray_meets_the_axis(shift):
    port = DomePort(**DOME, decentring_m=shift)
    origins, directions = ports.rays(field_px(), port=port, K=K)
    crossing = ports.axis_crossing_m(in_air(field_px()), port=port)
    back = (crossing[..., None] * port.axis - origins) / np.linalg.norm(origins, axis=-1, keepdims=True)
    assert np.abs(np.cross(back, directions)).max() < 1e-9
    assert np.ptp(crossing) > 1e-5


def test_the_transmittance_of_a_dome():
    centred = ports.transmittance(field_px(), port=DomePort(**DOME), K=K)
    normal = float(fresnel.slab(0.0, n_in=1.0, n_slab=1.49, n_out=1.336).transmittance)
    assert centred == pytest.approx(np.full(centred.shape, normal), rel=1e-12)
    tinted = DomePort(**DOME, glass_absorption_per_m=5.0)
    assert ports.transmittance(field_px(), port=tinted, K=K) == pytest.approx(centred * np.exp(-0.03), rel=1e-4)
    # a dome far larger than its glass is thick is a slab at the local angle
    huge = DomePort(**DOME | {"thickness_m": 1e-9}, decentring_m=(0, 0.045, 0.0))
    air = in_air(field_px())
    inner, _ = refraction.leave_sphere(
        (np.zeros_like(air), air), centre_m=np.array([0, -0.045, 0]), radius_m=0.05, n_from=1.0, n_to=1.0
    )
    cosine = np.sum(air * (inner + [0, 0.045, 0]), axis=-1) / 0.05
    slab = fresnel.slab(np.arccos(np.minimum(cosine, 1)), n_in=1.0, n_slab=1.49, n_out=1.336).transmittance
    assert huge.transmittance(air) == pytest.approx(slab, rel=1e-6)
    assert slab.min() < 0.95 * normal  # negative control: not that of normal incidence


def test_tinted_glass_dims_along_the_chord():
    """Setup: pinhole 45 mm beside the centre, glass and water of one index, so nothing is reflected behind the glass.
    Expected: exp(-alpha chord), the ray passing the centre at 45 mm / 1.49. Tolerance: round-off. Negative control: the
    thickness for the chord."""
    like = DOME | {"n_water": 1.49, "decentring_m": (0, 0.045, 0.0)}
    clear, tinted = (
        DomePort(**like, glass_absorption_per_m=alpha).transmittance(np.array([0.0, 0.0, 1.0])) for alpha in (0.0, 20.0)
    )
    passes_at = 0.045 / 1.49
    chord = np.sqrt(0.056**2 - passes_at**2) - np.sqrt(0.05**2 - passes_at**2)
    assert tinted / clear == pytest.approx(np.exp(-20 * chord), rel=1e-12)
    assert tinted / clear < 0.98 * np.exp(-20 * 0.006)


def test_a_dome_without_thickness_has_its_face_at_the_inner_radius():
    port = DomePort(**DOME | {"thickness_m": 0.0}, decentring_m=(0.01, 0, 0.02))
    origins, directions = ports.rays(field_px(), port=port, K=K)
    assert np.all(np.isfinite(origins))
    assert np.linalg.norm(origins + [0.01, 0, 0.02], axis=-1) == pytest.approx(np.full(origins.shape[:2], 0.05))
    assert np.abs(ports.project(origins + directions, port=port, K=K)[0] - field_px()).max() < 1e-9


def test_what_has_no_pixel_says_why():
    port = DomePort(**DOME, decentring_m=(0, 0, 0.01))
    points = [[0, 0, 0.0459], [0, 0, 0.0461], [0.0, np.inf, 1], [np.nan, 0, 0], [0, 0, -1.0]]
    pixels, status = ports.project(points, port=port, K=K)
    Status = ports.Status
    assert status.tolist() == [
        Status.NOT_IN_WATER, Status.SEEN, Status.NOT_IN_WATER, Status.NOT_IN_WATER, Status.NO_PIXEL
    ]  # fmt: skip
    assert np.array_equal(np.isfinite(pixels).all(axis=-1), status == Status.SEEN)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"inner_radius_m": 0.0}, "dome port decentring_m: got .* shorter than inner_radius_m"),
        ({"inner_radius_m": -1.0}, "dome port inner_radius_m: got -1, allowed: finite, at least 0"),
        ({"n_water": 0.5}, "dome port n_water: got 0.5, allowed: finite, at least 1"),
        ({"decentring_m": (0, 0, 0.05)}, "dome port decentring_m: got .* shorter than inner_radius_m"),
        ({"decentring_m": (0, np.nan, 0)}, "dome port decentring_m: got"),
    ],
)
def test_a_port_that_cannot_be_is_refused(change, message):
    with pytest.raises(ValueError, match=message):
        DomePort(**DOME | change)


def test_a_hundred_thousand_points_take_well_under_a_second():
    points = np.random.default_rng(0).uniform([-2, -2, 0.2], [2, 2, 20], (100_000, 3))
    port = DomePort(**DOME, decentring_m=(-0.01, 0.02, -0.03))
    start = time.process_time()
    ports.project(points, port=port, K=K)
    assert time.process_time() - start < 1.0  # 0.07 s on one core
