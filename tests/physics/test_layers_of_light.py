"""The parts of an image agree with each other where the physics says so."""

import numpy as np
import pytest

from tests.physics import scenes
from tests.references.monte_carlo import assert_mean_matches
from uwsim.camera import pose
from uwsim.render import film, transport
from uwsim.render.build import build
from uwsim.render.motion import summarise_blur


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
    found = scenes.replicates(scene, water=water, samples=1024)
    twin = scenes.replicates(scene, water=None, samples=1024, count=8).mean(axis=0)
    built, view = build(scene, water=None, rig_poses=still), film.view_of(scene)

    def product(attenuation):
        t = transport.transmission(built, view, attenuation=attenuation, samples_per_pixel=1024, seed=3)
        return twin * t.mean(axis=(0, 1))

    rule = {"max_relative_standard_error": 0.01, "model_tolerance": 3e-3}
    assert_mean_matches(found, product(water.absorption), **rule)
    with pytest.raises(AssertionError, match="biased"):
        assert_mean_matches(found, product(1.05 * water.absorption), **rule)


SCATTERING = {"absorption_per_m": 0.1, "scattering_per_m": 0.5}
# two Monte-Carlo results: the rule of one sample, with the standard error of both
TWO_SAMPLES = {"max_relative_standard_error": 0.02, "model_tolerance": 2e-3}


def assert_same_mean(found, reference):
    """Independent replicates (R, 3) of two estimators: their paired differences about the reference's mean."""
    mean = reference.mean(axis=0)
    assert_mean_matches(mean + found - reference, mean, **TWO_SAMPLES)


@pytest.mark.parametrize(
    ("g", "lamp_m"),
    [
        (0.9, (0.1, -0.3, 0.05)),
        pytest.param(0.5, LAMP_M, marks=pytest.mark.slow),
        pytest.param(-0.3, (0.4, 0.1, 0.2), marks=pytest.mark.slow),
    ],
)
def test_total_is_that_of_the_reference_integrator(g, lamp_m):
    """Setup: grey wall in scattering water, all orders. Expected: the layers' sum equals Mitsuba's `volpathmis`.
    Tolerance: Monte Carlo of both (t-test on the differences), model 2e-3. Negative control: 10 % brighter."""
    scene, water = scenes.wall(distance_m=1.0, lamp_m=lamp_m), scenes.water(**SCATTERING, g=g)
    reference = scenes.replicates(scene, water=water, samples=16384, reference=True)
    found = scenes.replicates(scene, water=water, samples=4096)
    assert_same_mean(found, reference)
    with pytest.raises(AssertionError, match="biased"):
        assert_same_mean(1.1 * found, reference)


def test_backscatter_is_what_a_black_wall_leaves():
    """Setup: backscatter layer before a grey wall, and reference image of a wall of reflectance 0. Expected: the same.
    Negative control: forward scatter counted in."""
    lamp_m = (0.8, 0.0, 0.0)  # far from the view: the reference is noisy beside a lamp
    scene, water = scenes.wall(distance_m=1.0, lamp_m=lamp_m), scenes.water(**SCATTERING, g=0.3)
    black = scenes.wall(distance_m=1.0, lamp_m=lamp_m, bodies=[scene.bodies[0].model_dump() | {"reflectance": 0.0}])
    reference = scenes.replicates(black, water=water, samples=16384, reference=True)
    backscatter = scenes.replicates(scene, water=water, samples=2048, layer="backscatter")
    assert_same_mean(backscatter, reference)
    forward = scenes.replicates(scene, water=water, samples=2048, layer="forward_scatter")
    with pytest.raises(AssertionError, match="biased"):
        assert_same_mean(backscatter + forward, reference)


def test_layers_sum_to_the_image_and_vanish_where_they_must():
    """Layers sum to float32 round-off; without scattering only direct light is left."""
    scene = scenes.wall(distance_m=1.0, lamp_m=LAMP_M)
    view = film.view_of(scene)

    def layers(water):
        built = build(scene, water=water, rig_poses=scene.rig.world_from_rig[None])
        return transport.layers(built, view, samples_per_pixel=64, batches=2, seed=1)

    found = layers(scenes.water(**SCATTERING))
    assert np.array_equal(found["direct"] + found["forward_scatter"] + found["backscatter"], found["radiance"])
    assert all(found[name].min() > 0 for name in ("direct", "forward_scatter", "backscatter"))
    clear = layers(scenes.water(absorption_per_m=0.3))
    assert clear["direct"].min() > 0
    assert not clear["forward_scatter"].any()
    assert not clear["backscatter"].any()


