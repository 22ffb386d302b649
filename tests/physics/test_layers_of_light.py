"""The parts of an image agree with each other where the physics says so."""

import numpy as np
import pytest

from tests.physics import scenes
from tests.references.monte_carlo import assert_mean_matches
from uwsim.camera import pose
from uwsim.render import transport
from uwsim.render.build import build
from uwsim.render.frame import summarise_blur


@pytest.fixture(scope="module", autouse=True)
def _variant(llvm_spectral):
    pass


LAMP_M = (0.2, 0.0, 0.0)


def test_without_scattering_the_image_is_the_twin_times_the_transmission():
    """Setup: absorbing spectral water. Expected: radiance = water_free x transmission, two integrators and the
    transmission pass. Tolerance: Monte Carlo, model 2e-3. Negative control: transmission of 5 % murkier water."""
    water = scenes.spectral_water(low_per_m=0.2, high_per_m=1.0)
    scene = scenes.wall(distance_m=1.0, lamp_m=LAMP_M)
    still = scene.rig.world_from_rig[None]
    found = scenes.replicates(scene, water=water, integrator="volpathmis", samples=1024)
    twin = scenes.replicates(scene, water=None, integrator="path", samples=1024, count=8).mean(axis=0)
    built, view = build(scene, water=None, rig_poses=still, integrator="path"), transport.view_of(scene)

    def product(attenuation):
        t = transport.transmission(built, view, attenuation=attenuation, samples_per_pixel=1024, seed=3)
        return twin * t.mean(axis=(0, 1))

    rule = {"max_relative_standard_error": 0.01, "model_tolerance": 3e-3}
    assert_mean_matches(found, product(water.absorption), **rule)
    with pytest.raises(AssertionError, match="biased"):
        assert_mean_matches(found, product(1.05 * water.absorption), **rule)


def test_image_of_a_black_wall_is_the_backscatter():
    """Setup: scattering water before a wall of reflectance 0 and of reflectance 0.5 with black bodies. Expected: the
    same image; with the wall's light it is brighter (negative control). Tolerance: Monte Carlo."""
    water = scenes.water(absorption_per_m=0.1, scattering_per_m=0.5, g=0.5)
    scene = scenes.wall(distance_m=1.0, lamp_m=LAMP_M)
    black_wall = scenes.wall(
        distance_m=1.0, lamp_m=LAMP_M, bodies=[scene.bodies[0].model_dump() | {"reflectance": 0.0}]
    )
    options = {"water": water, "integrator": "volpathmis", "samples": 2048}
    layer = scenes.replicates(scene, black_bodies=True, **options)
    truth = scenes.replicates(black_wall, **options).mean(axis=0)
    rule = {"max_relative_standard_error": 0.03, "model_tolerance": 0.03}  # the reference has its own error
    assert_mean_matches(layer, truth, **rule)
    with pytest.raises(AssertionError, match="biased"):
        assert_mean_matches(scenes.replicates(scene, **options), truth, **rule)


def test_standard_error_is_that_of_repeated_renders():
    """Setup: 24 renders with own seeds. Expected: their spread equals the stated standard error within 15 %.
    Negative control: twice that error is told apart."""
    scene = scenes.wall(distance_m=1.0, lamp_m=LAMP_M)
    built = build(
        scene, water=scenes.water(absorption_per_m=0.1, scattering_per_m=0.3, g=0.5),
        rig_poses=scene.rig.world_from_rig[None], integrator="volpathmis",
    )  # fmt: skip
    view = transport.view_of(scene)
    pairs = [transport.radiance(built, view, samples_per_pixel=256, batches=8, seed=seed) for seed in range(24)]
    spread = np.std([image for image, _ in pairs], axis=0, ddof=1)
    stated = np.sqrt(np.mean([error.astype(float) ** 2 for _, error in pairs], axis=0))
    ratio = np.sqrt(np.mean(stated**2) / np.mean(spread**2))
    assert 0.85 < ratio < 1.15
    assert not 0.85 < 2 * ratio < 1.15


def textured_wall(**motion):
    body = {
        "name": "board", "kind": "marker_board", "columns": 3, "rows": 3, "marker_size_m": 0.2, "gap_m": 0.05,
        "position_m": [0, 1, -100], "towards_m": [0, 0, -100],
    }  # fmt: skip
    scene = scenes.wall(distance_m=1.0, lamp_m=LAMP_M, bodies=[body])
    camera = scene.rig.camera.model_copy(update={"width_px": 32, "height_px": 24, "horizontal_fov_deg": 40.0})
    return scene.model_copy(update={"rig": scene.rig.model_copy(update={"camera": camera})})


def test_motion_is_the_mean_over_mid_points_of_the_exposure():
    """Setup: rig (camera and lamp) moving 4 px sideways over a board, no water. Expected: one render along the
    trajectory equals the mean of 16 still ones at the mid-points. Negative control: end points included (too long)."""
    scene = textured_wall()
    view = transport.view_of(scene)
    shift_m = 4 * 1.0 / view.K[0, 0]

    def path(offsets):
        return pose.through_exposure(
            scene.rig.world_from_rig, velocity_m_per_s=(shift_m, 0, 0), rotation_deg_per_s=(0, 0, 0), times_s=offsets
        )

    def image(poses, samples, seed):
        built = build(scene, water=None, rig_poses=poses, integrator="path")
        return transport.radiance(built, view, samples_per_pixel=samples, batches=2, seed=seed)[0]

    middles = (np.arange(16) + 0.5) / 16 - 0.5
    moving = image(path(middles), 16384, 1)
    stills = np.mean([image(path(np.array([m])), 1024, 10 + i) for i, m in enumerate(middles)], axis=0)
    ends = np.mean([image(path(np.array([m])), 1024, 50 + i) for i, m in enumerate(np.linspace(-0.5, 0.5, 6))], axis=0)
    difference = np.sqrt(np.mean((moving - stills) ** 2)) / stills.mean()
    assert difference < 0.01
    assert np.sqrt(np.mean((moving - ends) ** 2)) / stills.mean() > 2 * difference


def test_blur_label_has_the_stated_angle_convention():
    """Image content moving right and up (negative rows) has an angle between 0 and 90 degrees."""
    displacement = np.tile(np.array([3.0, -3.0]), (4, 5, 1))
    label = summarise_blur(displacement, np.ones((4, 5), bool))
    assert label["angle_deg"] == pytest.approx(45.0)
    assert label["length_px"] == pytest.approx(np.hypot(3, 3))
    assert label["uniform"]
    assert summarise_blur(displacement, np.zeros((4, 5), bool)) is None
