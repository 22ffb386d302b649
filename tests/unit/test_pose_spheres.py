"""Spheres in pictures: unbiased centres, covariances that hold, the centre's image rather than the outline's middle."""

import numpy as np
import pytest

from uwsim.camera.flat_port import FlatPort
from uwsim.camera.lens import Lens
from uwsim.images import srgb_uint8_from_linear
from uwsim.pose import sphere_fit
from uwsim.pose.sphere_candidates import candidates, without_veil
from uwsim.pose.sphere_outline import local_map, middle_off_px, shape_of
from uwsim.pose.spheres import POINTS_OVER_MODEL_STD, detect_spheres

SIDE_PX = 44
K = np.array([[468.0, 0, 240], [0, 468.0, 180], [0, 0, 1]])


def disc(centre, radius_px, light, *, side_px=SIDE_PX, blur_px=0.7, samples=8):
    """Return the picture (side, side) of a matt ball of a far lamp in direction `light`; (0, 0, 0): it shines."""
    import cv2

    fine = (np.arange(side_px * samples) + 0.5) / samples
    x, y = (fine[None, :] - centre[0]) / radius_px, (fine[:, None] - centre[1]) / radius_px
    inside = x**2 + y**2 < 1
    z = np.sqrt(np.clip(1 - x**2 - y**2, 0, None))
    lit = np.clip(light[0] * x + light[1] * y + light[2] * z, 0, None) if any(light) else np.ones_like(z)
    picture = cv2.GaussianBlur(np.where(inside, lit, 0.0), (0, 0), blur_px * samples)
    return picture.reshape(side_px, samples, side_px, samples).mean(axis=(1, 3))


def picture(rng, radius_px, light, *, veil=0.1, electrons=2000.0, side_px=SIDE_PX, smooth_px=0.0):
    """Return (true centre, 8-bit picture) with photon noise and a veil that gets brighter to the lower right.

    `smooth_px`: of the Gaussian that the noise is smoothed with.
    """
    from scipy import ndimage

    centre = side_px / 2 + rng.uniform(-0.5, 0.5, 2)
    rows, columns = np.mgrid[:side_px, :side_px] / side_px
    clean = 0.5 * disc(centre, radius_px, light, side_px=side_px) + veil * (1 + 0.5 * columns + 0.3 * rows)
    counts = electrons * clean[..., None] * np.ones(3)
    noisy = rng.normal(counts, np.sqrt(counts + 16)) / electrons
    if smooth_px:
        noisy = clean[..., None] + ndimage.gaussian_filter(noisy - clean[..., None], (smooth_px, smooth_px, 0))
    return centre, srgb_uint8_from_linear(np.clip(noisy, 0, 1))


def centres(seed, radius_px, light, count, **options):
    """Return errors (n, 2) and covariances (n, 2, 2) of the one sphere of each picture."""
    rng = np.random.default_rng(seed)
    errors, covariances = [], []
    for _ in range(count):
        centre, image = picture(rng, radius_px, light, **options)
        found = detect_spheres(image, radius_px=(2.0, 8.0), model_share=0.0)
        assert len(found) == 1
        errors.append(found[0].centre_px - centre)
        covariances.append(found[0].covariance_px2)
    return np.array(errors), np.array(covariances)


def squares(errors, covariances):
    """Return squared errors (n,) in units of the fit's own variances."""
    return POINTS_OVER_MODEL_STD**2 * np.einsum("ni,nij,nj->n", errors, np.linalg.inv(covariances), errors)


def test_smooth_noise_makes_centres_less_sure(monkeypatch):
    """Noise smoothed over a pixel, as after a denoiser: squared errors in units of the variances have the mean 2 still
    (30 of them: 1.2 to 3.2). Negative control: with noise taken for independent they are several times as large."""
    kind = {"radius_px": 5.0, "light": (0, 0, 1.0), "count": 30, "electrons": 500.0, "smooth_px": 0.8}
    assert 1.2 < np.mean(squares(*centres(9, **kind))) < 3.2
    monkeypatch.setattr(sphere_fit, "_correlation", lambda residuals, used: 1.0)
    assert np.mean(squares(*centres(9, **kind))) > 5


@pytest.mark.parametrize("light", [(0, 0, 0), (0, 0, 1.0), (-0.4, -0.25, 0.88)], ids=["shines", "frontal", "from_side"])
def test_centres_are_unbiased_and_as_sure_as_they_say(light):
    """Setup: balls of 5 px in a sloping veil, one below the other by fractions of a pixel. Expected: mean error below
    0.02 px and what it scatters; squared errors in units of the fit's variances have the mean 2 (30 of them: 1.2 to
    3.2). Negative control: the centroid of the brightness, pixels off its veil, is off by more where light comes from
    the side."""
    errors, covariances = centres(3, 5.0, light, 30)
    scatter = errors.std(axis=0) / np.sqrt(len(errors))
    assert np.all(np.abs(errors.mean(axis=0)) < 0.02 + 2 * scatter)
    assert np.all(errors.std(axis=0) < 0.06)
    assert 1.2 < np.mean(squares(errors, covariances)) < 3.2
    if light[0]:
        centre, image = picture(np.random.default_rng(3), 5.0, light, electrons=1e6)
        bright = without_veil(image.mean(axis=-1) / 255.0, most_px=8.0).clip(0.05) - 0.05
        rows, columns = np.mgrid[:SIDE_PX, :SIDE_PX] + 0.5
        centroid = np.array([(bright * columns).sum(), (bright * rows).sum()]) / bright.sum()
        assert np.linalg.norm(centroid - centre) > 0.2


