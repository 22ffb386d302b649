"""Marine snow: what many small diffuse bodies scatter back, where it counts, and what it is not in."""

import numpy as np
import pytest

from tests.physics import scenes
from tests.references.monte_carlo import assert_mean_matches
from uwsim.camera import pose
from uwsim.render import film, geometry, transport
from uwsim.render.build import build, openings
from uwsim.scene.bodies import MarineSnow, numbered
from uwsim.scene.models import Scene

NEAR_M, FAR_M = 0.5, 1.0
HALF_M = 0.1  # of the cloud, across
RADIUS_M = 1e-3
COUNT = 6000
REFLECTANCE = 0.6
LAMP_M = 0.1  # beside the camera


@pytest.fixture(scope="module", autouse=True)
def _variant(llvm_spectral):
    pass


def snow(**changes) -> dict:
    return {
        "name": "snow", "kind": "marine_snow", "low_m": (-HALF_M, NEAR_M, -100 - HALF_M),
        "high_m": (HALF_M, FAR_M, -100 + HALF_M), "count": COUNT, "diameters_m": (2 * RADIUS_M, 2 * RADIUS_M),
        "reflectance": REFLECTANCE, "seed": 1,
    } | changes  # fmt: skip


def scene_with(*bodies: dict, size_px: int = 8, fov_deg: float = 6.0) -> Scene:
    """Snow before a wall, lit by a lamp beside a narrow camera that shines evenly."""
    scene = scenes.wall(distance_m=2.0, lamp_m=(LAMP_M, 0.0, 0.0), half_angle_deg=80.0)
    rig = scene.rig.model_dump()
    rig["camera"] |= {"width_px": size_px, "height_px": size_px, "horizontal_fov_deg": fov_deg}
    wall = scene.bodies[0].model_dump()
    return Scene.model_validate(scene.model_dump() | {"rig": rig, "bodies": (*bodies, wall)})


def phase_of_a_diffuse_sphere(scattering_angle_rad: np.ndarray) -> np.ndarray:
    """8 / (3 pi) (sin t - t cos t) / (4 pi) [1/sr], of all reflected light.

    Source: Lambert's sphere; Schoenberg 1929, Handbuch der Astrophysik 2/1: phase angle pi - t.
    """
    t = scattering_angle_rad
    return 8 / (3 * np.pi) * (np.sin(t) - t * np.cos(t)) / (4 * np.pi)


def closed_form(scene: Scene) -> float:
    """Return the mean radiance of light scattered once by the snow, over 300 nm of white light, in clear water.

    The integral of n rho sigma p(t) I / d^2 along each pixel's ray, dimmed by what particles nearer to the camera
    and to the lamp cover. Single scattering.
    """
    density = COUNT / ((2 * HALF_M) ** 2 * (FAR_M - NEAR_M))
    sigma = np.pi * RADIUS_M**2
    view = film.view_of(scene)
    fine = (np.arange(32) + 0.5) / 32 * view.width_px
    pixels = np.stack(np.meshgrid(fine, fine), axis=-1).reshape(-1, 2)
    _, directions = view.lens.rays(pixels)
    z = NEAR_M + (np.arange(400) + 0.5) / 400 * (FAR_M - NEAR_M)
    points = directions / directions[:, 2:] * z[:, None, None]
    step = (FAR_M - NEAR_M) / 400 / directions[:, 2]
    from_lamp = points - (LAMP_M, 0.0, 0.0)
    distance = np.linalg.norm(from_lamp, axis=-1)
    cosine = from_lamp[..., 2] / distance
    order = -np.log(2) / np.log(np.cos(np.radians(80.0)))
    angle = np.arccos(np.sum(from_lamp * -directions, axis=-1) / distance)
    inside = z[:, None] - NEAR_M
    covered = density * sigma * (inside / directions[:, 2] + inside / cosine)
    brought = cosine**order / distance**2 * phase_of_a_diffuse_sphere(angle) * np.exp(-covered)
    return float((density * sigma * REFLECTANCE * brought * step).sum(axis=0).mean() / 300.0)


def layers(scene: Scene, *, seed: int, samples: int, water=None) -> dict:
    built = build(scene, water=water, rig_poses=scene.rig.world_from_rig[None])
    return transport.layers(built, film.view_of(scene), samples_per_pixel=samples, batches=2, seed=seed)


CLEAR = scenes.water(absorption_per_m=1e-6, scattering_per_m=0.0)


