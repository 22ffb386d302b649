"""Camera behind a flat port.

Setup: f = 900 px, 1600 x 1200; air gap 30 mm, glass 10 mm (n 1.52), water n 1.336; upright and tilted by 12 degrees.
Expected: Snell's law at every face, an optical path that is stationary (Fermat), pixel -> ray -> point -> pixel back to
the same pixel, the paraxial formulas, the limits of thin glass and no gap, the transmittance of the slab.
Tolerance: round-off; paraxial formulas: model (second order in the angle, stated). Negative control: the pinhole.
"""

import time

import numpy as np
import pytest

from uwsim.camera import pinhole, port_plots, refraction
from uwsim.camera import port as ports
from uwsim.camera.flat_port import FlatPort, tilted_normal
from uwsim.optics import fresnel

WIDTH_PX, HEIGHT_PX = 1600, 1200
K = np.array([[900.0, 0, 810], [0, 905.0, 590], [0, 0, 1]])
MEDIA = {"n_glass": 1.52, "n_water": 1.336}
TILTED = tilted_normal(tilt_rad=np.radians(12), azimuth_rad=np.radians(130))
UPRIGHT_PORT = FlatPort(gap_m=0.03, thickness_m=0.01, **MEDIA)
TILTED_PORT = FlatPort(gap_m=0.03, thickness_m=0.01, normal=TILTED, **MEDIA)
BOTH = pytest.mark.parametrize("port", [UPRIGHT_PORT, TILTED_PORT], ids=["upright", "tilted"])
LENS = (-0.12, 0.02, 4e-4, -7e-4, -0.001)


def field_px(step: int = 25) -> np.ndarray:
    rows, columns = np.mgrid[0 : HEIGHT_PX + 1 : step, 0 : WIDTH_PX + 1 : step]
    return np.stack([columns, rows], axis=-1).astype(float)


def in_air(pixels: np.ndarray) -> np.ndarray:
    rays = np.concatenate([(pixels - K[:2, 2]) / K[[0, 1], [0, 1]], np.ones_like(pixels[..., :1])], axis=-1)
    return rays / np.linalg.norm(rays, axis=-1, keepdims=True)


def sines(directions: np.ndarray, normal: np.ndarray) -> np.ndarray:
    return np.linalg.norm(np.cross(directions, normal), axis=-1)


@BOTH
def test_snells_law_holds_at_both_faces(port):
    air = in_air(field_px())
    start = (np.zeros_like(air), air)
    inner, glass = refraction.cross_plane(start, normal=port.axis, offset_m=0.03, n_from=1.0, n_to=1.52)
    outer, water = ports.rays(field_px(), port=port, K=K)
    assert inner @ port.axis == pytest.approx(np.full(air.shape[:2], 0.03), abs=1e-15)
    assert outer @ port.axis == pytest.approx(np.full(air.shape[:2], 0.04), abs=1e-15)
    assert np.cross(outer - inner, glass) == pytest.approx(np.zeros(air.shape), abs=1e-15)
    invariant = sines(air, port.axis)
    assert 1.52 * sines(glass, port.axis) == pytest.approx(invariant, abs=1e-14)
    assert 1.336 * sines(water, port.axis) == pytest.approx(invariant, abs=1e-14)
    # one plane of refraction, and not mirrored to its other side
    side = np.cross(port.axis, air)
    assert np.sum(side * water, axis=-1) == pytest.approx(np.zeros(air.shape[:2]), abs=1e-14)
    assert np.all(np.sum(np.cross(port.axis, water) * side, axis=-1) >= 0)
    # negative control: without refraction the invariant is missed
    assert np.abs(1.336 * sines(air, port.axis) - invariant).max() > 0.1


def optical_path_m(points: np.ndarray, crossings: list[np.ndarray]) -> np.ndarray:
    stations = [np.zeros_like(points), *crossings, points]
    pieces = [np.linalg.norm(b - a, axis=-1) for a, b in zip(stations[:-1], stations[1:], strict=True)]
    return pieces[0] + 1.52 * pieces[1] + 1.336 * pieces[2]


def largest_slope(points: np.ndarray, crossings: list[np.ndarray], port: FlatPort) -> float:
    """Largest change of the optical path per shift of a crossing within its face."""
    across = np.cross(port.axis, [1.0, 0, 0])
    across /= np.linalg.norm(across)
    step = 1e-6
    slopes = []
    for index in range(2):
        for shift in (step * across, step * np.cross(port.axis, across)):
            there, back = list(crossings), list(crossings)
            there[index], back[index] = crossings[index] + shift, crossings[index] - shift
            slopes.append((optical_path_m(points, there) - optical_path_m(points, back)) / (2 * step))
    return np.abs(slopes).max()


