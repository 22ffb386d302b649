"""What the denoiser does to the smooth layers, stated from the picture alone, against a converged reference."""

import numpy as np
import pytest

from tests.physics import scenes
from tests.physics.test_layers_of_light import textured_wall
from uwsim.render import film, geometry, smooth, transport
from uwsim.render.accumulate import Accumulator
from uwsim.render.build import build, exposure_poses
from uwsim.render.stopping import region_means
from uwsim.scene.models import Scene

pytest.importorskip(smooth.PACKAGE, reason="the denoiser is an extra: pip install pyoidn")

SURFACES = smooth.Surfaces(albedo=np.ones((12, 16, 3)), normal=np.zeros((12, 16, 3), np.float32))
SEEDS, SAMPLES_PER_BATCH, BATCHES = 192, 16, 5  # an odd number of batches: halves of different size
LAYER = "backscatter"  # whose noise has the lightest tail: the test needs its own standard error small


@pytest.fixture(scope="module")
def scene_in_water(llvm_spectral):
    scene = textured_wall()
    camera = scene.rig.camera.model_copy(update={"width_px": 16, "height_px": 12})  # few pixels of many samples
    lamp = scene.rig.lamps[0].model_copy(update={"position_m": (0.5, 0.3, 0.0), "look_at_m": (0.5, 0.3, 1.0)})
    scene = scene.model_copy(update={"rig": scene.rig.model_copy(update={"camera": camera, "lamps": (lamp,)})})
    water = scenes.water(absorption_per_m=0.2, scattering_per_m=0.5, g=0.0)
    return build(scene, water=water, rig_poses=scene.rig.world_from_rig[None]), film.view_of(scene)


def summed(built, view, kind, seed):
    accumulator = kind(
        built, view, transport.estimate(built, orders=True), samples_per_batch=SAMPLES_PER_BATCH, seed=seed
    )
    for _ in range(BATCHES):
        accumulator.add_batch()
    return accumulator.sums


def test_without_it_nothing_changes(scene_in_water):
    """Expected: sums in halves hold the same pictures, bit by bit. Control: other seeds do not."""
    plain, halved, other = (
        summed(*scene_in_water, kind, seed)
        for kind, seed in ((Accumulator, 3), (smooth.HalvedAccumulator, 3), (Accumulator, 4))
    )
    for name, image in transport.pictures(plain).items():
        assert np.array_equal(image, transport.pictures(smooth.whole(halved))[name])
    assert not np.array_equal(plain.sums, other.sums)
    even, odd, share = smooth.halves(halved)
    assert share == pytest.approx(3 / 5)
    np.testing.assert_allclose(
        share * even + (1 - share) * odd, smooth._scattered(halved.means), rtol=1e-12, atol=1e-18
    )


def test_light_that_nothing_scattered_is_never_touched(scene_in_water):
    sums = summed(*scene_in_water, smooth.HalvedAccumulator, 0)
    plain = transport.pictures(smooth.whole(sums))
    found, _ = smooth.denoise_layers(plain, sums, SURFACES)
    assert np.array_equal(found["direct_unscattered"], plain["direct_unscattered"])
    assert np.all(found["direct"] >= found["direct_unscattered"])
    assert not any(np.array_equal(found[name], plain[name]) for name in smooth.DENOISED)
    np.testing.assert_allclose(found["radiance"], sum(found[name] for name in smooth.DENOISED), rtol=1e-6)


@pytest.mark.slow
def test_stated_bias_is_the_true_one(scene_in_water, monkeypatch):
    """Setup: 192 renders of 80 samples, denoised, and two references of 2048. Expected: the stated numbers, averaged as
    squares over the renders, equal the true bias (that of the mean render) and the true error, both from products with
    the two references, whose noise so drops out. Tolerance: Monte Carlo, 3 standard errors over the renders, which must
    be small enough, and 10 %. Negative control: the error twice and half as large."""
    # mean squares instead of their roots: unlike those, set to 0 from below, they average to the truth
    monkeypatch.setattr(smooth, "_root", lambda squares: float(squares.mean()))
    sums = [summed(*scene_in_water, smooth.HalvedAccumulator, seed) for seed in range(SEEDS)]
    renders = [smooth.denoise_layers(transport.pictures(smooth.whole(one)), one, SURFACES) for one in sums]
    images = np.stack([found[LAYER] for found, _ in renders]).astype(float)
    first, second = (
        transport.layers(*scene_in_water, samples_per_pixel=2048, batches=2, seed=seed)[LAYER].astype(float)
        for seed in (1000, 1001)
    )
    scale = first.mean()
    true = {
        "pixel_error": np.mean((images - first) * (images - second)) / scale**2,
        "pixel": squared_bias(images, first, second) / scale**2,
        "region": squared_bias(*(np.stack([region_means(image) for image in stack]) for stack in (
            images, [first], [second]))) / scale**2,
    }  # fmt: skip
    for name, expected in true.items():
        found = np.array([getattr(bias[LAYER], name) for _, bias in renders]) / scale
        allowed = 3 * found.std(ddof=1) / np.sqrt(len(found)) + 0.1 * abs(expected) + 0.005**2
        assert abs(found.mean() - expected) < allowed, (name, found.mean(), expected, allowed)
        if name == "pixel_error":
            assert allowed < 0.5 * expected, f"no power: {allowed:.3g} of {expected:.3g}"
            assert abs(4 * found.mean() - expected) > allowed
            assert abs(found.mean() / 4 - expected) > allowed


