"""Camera: projection and its inverse, poses, and the sensor against calculations by hand."""

import numpy as np
import pytest

from uwsim import images
from uwsim.camera import pinhole, pose, sensor

RESPONSE = np.tile([1.0, 0.5, 0.25], (3, 1))
WAVELENGTHS_NM = np.array([500.0, 550.0, 600.0])
PLAIN = {"full_well_e": 1000.0, "white_balance": np.ones(3), "electrons_per_radiance": np.ones(3)}


def test_rays_project_back_onto_the_pixel_centres():
    K = pinhole.camera_matrix(width_px=16, height_px=10, horizontal_fov_deg=60)
    rays = pinhole.ray_directions(K, width_px=16, height_px=10)
    assert np.linalg.norm(rays, axis=-1) == pytest.approx(np.ones((10, 16)))
    pixels = pinhole.project(3.7 * rays, K)
    rows, columns = np.mgrid[:10, :16] + 0.5
    assert pixels == pytest.approx(np.stack([columns, rows], axis=-1), abs=1e-12)


def test_the_field_of_view_ends_at_the_edges_of_the_image():
    K = pinhole.camera_matrix(width_px=640, height_px=480, horizontal_fov_deg=50)
    edge = np.tan(np.radians(25))
    points = [[-edge, 0, 1], [edge, 0, 1], [0, edge, 1], [0, 0, 2]]
    assert pinhole.project(points, K) == pytest.approx(np.array([[0, 240], [640, 240], [320, 560], [320, 240]]))
    assert K[0, 0] == K[1, 1] == pytest.approx(320 / edge)


def test_what_is_behind_the_camera_has_no_pixel():
    K = pinhole.camera_matrix(width_px=4, height_px=4, horizontal_fov_deg=90)
    assert np.all(np.isnan(pinhole.project([[0, 0, -1.0], [0, 0, 0.0]], K)))


def test_a_camera_that_looks_along_y_has_x_right_and_y_down():
    world_from_camera = pose.looking_at([1, 2, -3], [1, 5, -3])
    assert world_from_camera[:3, :3] == pytest.approx(np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]]), abs=1e-12)
    assert list(world_from_camera[:3, 3]) == [1, 2, -3]


@pytest.mark.parametrize("target", [[1, 0, 0], [0.3, -2, 1], [0, 0, -1], [0, 0, 1]])
def test_poses_are_rotations_without_mirroring(target):
    for made in (pose.looking_at([0, 0, 0], target, roll_deg=20), pose.facing([0, 0, 0], target)):
        assert made[:3, :3] @ made[:3, :3].T == pytest.approx(np.eye(3), abs=1e-12)
        assert np.linalg.det(made[:3, :3]) == pytest.approx(1)
        assert made[:3, 2] == pytest.approx(np.array(target) / np.linalg.norm(target))


def test_a_face_has_its_right_to_the_right_seen_from_where_it_looks():
    camera = pose.looking_at([0, 0, -1], [0, 3, -1])
    world_from_body = pose.facing([0, 3, -1], [0, 0, -1])
    # x right and y up on the body: right and up in the image
    camera_from_body = pose.inverse(camera) @ world_from_body
    assert camera_from_body[:3, 0] == pytest.approx([1, 0, 0], abs=1e-12)
    assert camera_from_body[:3, 1] == pytest.approx([0, -1, 0], abs=1e-12)


def test_roll_turns_the_camera_clockwise_and_the_image_the_other_way():
    rolled = pose.looking_at([0, 0, 0], [0, 1, 0], roll_deg=90)
    assert rolled[:3, 0] == pytest.approx([0, 0, -1], abs=1e-12)  # the camera's right points down


def test_inverse_and_apply_undo_each_other():
    made = pose.rotated(pose.facing([1, 2, -3], [0, 0, 0]), [10, 20, 30])
    points = np.random.default_rng(0).normal(size=(5, 3))
    assert pose.apply(pose.inverse(made), pose.apply(made, points)) == pytest.approx(points, abs=1e-12)
    with pytest.raises(ValueError, match="lamp led: the position and the point looked at coincide"):
        pose.looking_at([1, 1, 1], [1, 1, 1], where="lamp led")


def test_motion_is_along_the_rigs_own_axes():
    rig = pose.looking_at([0, 0, -1], [0, 1, -1])
    moved = pose.through_exposure(
        rig, velocity_m_per_s=[0, 0, 2.0], rotation_deg_per_s=[0, 90.0, 0], times_s=np.array([-1, 0, 0.5])
    )
    assert moved[1] == pytest.approx(rig)
    assert moved[2, :3, 3] == pytest.approx([0, 1, -1])  # forward is world y
    turned = np.array([np.sqrt(0.5), np.sqrt(0.5), 0])  # about y, which is down: to the right
    assert moved[2, :3, 2] == pytest.approx(turned)