def test_snow_scatters_back_what_as_many_diffuse_spheres_do(monkeypatch):
    """Setup: 6000 particles of 1 mm radius in a box before a black wall in clear water, 16 clouds by their seeds; light
    that was scattered once. Expected: the closed form over diffuse spheres, all of it backscatter. Tolerance: Monte
    Carlo over clouds, 1.5 % standard error; model: shadows of neighbours, 3 % (3.8 % of the view is covered). Negative
    controls: a Lambertian plate's phase function, and octahedra in the spheres (as wide as they), are refused."""
    from uwsim.render import integrator

    monkeypatch.setattr(integrator, "MOST_SEGMENTS", 1)
    found = []
    for seed in range(16):
        scene = scene_with(snow(seed=seed))
        black = scene.bodies[-1].model_copy(update={"reflectance": 0.0})
        scene = scene.model_copy(update={"bodies": (*scene.bodies[:-1], black)})
        image = layers(scene, seed=seed, samples=512, water=CLEAR)
        assert not np.any(image["direct"]) and not np.any(image["forward_scatter"])
        np.testing.assert_array_equal(image["radiance"], image["backscatter"])
        found.append(image["backscatter"].mean())
    expected = closed_form(scene)
    rule = {"max_relative_standard_error": 0.015, "model_tolerance": 0.03}
    assert_mean_matches(found, expected, **rule)
    print(f"mean over closed form: {np.mean(found) / expected:.4f}")
    rule["max_relative_standard_error"] = 0.03
    with pytest.raises(AssertionError, match="biased"):
        assert_mean_matches(found, expected * (3 / 2), **rule)  # 1 / pi x cosine, as of a disc across the light
    with pytest.raises(AssertionError, match="biased"):
        assert_mean_matches(found, expected * (np.sqrt(3) / np.pi), **rule)  # corners on the spheres


def test_snow_is_a_particle_and_no_scene():
    """Setup: snow before a wall, in water. Expected: layers sum to the radiance; what the wall sends back by a particle
    is forward scatter; the buffers and the water-free twin are those without snow, and the wall keeps its number.
    Negative control: the same picture with a plate for the snow has it in buffers and twin."""
    cloud, plain = scene_with(snow()), scene_with()
    view = film.view_of(cloud)
    image = layers(cloud, seed=1, samples=64, water=CLEAR)
    assert image["backscatter"].mean() > 0 and image["forward_scatter"].mean() > 0
    total = image["direct"] + image["forward_scatter"] + image["backscatter"]
    np.testing.assert_allclose(image["radiance"], total, rtol=1e-6)
    without = layers(plain, seed=1, samples=64, water=CLEAR)
    assert image["direct"].mean() < 0.99 * without["direct"].mean()  # some of it is covered
    twins = [layers(scene, seed=2, samples=64)["radiance"] for scene in (cloud, plain)]
    np.testing.assert_array_equal(*twins)
    buffers = [geometry.geometry(scene, view) for scene in (cloud, plain)]
    for name in buffers[0]:
        np.testing.assert_array_equal(buffers[0][name], buffers[1][name])
    assert set(np.unique(buffers[0]["instance"])) == {1}
    assert [number for number, _ in numbered(cloud.bodies)] == [1]
    plate = {"name": "plate", "kind": "rectangle", "width_m": 0.02, "height_m": 0.02, "reflectance": 0.6,
             "position_m": (0.0, 0.7, -100.0), "towards_m": (0.0, 0.0, -100.0)}  # fmt: skip
    assert set(np.unique(geometry.geometry(scene_with(plate), view)["instance"])) == {1, 2}


def test_no_particle_is_near_the_openings_and_the_others_stay():
    """Setup: snow around the rig. Expected: as drawn but for those nearer than `clear_m` to camera or lamp. Negative
    control: with a clear distance of nothing those are there too."""
    import mitsuba as mi

    def middles(clear_m):
        around = snow(low_m=(-0.2, -0.2, -100.2), high_m=(0.2, 0.2, -99.8), clear_m=clear_m)
        scene = scene_with(around)
        built = build(scene, water=CLEAR, rig_poses=scene.rig.world_from_rig[None])
        (shape,) = (one for one in built.scene.shapes() if one.id() in built.particles)
        vertices = np.array(mi.traverse(shape)["vertex_positions"]).reshape(-1, 6, 3)
        opened = openings(scene, rig_poses=scene.rig.world_from_rig[None])[0]
        drawn = pose.apply(scene.bodies[0].world_from_body, scene.bodies[0].particles()[0])
        apart = np.linalg.norm(drawn[:, None] - opened, axis=-1).min(axis=-1)
        return vertices.mean(axis=1), drawn, apart

    found, drawn, apart = middles(0.05)
    kept = drawn[apart >= 0.05 + 1.3468 * RADIUS_M]
    assert 0.005 * COUNT < COUNT - len(kept) < 0.1 * COUNT
    np.testing.assert_allclose(found, kept, atol=2e-5)  # float32 at 100 m
    assert len(middles(1e-6)[0]) > COUNT - 5


def test_the_number_comes_from_the_density_and_the_seed_names_the_cloud():
    one = MarineSnow.model_validate(snow(count=None, number_per_m3=1000.0))
    assert one.number == round(1000.0 * (2 * HALF_M) ** 2 * (FAR_M - NEAR_M))
    wide = MarineSnow.model_validate(snow(diameters_m=(1e-4, 1e-2)))
    middles, radii, _ = wide.particles()
    assert np.array_equal(middles, wide.particles()[0])
    assert not np.array_equal(middles, MarineSnow.model_validate(snow(seed=2)).particles()[0])
    assert np.log(radii).mean() == pytest.approx(np.log(0.5e-3), abs=0.06)  # log-uniform: sd 1.33 / sqrt(6000) x 3.5
    assert radii.min() > 0.5e-4 and radii.max() < 0.5e-2