@BOTH
def test_the_optical_path_to_a_point_is_stationary(port):
    points = np.random.default_rng(0).uniform([-0.6, -0.5, 0.3], [0.6, 0.5, 2.0], (500, 3))
    air, status = port.air_directions(points)
    assert np.all(status == ports.Status.SEEN)
    start = (np.zeros_like(air), air)
    inner, _ = refraction.cross_plane(start, normal=port.axis, offset_m=0.03, n_from=1.0, n_to=1.52)
    outer, _ = port.water_rays(air)
    # round-off of a 3 m path over a step of 2e-6 m
    assert largest_slope(points, [inner, outer], port) < 1e-8
    # negative control: the straight line
    straight = [points * (depth / (points @ port.axis))[:, None] for depth in (0.03, 0.04)]
    assert largest_slope(points, straight, port) > 0.1


@BOTH
@pytest.mark.parametrize("lens", [(), LENS], ids=["pinhole", "distorted"])
@pytest.mark.parametrize("range_m", [0.2, 1.0, 20.0])
def test_pixel_to_ray_to_point_to_pixel(port, lens, range_m):
    pixels = field_px()
    origins, directions = ports.rays(pixels, port=port, K=K, coefficients=lens)
    points = origins + range_m * directions
    seen, status = ports.project(points, port=port, K=K, coefficients=lens)
    assert np.all(status == ports.Status.SEEN)
    assert np.abs(seen - pixels).max() < 1e-9
    # negative control: the same lens without port and water
    assert np.nanmax(np.abs(pinhole.project(points, K) - pixels)) > 100


def test_the_focal_length_grows_to_that_of_water_far_away():
    assert ports.effective_focal_px(np.inf, port=UPRIGHT_PORT, focal_px=900) == pytest.approx(900 * 1.336, rel=1e-14)
    # 1e-4 rad off the axis: model error of second order, 1e-8
    far = np.array([[10.0, 0, 1e5], [0, 10.0, 1e5]])
    seen, _ = ports.project(far, port=UPRIGHT_PORT, K=K)
    focal = np.linalg.norm(seen - K[:2, 2], axis=-1) / 1e-4
    # at 1e5 m the camera is 9 mm further back than its pinhole: 1e-7
    assert focal == pytest.approx(1.336 * np.array([900.0, 905.0]), rel=2e-7)
    assert abs(focal[0] / 900 - 1) > 0.3  # negative control: the focal length in air


@pytest.mark.parametrize("range_m", [0.041, 0.1, 1.0, 20.0])
def test_small_things_appear_at_the_reduced_depth(range_m):
    # air + glass / 1.52 + water / 1.336, for points 1e-5 rad off the axis
    apparent = 0.03 + 0.01 / 1.52 + (range_m - 0.04) / 1.336
    point = np.array([1e-5 * range_m, 0, range_m])
    seen, _ = ports.project(point, port=UPRIGHT_PORT, K=K)
    assert seen[0] - K[0, 2] == pytest.approx(900 * point[0] / apparent, rel=1e-8)
    focal = ports.effective_focal_px(range_m, port=UPRIGHT_PORT, focal_px=900)
    assert focal == pytest.approx(900 * range_m / apparent, rel=1e-13)
    # negative control: the depth that is there
    assert abs(seen[0] - K[0, 2] - 900 * 1e-5) > 1e-5 * 900 * 0.003


def test_rays_do_not_meet_in_one_point():
    angle = np.radians([0.0, 0.001, 10, 20, 30, 40])
    directions = np.stack([np.sin(angle), 0 * angle, np.cos(angle)], axis=-1)
    crossing = ports.axis_crossing_m(directions, port=UPRIGHT_PORT)
    sine = np.sin(angle[2:])
    glass, water = np.arcsin(sine / 1.52), np.arcsin(sine / 1.336)
    by_hand = 0.04 - (0.03 * np.tan(angle[2:]) + 0.01 * np.tan(glass)) / np.tan(water)
    assert crossing[2:] == pytest.approx(by_hand, abs=1e-14)
    assert crossing[:2] == pytest.approx(np.full(2, 0.04 - 1.336 * (0.03 + 0.01 / 1.52)), abs=1e-9)
    assert np.all(np.diff(crossing[1:]) < 0) and crossing[-1] - crossing[0] < -0.005
    tilted = ports.axis_crossing_m(in_air(field_px()), port=TILTED_PORT)
    assert np.ptp(tilted) > 0.005
    # the axis is met: the ray from there runs through the origin on the outer face
    origins, water_directions = ports.rays(field_px(), port=TILTED_PORT, K=K)
    gap = np.cross(origins - tilted[..., None] * TILTED_PORT.axis, water_directions)
    assert np.abs(gap).max() < 1e-13