def electrons(**changes) -> np.ndarray:
    settings = {
        "exposure_time_s": 0.01, "f_number": 2.0, "pixel_pitch_m": 5e-6, "peak_quantum_efficiency": 0.5,
        "response": RESPONSE, "wavelengths_nm": WAVELENGTHS_NM,
    }  # fmt: skip
    return sensor.electrons_per_radiance(**settings | changes)


def test_mean_electrons_against_a_calculation_by_hand():
    # irradiance per spectral radiance: pi / (4 N^2) = 0.19635; energy on a pixel: x 25e-12 m^2 x 0.01 s = 4.9087e-14 J
    # electrons per J and nm: QE(l) l / (h c), with QE = 0.5 (500 / l) in the first band, so 0.5 x 500e-9 / (h c) at
    # every wavelength, and h c = 1.98645e-25 J m: 1.25852e18; over 100 nm 1.25852e20
    by_hand = 4.9087e-14 * 1.25852e20
    assert electrons() == pytest.approx(by_hand * np.array([1, 0.5, 0.25]), rel=1e-4)


def test_mean_electrons_scale_as_they_should():
    assert electrons(exposure_time_s=0.02) == pytest.approx(2 * electrons())
    assert electrons(f_number=4.0) == pytest.approx(electrons() / 4)
    assert electrons(pixel_pitch_m=1e-5) == pytest.approx(4 * electrons())


def linear_of(picture: np.ndarray) -> np.ndarray:
    return images.linear_from_srgb_uint8(picture).astype(float)


@pytest.mark.parametrize("mean_e", [100.0, 300.0, 500.0])
def test_the_variance_of_shot_noise_is_its_mean(mean_e):
    radiance = np.full((300, 300, 3), mean_e)
    picture = sensor.expose(radiance, read_noise_e=0.0, rng=np.random.default_rng(0), **PLAIN)
    seen_e = 1000 * linear_of(picture)
    # 8-bit steps of the sRGB curve at this grey, as a uniform error
    step_e = 1000 * np.gradient(images.srgb_decode(np.arange(256) / 255))[np.median(picture).astype(int)]
    assert seen_e.mean() == pytest.approx(mean_e, abs=0.3)
    # standard error of the variance of 270000 values: 0.3 %
    assert seen_e.var() == pytest.approx(mean_e + step_e**2 / 12, rel=0.015)


def test_read_noise_adds_its_variance():
    radiance = np.full((300, 300, 3), 300.0)
    pictures = [
        sensor.expose(radiance, read_noise_e=noise, rng=np.random.default_rng(0), **PLAIN) for noise in (0.0, 20.0)
    ]
    without, noisy = (1e6 * linear_of(picture).var() for picture in pictures)
    assert noisy - without == pytest.approx(400, rel=0.04)


def test_the_full_well_clips_and_the_white_balance_scales():
    bright = sensor.expose(np.full((4, 4, 3), 1e9), read_noise_e=0.0, rng=np.random.default_rng(0), **PLAIN)
    assert np.all(bright == 255)
    balance = PLAIN | {"white_balance": np.array([2.0, 1.0, 0.5])}
    linear = sensor.linear_from_radiance(np.full((1, 1, 3), 200.0), **balance)
    assert linear[0, 0] == pytest.approx([0.4, 0.2, 0.1])
    assert np.array_equal(
        sensor.expose_without_noise(np.full((1, 1, 3), 200.0), **balance), images.srgb_uint8_from_linear(linear)
    )


@pytest.mark.parametrize("value", [-1e-9, np.nan])
def test_radiance_that_is_no_radiance_is_refused(value):
    with pytest.raises(ValueError, match="radiance has 3 negative or NaN values, allowed: >= 0"):
        sensor.expose(np.full((1, 1, 3), value), read_noise_e=0.0, rng=np.random.default_rng(0), **PLAIN)


def test_srgb_there_and_back():
    codes = np.arange(256, dtype=np.uint8).reshape(16, 16)
    assert np.array_equal(images.srgb_uint8_from_linear(images.linear_from_srgb_uint8(codes)), codes)
    linear = np.linspace(0, 1, 1001)
    assert images.srgb_decode(images.srgb_encode(linear)) == pytest.approx(linear, abs=1e-12)
    assert images.srgb_encode(np.array([0.5, 0.0031308])) == pytest.approx([0.735357, 0.04045], abs=1e-5)


def test_png_there_and_back(tmp_path):
    picture = np.random.default_rng(0).integers(0, 256, (5, 7, 3)).astype(np.uint8)
    images.write_png(tmp_path / "a.png", picture)
    assert np.array_equal(images.read_srgb(tmp_path / "a.png"), picture)
    assert [path.name for path in tmp_path.iterdir()] == ["a.png"]
