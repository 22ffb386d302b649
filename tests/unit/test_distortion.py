"""Lens distortion against OpenCV (its pixels + 0.5), its inverse to 1e-12, and what lies beyond the fold."""

import cv2
import numpy as np
import pytest

from uwsim.camera import distortion, pinhole

K = np.array([[900.0, 0, 810], [0, 905.0, 590], [0, 0, 1]])
K_OPENCV = K - np.array([[0, 0, 0.5], [0, 0, 0.5], [0, 0, 0]])
LENSES = {
    "none": (),
    "barrel": (-0.28, 0.09, 3e-4, -5e-4),
    "pincushion": (0.15, 0.03, -1e-3, 2e-3, 0.01),
    "rational": (0.8, 0.3, 0.0002, 0.0003, 0.02, 1.1, 0.45, 0.02),
}
EACH = pytest.mark.parametrize("lens", LENSES.values(), ids=LENSES)


def field() -> np.ndarray:
    y, x = np.mgrid[-0.65:0.66:0.05, -0.85:0.86:0.05]
    return np.stack([x, y], axis=-1)


@EACH
def test_projection_is_opencvs_half_a_pixel_on(lens):
    flat = field().reshape(-1, 2)
    points = np.column_stack([flat, np.ones(len(flat))]) * 2.5
    theirs, _ = cv2.projectPoints(points, np.zeros(3), np.zeros(3), K_OPENCV, np.array(lens or [0.0] * 4))
    ours = distortion.project(points, K, coefficients=lens)
    assert np.abs(ours - (theirs[:, 0] + 0.5)).max() < 1e-9
    # negative control: without the coefficients, or with the tangential pair exchanged
    if lens:
        assert np.abs(pinhole.project(points, K) - ours).max() > 10
        exchanged = (*lens[:2], lens[3], lens[2], *lens[4:])
        assert np.abs(distortion.project(points, K, coefficients=exchanged) - ours).max() > 0.05


@EACH
def test_rays_are_opencvs(lens):
    pixels = np.random.default_rng(0).uniform([200, 150], [1400, 1050], (500, 2))
    criteria = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 500, 1e-14)
    undistort = getattr(cv2, "undistortPointsIter", cv2.undistortPoints)  # the name up to OpenCV 4
    points, given = (pixels - 0.5)[:, None], np.array(lens or [0.0] * 4)
    theirs = undistort(points, K_OPENCV, given, R=None, P=None, criteria=criteria)[:, 0]
    ours = distortion.directions(pixels, K, coefficients=lens)
    assert np.abs(ours[:, :2] / ours[:, 2:] - theirs).max() < 1e-10
    assert np.linalg.norm(ours, axis=-1) == pytest.approx(np.ones(500))


@EACH
def test_undistort_undoes_distort(lens):
    back = distortion.undistort(distortion.distort(field(), coefficients=lens), coefficients=lens)
    assert back.shape == field().shape
    assert np.abs(back - field()).max() < 1e-12


@EACH
def test_pixels_there_and_back(lens):
    pixels = np.random.default_rng(0).uniform(0, [1600, 1200], (1000, 2))
    directions = distortion.directions(pixels, K, coefficients=lens)
    seen = np.isfinite(directions).all(axis=-1)
    assert seen.mean() > 0.99
    assert np.abs(distortion.project(3.3 * directions[seen], K, coefficients=lens) - pixels[seen]).max() < 1e-9


def test_without_coefficients_it_is_the_pinhole():
    points = np.random.default_rng(0).uniform([-1, -1, -1], [1, 1, 3], (100, 3))
    assert distortion.project(points, K) == pytest.approx(pinhole.project(points, K), nan_ok=True, abs=1e-9)
    rays = pinhole.ray_directions(K, width_px=8, height_px=6)
    rows, columns = np.mgrid[:6, :8] + 0.5
    assert distortion.directions(np.stack([columns, rows], axis=-1), K) == pytest.approx(rays, abs=1e-15)


def test_the_fold_of_a_barrel_lens():
    # r (1 - 0.3 r^2) rises up to r = 1 / sqrt(0.9), where it is 2 / 3 of that
    lens = (-0.3, 0, 0, 0)
    fold = distortion.fold_radius(coefficients=lens)
    assert fold == pytest.approx(1 / np.sqrt(0.9), rel=1e-12)
    assert distortion.fold_radius(coefficients=(0.1, 0, 0, 0)) == distortion.fold_radius(coefficients=()) == np.inf
    edge = 2 / 3 * fold
    inside, outside = distortion.undistort([[0.999 * edge, 0], [1.001 * edge, 0]], coefficients=lens)
    assert 0.9 * fold < inside[0] < fold and np.all(np.isnan(outside))
    # a point beyond the fold has no pixel; OpenCV puts it inside the image
    point = np.array([[1.3, 0.0, 1.0]])
    assert np.all(np.isnan(distortion.project(point, K, coefficients=lens)))
    theirs, _ = cv2.projectPoints(point, np.zeros(3), np.zeros(3), K_OPENCV, np.array(lens, float))
    assert theirs[0, 0, 0] < 1600


def test_what_lies_near_the_fold_is_found():
    # the distorted radius is just that of the fold, where a first step would run far away
    lens = (0.678, -0.311, -0.007, -0.007)
    radius = np.linspace(0.5, 0.97, 200) * distortion.fold_radius(coefficients=lens)
    points = radius[:, None] * np.array([np.cos(2.0), np.sin(2.0)])
    back = distortion.undistort(distortion.distort(points, coefficients=lens), coefficients=lens)
    assert np.abs(back - points).max() < 1e-11


def test_a_pole_of_the_rational_model_ends_the_field():
    lens = (0.0, 0, 0, 0, 0, -1.0, 0, 0)  # r / (1 - r^2)
    assert distortion.fold_radius(coefficients=lens) == pytest.approx(1)
    far = distortion.undistort([[1000.0, 0.0]], coefficients=lens)
    assert far[0, 0] == pytest.approx((-1 + np.sqrt(1 + 4e6)) / 2000, rel=1e-9)


def test_shapes_and_what_is_not_finite():
    lens = LENSES["barrel"]
    assert distortion.undistort([0.1, 0.2], coefficients=lens).shape == (2,)
    assert distortion.undistort(np.zeros((0, 2)), coefficients=lens).shape == (0, 2)
    assert np.all(np.isnan(distortion.undistort([[np.nan, 0], [0, np.inf]], coefficients=lens)))
    assert distortion.undistort([0.0, 0.0], coefficients=lens).tolist() == [0, 0]


@pytest.mark.parametrize(
    ("lens", "message"),
    [
        ((0.1, 0.2, 0.3), "distortion: got 3 coefficients, allowed: 0, 4, 5 or 8"),
        ((0.1, np.nan, 0, 0), "distortion: got .*nan.*, allowed: finite numbers"),
    ],
)
def test_coefficients_that_are_none_are_refused(lens, message):
    with pytest.raises(ValueError, match=message):
        distortion.distort([0.0, 0.0], coefficients=lens)