def test_without_gap_and_glass_there_is_one_centre():
    port = FlatPort(gap_m=0.0, thickness_m=0.0, **MEDIA)
    air = in_air(field_px())
    origins, water = port.water_rays(air)
    assert np.all(origins == 0)
    assert 1.336 * sines(water, port.axis) == pytest.approx(sines(air, port.axis), abs=1e-14)
    assert ports.axis_crossing_m(air, port=port) == pytest.approx(np.zeros(air.shape[:2]), abs=1e-15)
    assert port.paraxial_magnification(0.5) == pytest.approx(1.336)
    assert np.isnan(port.paraxial_magnification(0.0)) and np.isnan(UPRIGHT_PORT.paraxial_magnification(0.039))
    # a port that shrinks gets there in proportion
    points = 0.5 * water
    limit, _ = ports.project(points, port=port, K=K)
    errors = []
    for size in (1e-4, 1e-5):
        small = FlatPort(gap_m=size, thickness_m=size, **MEDIA)
        errors.append(np.abs(ports.project(points, port=small, K=K)[0] - limit).max())
    assert errors[0] == pytest.approx(10 * errors[1], rel=0.01)
    assert errors[1] < 0.02 and errors[0] > 0.1  # negative control: 0.1 mm is seen


def test_thin_glass_is_no_glass_and_glass_like_water_is_water():
    pixels = field_px()
    no_glass = FlatPort(gap_m=0.03, thickness_m=0.0, **MEDIA)
    other_index = FlatPort(gap_m=0.03, thickness_m=0.0, n_glass=1.9, n_water=1.336)
    like_water = FlatPort(gap_m=0.03, thickness_m=0.01, n_glass=1.336, n_water=1.336)
    origins, directions = ports.rays(pixels, port=no_glass, K=K)
    points = origins + 1.5 * directions
    for port in (no_glass, other_index, like_water):
        assert np.abs(ports.project(points, port=port, K=K)[0] - pixels).max() < 1e-9
    assert ports.rays(pixels, port=like_water, K=K)[1] == pytest.approx(directions, abs=1e-15)
    # negative control: glass of its own index is seen
    assert np.abs(ports.project(points, port=UPRIGHT_PORT, K=K)[0] - pixels).max() > 1


def test_equal_indices_are_the_pinhole():
    port = FlatPort(gap_m=0.03, thickness_m=0.01, n_air=1.336, n_glass=1.336, n_water=1.336, normal=TILTED)
    origins, directions = ports.rays(field_px(), port=port, K=K)
    assert directions == pytest.approx(in_air(field_px()), abs=1e-14)
    seen, _ = ports.project(origins + directions, port=port, K=K)
    assert np.abs(seen - pinhole.project(origins + directions, K)).max() < 1e-9


@BOTH
def test_the_transmittance_is_that_of_the_slab(port):
    air = in_air(field_px())
    angle = np.arccos(np.minimum(air @ port.axis, 1))
    expected = fresnel.slab(angle, n_in=1.0, n_slab=1.52, n_out=1.336).transmittance
    assert ports.transmittance(field_px(), port=port, K=K) == pytest.approx(expected, rel=1e-7)
    tinted = FlatPort(gap_m=0.03, thickness_m=0.01, normal=port.normal, glass_absorption_per_m=5.0, **MEDIA)
    passed = ports.transmittance(field_px(), port=tinted, K=K) / expected
    # twice reflected light is tinted more: below a part in 1e4
    assert passed == pytest.approx(np.exp(-0.05 / np.sqrt(1 - (np.sin(angle) / 1.52) ** 2)), rel=1e-4)
    assert np.ptp(expected) > 0.01  # negative control: not that of normal incidence everywhere


def test_the_transmittance_of_a_published_table():
    # BK7 (1.5168) and water 1.34 at 0, 20, 40, 60 and 80 degrees in air; printed digits
    port = FlatPort(gap_m=0.03, thickness_m=0.01, n_glass=1.5168, n_water=1.34)
    angle = np.radians([0, 20, 40, 60, 80])
    directions = np.stack([np.sin(angle), 0 * angle, np.cos(angle)], axis=-1)
    table = [0.954321, 0.954043, 0.948406, 0.904490, 0.608077]
    assert port.transmittance(directions) == pytest.approx(np.array(table), abs=6e-7)