def test_saturated_pixels_are_no_hole():
    """Expected: a ball whose bright half is white is found to 0.05 px. Negative control: with white taken for the
    light's measure, by the centroid, it is not."""
    rng = np.random.default_rng(4)
    centre = np.array([22.3, 21.8])
    clean = 1.8 * disc(centre, 6.0, (-0.4, -0.25, 0.88)) + 0.05
    noisy = rng.normal(clean[..., None] * np.ones(3), 0.01)
    image = srgb_uint8_from_linear(np.clip(noisy, 0, 1))
    assert (image >= 254).any(axis=-1).sum() > 20
    (found,) = detect_spheres(image, radius_px=(3.0, 9.0))
    assert np.linalg.norm(found.centre_px - centre) < 0.05
    assert found.radius_px == pytest.approx(6.0, abs=0.3)


def test_empty_water_and_large_lights_are_no_spheres():
    rng = np.random.default_rng(5)
    rows, columns = np.mgrid[:80, :80] / 80
    veil = 0.2 * np.exp(-((columns - 0.3) ** 2) - (rows - 0.4) ** 2)[..., None] * np.ones(3)
    image = srgb_uint8_from_linear(np.clip(rng.normal(veil, 0.01), 0, 1))
    assert detect_spheres(image, radius_px=(2.0, 6.0)) == []


def test_two_neighbours_are_two():
    one, two = np.array([16.2, 22.0]), np.array([27.6, 22.4])
    clean = 0.5 * (disc(one, 4.0, (0, 0, 1.0)) + disc(two, 4.0, (0, 0, 1.0))) + 0.05
    image = srgb_uint8_from_linear(np.random.default_rng(6).normal(clean[..., None] * np.ones(3), 0.005).clip(0, 1))
    found = sorted(detect_spheres(image, radius_px=(2.0, 6.0)), key=lambda sphere: sphere.centre_px[0])
    assert len(found) == 2
    for sphere, true in zip(found, (one, two), strict=True):
        assert np.linalg.norm(sphere.centre_px - true) < 0.05
    blobs = candidates(np.asarray(clean), radius_px=(2.0, 6.0))
    assert len(blobs) == 2


def test_the_middle_of_an_outline_is_not_the_centre():
    """Expected: for a pinhole by sin^2 a / (cos^2 t - sin^2 a) of the distance from the principal point (the sphere's
    cone cut by the plane); a port changes that. Negative control: on the axis there is none."""
    lens, radius_m, distance_m = Lens(K=K), 0.006, 0.2
    pixel = np.array([400.0, 260.0])
    off_axis = np.arctan(np.linalg.norm((pixel - K[:2, 2]) / 468.0))
    angular = np.arcsin(radius_m / distance_m)
    radius_px = angular * np.sqrt(abs(np.linalg.det(local_map(lens, pixel))))
    expected = (pixel - K[:2, 2]) * np.sin(angular) ** 2 / (np.cos(off_axis) ** 2 - np.sin(angular) ** 2)
    found = middle_off_px(lens, pixel, radius_px, radius_m=radius_m)
    assert np.linalg.norm(expected) > 0.15
    assert found == pytest.approx(expected, abs=0.02 * np.linalg.norm(expected))
    assert np.linalg.norm(middle_off_px(lens, K[:2, 2], radius_px)) < 1e-9
    port = FlatPort(gap_m=0.03, thickness_m=0.012, n_glass=1.49, n_water=1.333)
    behind = middle_off_px(Lens(K=K, port=port), pixel, radius_px, radius_m=radius_m)
    assert np.linalg.norm(behind - found) > 0.02
    shape = shape_of(local_map(lens, pixel))
    assert np.linalg.det(shape) == pytest.approx(1.0) and shape == pytest.approx(shape.T)


def test_wrong_pictures_and_sizes_are_refused():
    image = np.zeros((40, 60, 3), np.uint8)
    with pytest.raises(ValueError, match="detect_spheres: got"):
        detect_spheres(image[..., 0], radius_px=(2.0, 5.0))
    for wrong in ((0.0, 5.0), (5.0, 2.0), (2.0, 20.0)):
        with pytest.raises(ValueError, match="detect_spheres: radius_px"):
            detect_spheres(image, radius_px=wrong)


def test_a_streak_is_no_ball_lit_from_one_side():
    """Setup: a ball lit from the upper left that moves by 8 px to the upper right. Expected: found where it was in the
    middle of the exposure, to 0.5 px; one that takes it for round (negative control) is off by more than 1 px."""
    middle, way = np.array([22.4, 21.7]), 8.0 * np.array([np.cos(np.pi / 6), -np.sin(np.pi / 6)])
    steps = (np.arange(16) + 0.5) / 16 - 0.5
    clean = np.mean([0.6 * disc(middle + step * way, 6.5, (-0.25, -0.18, 0.95), samples=4) for step in steps], axis=0)
    noisy = np.random.default_rng(8).normal(clean[..., None] * np.ones(3) + 0.03, 0.005).clip(0, 1)
    (found,) = detect_spheres(srgb_uint8_from_linear(noisy), radius_px=(3.0, 9.0))
    assert np.linalg.norm(found.centre_px - middle) < 0.5
    everywhere = np.ones((SIDE_PX, SIDE_PX), bool)
    (taken_for_round,) = sphere_fit.fit_spheres(
        noisy.mean(axis=-1), everywhere, ~everywhere, centres_px=middle, radii_px=7.0, shape=np.eye(2)
    )
    assert np.linalg.norm(taken_for_round.centre_px - middle) > 1.0