def squared_bias(stack: np.ndarray, first: np.ndarray, second: np.ndarray) -> float:
    """Return the mean square of the bias of independent images (n, ...), their noise taken off."""
    mean, noise = stack.mean(axis=0), stack.var(axis=0, ddof=1) / len(stack)
    return float(np.mean((mean - first) * (mean - second) - noise))


def test_a_darkening_denoiser_is_found_out(scene_in_water, monkeypatch):
    """Expected: a denoiser that takes a fifth of the light away is stated as -20 % in the mean and in regions; of the
    direct layer, as a fifth of what particles sent to the bodies."""
    monkeypatch.setattr(smooth, "denoised", lambda layer, normal=None: 0.8 * layer)
    sums = summed(*scene_in_water, smooth.HalvedAccumulator, 0)
    plain = transport.pictures(smooth.whole(sums))
    _, biases = smooth.denoise_layers(plain, sums, SURFACES)
    for name in ("forward_scatter", "backscatter"):
        np.testing.assert_allclose(biases[name].mean, -0.2, atol=1e-6)
        assert biases[name].region == pytest.approx(
            0.2, rel=0.35
        )  # relative to the mean of the layer, which is not even
    scattered = plain["direct"] - plain["direct_unscattered"]
    expected = -0.2 * scattered.mean(axis=(0, 1)) / plain["direct"].mean(axis=(0, 1))
    np.testing.assert_allclose(biases["direct"].mean, expected, rtol=1e-3)
    assert np.all(expected > -0.15)


def test_under_a_moving_camera_the_texture_stays_that_of_the_motion(llvm_spectral):
    """Setup: a chart in turbid water, the camera moving by 6 px. Expected: denoised, the direct light is nearer to a
    render of many samples, by a factor of 2 at least. Negative control: divided by the albedo of mid-exposure, which
    has the edges that the exposure smears, it is not as near."""
    chart = {
        "name": "chart", "kind": "usaf_1951", "width_m": 0.9, "first_group": -5, "last_group": -3,
        "position_m": (0.0, 0.6, -100.0), "towards_m": (0.0, 0.0, -100.0),
    }  # fmt: skip
    values = scenes.wall(distance_m=0.6).model_dump()
    values["bodies"] = (chart,)
    values["rig"] |= {
        "camera": {"width_px": 64, "height_px": 48, "horizontal_fov_deg": 50.0},
        "motion": {"blur_length_px": 6.0, "blur_angle_deg": 25.0},
    }  # fmt: skip
    scene = Scene.model_validate(values)
    view = film.view_of(scene)
    _, poses = exposure_poses(scene, steps=24)
    built = build(
        scene, water=scenes.water(absorption_per_m=0.3, scattering_per_m=4.0, g=0.9), rig_poses=poses
    )  # fmt: skip
    sums = summed(built, view, smooth.HalvedAccumulator, 1)
    truth = transport.layers(built, view, samples_per_pixel=4096, batches=4, seed=2)["direct"]
    plain = transport.pictures(smooth.whole(sums))

    def off(surfaces):
        found = plain if surfaces is None else smooth.denoise_layers(plain, sums, surfaces)[0]
        return float(np.sqrt(np.mean((found["direct"] - truth).astype(float) ** 2)) / truth.mean())

    still = geometry.geometry(scene, view)
    moving = off(geometry.mean_surfaces(scene, view, poses))
    at_rest = off(smooth.Surfaces(albedo=still["albedo"], normal=still["normal"]))
    print(f"off by {moving:.4f}; as at rest {at_rest:.4f}; not denoised {off(None):.4f}")
    assert moving < off(None) / 2
    assert at_rest > 1.3 * moving