def test_what_has_no_pixel_says_why():
    Status = ports.Status
    points = [[0, 0, 0.04], [0, 0, -1], [np.nan, 0, 1], [5, 0, 0.05], [0, 0, 1]]
    pixels, status = ports.project(points, port=UPRIGHT_PORT, K=K)
    assert status.tolist() == [Status.NOT_IN_WATER] * 3 + [Status.SEEN] * 2
    assert np.array_equal(np.isfinite(pixels).all(axis=-1), status == Status.SEEN)
    # no gap: the world is squeezed into a cone of 48.5 degrees
    no_gap = FlatPort(gap_m=0.0, thickness_m=0.0, **MEDIA)
    edge = np.tan(np.arcsin(1 / 1.336))
    _, status = ports.project([[0.99 * edge, 0, 1], [1.01 * edge, 0, 1]], port=no_gap, K=K)
    assert status.tolist() == [Status.SEEN, Status.NO_PATH]
    # a tilted port sees what lies beside the camera, the image does not
    steep = FlatPort(gap_m=0.03, thickness_m=0.01, normal=tilted_normal(tilt_rad=1.2), **MEDIA)
    pixels, status = ports.project([[3.0, 0, -1.0], [3.0, 0, 1.0]], port=steep, K=K)
    assert status.tolist() == [Status.NO_PIXEL, Status.SEEN] and np.all(np.isnan(pixels[0]))
    # beyond the fold of a lens
    _, status = ports.project([[1.0, 0, 1.0]], port=UPRIGHT_PORT, K=K, coefficients=(-0.5, 0, 0, 0))
    assert status.tolist() == [Status.NO_PIXEL]
    for towards in ([0, 0, -1.0], [1.0, 0, 0], [0, 0, 0]):
        assert np.all(np.isnan(UPRIGHT_PORT.water_rays(np.array(towards))))
        assert np.all(np.isnan(no_gap.water_rays(np.array(towards))))
        assert np.isnan(UPRIGHT_PORT.transmittance(np.array(towards)))


def test_total_reflection_gives_nan():
    angle = np.radians([10, 48, 49, 80])
    directions = np.stack([np.sin(angle), 0 * angle, np.cos(angle)], axis=-1)
    up = np.array([0, 0, 1.0])
    refracted = refraction.refract(directions, up, n_from=1.336, n_to=1.0)
    reflected = refraction.is_totally_reflected(directions, up, n_from=1.336, n_to=1.0)
    assert reflected.tolist() == [False, False, True, True]
    assert np.array_equal(np.isnan(refracted).all(axis=-1), reflected)
    # the other face of the normal gives the same
    assert refraction.refract(directions, -up, n_from=1.0, n_to=1.336) == pytest.approx(
        refraction.refract(directions, up, n_from=1.0, n_to=1.336)
    )


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"gap_m": -0.01}, "flat port gap_m: got -0.01, allowed: finite, at least 0"),
        ({"thickness_m": np.nan}, "flat port thickness_m: got nan"),
        ({"n_glass": 0.9}, "flat port n_glass: got 0.9, allowed: finite, at least 1"),
        ({"n_water": 1.0, "n_air": 1.1}, "flat port n_water: got 1, allowed: finite, at least 1.1"),
        ({"normal": (0, 0, 2.0)}, "flat port normal: got .* allowed: a unit vector"),
        ({"normal": (0, 0, -1.0)}, "flat port normal: got .* with z > 0"),
        ({"glass_absorption_per_m": -1.0}, "flat port glass_absorption_per_m: got -1"),
    ],
)
def test_a_port_that_cannot_be_is_refused(change, message):
    with pytest.raises(ValueError, match=message):
        FlatPort(**{"gap_m": 0.03, "thickness_m": 0.01, **MEDIA} | change)


def test_a_hundred_thousand_points_take_well_under_a_second():
    points = np.random.default_rng(0).uniform([-2, -2, 0.2], [2, 2, 20], (100_000, 3))
    start = time.process_time()
    ports.project(points, port=TILTED_PORT, K=K)
    assert time.process_time() - start < 1.0  # 0.05 s on one core


def test_the_figure_shows_what_a_pinhole_misses():
    figure = port_plots.flat_port_error_figure(port=UPRIGHT_PORT, K=K, width_px=WIDTH_PX, height_px=HEIGHT_PX)
    assert len(figure.axes) == 3
    pixels, common = field_px(100), {"port": UPRIGHT_PORT, "K": K}
    centre = UPRIGHT_PORT.paraxial_crossing_m * UPRIGHT_PORT.axis
    same = port_plots.central_error_px(pixels, range_m=1.0, fitted_range_m=1.0, centre_m=centre, **common)
    near = port_plots.central_error_px(pixels, range_m=0.2, fitted_range_m=1.0, centre_m=centre, **common)
    assert same.max() < 1e-9 and near.max() > 5
    no_port = FlatPort(gap_m=0.0, thickness_m=0.0, **MEDIA)
    near = port_plots.central_error_px(pixels, range_m=0.2, fitted_range_m=1.0, centre_m=np.zeros(3), port=no_port, K=K)
    assert near.max() < 1e-9