def test_standard_error_is_that_of_repeated_renders():
    """Setup: 24 renders with own seeds. Expected: their spread equals the stated standard error within 15 %.
    Negative control: twice that error is told apart."""
    scene = scenes.wall(distance_m=1.0, lamp_m=LAMP_M)
    built = build(
        scene, water=scenes.water(absorption_per_m=0.1, scattering_per_m=0.3, g=0.5),
        rig_poses=scene.rig.world_from_rig[None],
    )  # fmt: skip
    view = film.view_of(scene)
    frames = [transport.layers(built, view, samples_per_pixel=256, batches=8, seed=seed) for seed in range(24)]
    pairs = [(frame["radiance"], frame["standard_error"]) for frame in frames]
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
    view = film.view_of(scene)
    shift_m = 4 * 1.0 / view.K[0, 0]

    def path(offsets):
        return pose.through_exposure(
            scene.rig.world_from_rig, velocity_m_per_s=(shift_m, 0, 0), rotation_deg_per_s=(0, 0, 0), times_s=offsets
        )

    def image(poses, samples, seed):
        built = build(scene, water=None, rig_poses=poses)
        return transport.layers(built, view, samples_per_pixel=samples, batches=2, seed=seed)["radiance"]

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


@pytest.mark.slow
@pytest.mark.parametrize("lamps_m", [[(0.8, 0.0, 0.0)], [(0.8, 0.0, 0.0), (-0.5, 0.4, 0.1)]])
def test_coloured_water_and_several_lamps_agree_with_the_reference(lamps_m):
    """Setup: absorption rising and scattering falling over the wavelengths, one or two lamps. Expected: all bands of
    the total equal Mitsuba's `volpathmis`. Tolerance and negative control as above."""
    base = scenes.spectral_water(low_per_m=0.05, high_per_m=0.6)
    scattering = np.linspace(0.9, 0.2, len(base.absorption))
    water = type(base)("ramps", base.absorption, scattering, scenes.water(absorption_per_m=0, g=0.3).phase)
    values = scenes.wall(distance_m=1.0, lamp_m=lamps_m[0]).model_dump()
    lamp = values["rig"]["lamps"][0]
    values["rig"]["lamps"] = [
        lamp | {"name": f"lamp{k}", "position_m": place, "look_at_m": (0.0, 0.0, 1.0)}
        for k, place in enumerate(lamps_m)
    ]
    scene = scenes.Scene.model_validate(values)
    reference = scenes.replicates(scene, water=water, samples=16384, reference=True)
    found = scenes.replicates(scene, water=water, samples=4096)
    assert_same_mean(found, reference)
    with pytest.raises(AssertionError, match="biased"):
        assert_same_mean(1.1 * found, reference)


def test_a_rig_in_motion_is_the_mean_of_still_ones_in_water_too():
    """Setup: rig moving 10 cm sideways in scattering water before a wall. Expected: every layer equals the mean
    over still rigs at the mid-points. Tolerance: Monte Carlo, 3 %. Negative control: the rig at rest at the start."""
    scene, water = scenes.wall(distance_m=1.0, lamp_m=(0.4, 0.0, 0.0)), scenes.water(**SCATTERING, g=0.3)
    bodies = [scene.bodies[0].model_copy(update={"width_m": 0.1})]  # an edge for the motion to matter
    scene = scene.model_copy(update={"bodies": tuple(bodies)})
    view = film.view_of(scene)

    def image(offsets_m, samples, seed):
        poses = pose.through_exposure(
            scene.rig.world_from_rig, velocity_m_per_s=(1, 0, 0), rotation_deg_per_s=(0, 0, 0), times_s=offsets_m
        )
        built = build(scene, water=water, rig_poses=poses)
        found = transport.layers(built, view, samples_per_pixel=samples, batches=2, seed=seed)
        return np.array([found[name].mean() for name in ("direct", "forward_scatter", "backscatter")])

    middles = (np.arange(8) + 0.5) / 8 * 0.1
    moving = np.mean([image(middles, 4096, seed) for seed in range(4)], axis=0)
    still = np.mean([image(np.array([m]), 2048, 10 + k) for k, m in enumerate(middles)], axis=0)
    np.testing.assert_allclose(moving, still, rtol=0.03)
    assert not np.allclose(moving[0], image(np.array([0.0]), 2048, 30)[0], rtol=0.1)
