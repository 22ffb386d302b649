"""Ports as sensors: where rendered rays go, what of the light they bring, and Mitsuba's own rendering through them."""

import dataclasses

import numpy as np
import pytest

from tests.physics import scenes
from tests.references.monte_carlo import assert_mean_matches
from uwsim.camera import pinhole, pose
from uwsim.camera.lens import Lens, pixel_centres
from uwsim.optics.spectrum import WAVELENGTHS_NM
from uwsim.render import film, geometry, transport
from uwsim.render.build import Built, build, exposure_poses, integrator_description
from uwsim.scene.models import Scene

WIDTH_PX, HEIGHT_PX = 64, 48
FLAT = {
    "kind": "flat", "gap_m": 0.03, "thickness_m": 0.012, "tilt_deg": 12.0, "azimuth_deg": 35.0,
    "glass_absorption_per_m": 5.0,
}  # fmt: skip
DOME = {
    "kind": "dome", "inner_radius_m": 0.05, "thickness_m": 0.005, "decentring_m": (0.004, -0.003, 0.008),
    "glass_absorption_per_m": 5.0,
}  # fmt: skip
BARREL = (-0.25, 0.06, 0.001, -0.002, 0.01)
PORTS = pytest.mark.parametrize("port", [FLAT, DOME], ids=["flat", "dome"])


@pytest.fixture(scope="module", autouse=True)
def _variant(llvm_spectral):
    pass


def scene_through(port: dict | None, *, distortion=BARREL, **camera) -> Scene:
    """A slanted wall 0.5 to 2 m before a wide camera near the origin."""
    values = scenes.wall(distance_m=1.0).model_dump()
    camera = {"width_px": WIDTH_PX, "height_px": HEIGHT_PX, "horizontal_fov_deg": 70.0} | camera
    wall = {
        "name": "wall", "kind": "rectangle", "width_m": 20.0, "height_m": 20.0, "reflectance": 0.5,
        "position_m": (0.1, 1.0, -1.0), "towards_m": (0.7, 0.0, -1.3),
    }  # fmt: skip
    rig = {"position_m": (0.1, 0.0, -1.0), "look_at_m": (0.1, 1.0, -1.0), "lamps": values["rig"]["lamps"]}
    rig["camera"] = camera | {"port": port, "distortion": distortion}
    kept = {key: values[key] for key in ("name", "description", "water", "exposure")}
    return Scene.model_validate(kept | {"rig": rig, "bodies": (wall,)})


def flat_response(view: film.View) -> film.View:
    """Return a view whose bands weigh all wavelengths alike, so that drawing them brings no noise."""
    flat = np.ones(len(WAVELENGTHS_NM))
    return dataclasses.replace(view, response=np.tile(flat[:, None], (1, 3)), importance=flat)


def hits(scene: Scene, places_px: np.ndarray, lens: Lens | None = None) -> np.ndarray:
    """Return where the sensor's rays through places (n, 2) [px] meet the wall, in the camera frame, (n, 3) [m]."""
    import mitsuba as mi

    view = film.view_of(scene)
    view = view if lens is None else dataclasses.replace(view, lens=lens)
    rig = scene.rig.world_from_rig
    built = build(scene, water=None, rig_poses=rig[None])
    sensor = mi.load_dict(film.sensor_description(view, rig[None]))
    rays, weight = sensor.rays(mi.Point2f(places_px.T.astype(np.float32)), mi.Float(0.5))
    met = built.scene.ray_intersect(rays)
    assert np.all(weight.numpy() > 0) and np.all(np.isfinite(met.t.numpy()))
    return pose.apply(pose.inverse(rig), met.p.numpy().T.astype(float))


@PORTS
def test_rendered_points_project_to_their_pixels(port):
    """Setup: distorted lens behind a tilted flat port and a decentred dome, slanted wall. Expected: what the rays of
    2000 places in the image meet is projected to those places by the exact port of uwsim.camera. Tolerance: 0.01 px
    (round-off of float32 at 1 m: 0.001 px). Negative control: a sensor of the same lens without the port."""
    scene = scene_through(port)
    places = np.random.default_rng(3).uniform(0, 1, (2000, 2)) * [WIDTH_PX, HEIGHT_PX]
    places = places.astype(np.float32).astype(float)

    def errors_px(lens=None):
        pixels, _ = scene.lens.project(hits(scene, places, lens))
        return np.linalg.norm(pixels - places, axis=-1)

    assert errors_px().max() < 0.01
    # negative control
    bare = dataclasses.replace(scene.lens, port=None)
    assert np.nanmedian(errors_px(bare)) > 1


@PORTS
def test_geometry_buffers_hold_the_path_in_the_water_and_the_depth_from_the_pinhole(port):
    """Expected: origin on the outer face + range x direction is the point seen: it projects to its pixel's centre
    (0.01 px), lies on the wall, and has `z_depth`. Negative control: `range` taken from the pinhole."""
    scene = scene_through(port)
    buffers = geometry.geometry(scene, film.view_of(scene))
    centres = pixel_centres(width_px=WIDTH_PX, height_px=HEIGHT_PX)
    origins, directions = scene.lens.rays(centres)
    points = origins + directions * buffers["range"][..., None]
    assert np.abs(points[..., 2] - buffers["z_depth"]).max() < 1e-5
    assert np.linalg.norm(scene.lens.project(points)[0] - centres, axis=-1).max() < 0.01
    body = pose.inverse(scene.bodies[0].world_from_body) @ scene.rig.world_from_rig

    def off_the_wall_m(found):
        return np.abs(pose.apply(body, found)[..., 2]).max()

    assert off_the_wall_m(points) < 1e-5
    assert off_the_wall_m(directions * buffers["range"][..., None]) > 0.01
    in_world = geometry.pixel_rays(scene, film.view_of(scene))
    assert pose.apply(scene.rig.world_from_rig, origins) == pytest.approx(in_world[0])


@PORTS
def test_uniform_radiance_is_seen_through_fresnel_and_the_index_squared(port):
    """Setup: radiance 1 from everywhere in the water. Expected per pixel: T (n_air / n_water)^2 by the exact port.
    Tolerance: 1e-3 per pixel (64 random places in a pixel, where T has a slope), 3e-5 in the mean. Negative controls:
    without T, without n^2."""
    import mitsuba as mi

    scene = scene_through(port)
    light = {"type": "constant", "radiance": {"type": "uniform", "value": 1.0}}
    description = {"type": "scene", "integrator": integrator_description("path"), "light": light}
    built = Built(mi.load_dict(description), None, scene.rig.world_from_rig[None])
    view = flat_response(film.view_of(scene))
    image, _ = transport.reference_radiance(built, view, samples_per_pixel=64, batches=2, seed=1)
    steps = (np.arange(8) + 0.5) / 8 - 0.5
    shifts = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 1, 1, 2)
    centres = pixel_centres(width_px=WIDTH_PX, height_px=HEIGHT_PX)
    expected = scene.lens.radiance_factor(centres + shifts).mean(axis=0)
    assert np.abs(image / expected[..., None] - 1).max() < 1e-3
    assert abs(np.mean(image / expected[..., None]) - 1) < 3e-5
    squared = scene.lens.index_factor
    assert squared == pytest.approx(1 / scene.water.refractive_index**2)
    assert np.abs(image[..., 0] / squared - 1).min() > 0.01
    assert np.abs(image[..., 0] / (expected / squared) - 1).min() > 0.4


def test_places_without_a_ray_are_black_and_finite():
    """A lens that folds within the image. Negative control: the middle of the image is lit."""
    import mitsuba as mi

    scene = scene_through(FLAT, distortion=(-0.9, 0.0, 0.0, 0.0))
    places = pixel_centres(width_px=WIDTH_PX, height_px=HEIGHT_PX).reshape(-1, 2)
    sensor = mi.load_dict(film.sensor_description(film.view_of(scene), np.eye(4)[None]))
    rays, weight = sensor.rays(mi.Point2f(places.T.astype(np.float32)), mi.Float(0.5))
    assert np.all(np.isfinite(rays.o.numpy())) and np.all(np.isfinite(rays.d.numpy()))
    expected = scene.lens.radiance_factor(places)
    assert 0.2 < np.mean(np.isnan(expected)) < 0.8
    assert np.array_equal(weight.numpy() > 0, np.isfinite(expected))
    buffers = geometry.geometry(scene, film.view_of(scene))
    assert np.array_equal(buffers["instance"].ravel() > 0, np.isfinite(expected))
    assert np.all(np.isfinite(buffers["normal"])) and np.all(
        np.isposinf(buffers["range"]) == (buffers["instance"] == 0)
    )


def test_pinhole_sensor_is_the_pinhole():
    """Rays of the plain camera against `pinhole.project`; round-off. Negative control: half a pixel off."""
    scene = scene_through(None, distortion=())
    places = np.random.default_rng(3).uniform(0, 1, (500, 2)) * [WIDTH_PX, HEIGHT_PX]
    found = pinhole.project(hits(scene, places), scene.lens.K)
    assert np.abs(found - places).max() < 1e-3
    assert np.abs(found - (places + 0.5)).min() > 0.4


@pytest.mark.parametrize("port", [None, FLAT, DOME], ids=["pinhole", "flat", "dome"])
def test_mitsuba_s_own_rendering_with_the_sensor_is_the_film_s(port):
    """Setup: rig in motion with a rolling shutter over a wall with an edge, absorbing water, volpathmis. Expected:
    `mi.render` with the sensor and its medium gives what the film gives with the same integrator. Tolerance: Monte
    Carlo, 1 % standard error, 4 regions, and that of the film's own image. Negative control: without the medium."""
    import mitsuba as mi

    scene = scene_through(port, width_px=16, height_px=12)
    wall = scene.bodies[0].model_copy(update={"width_m": 0.8})
    lamp = scene.rig.lamps[0].model_copy(update={"position_m": (0.3, 0.0, 0.2), "look_at_m": (0.2, 0.0, 1.2)})
    motion = {"velocity_m_per_s": (10.0, 3.0, 0.0)}
    rig = scene.rig.model_copy(update={"lamps": (lamp,)}).model_dump() | {"motion": motion}
    scene = Scene.model_validate(
        scene.model_dump() | {"bodies": (wall.model_dump(),), "rig": rig}
        | {"exposure": {"time_s": 0.01, "readout_s": 0.02}}
    )  # fmt: skip
    view = flat_response(film.view_of(scene))
    water = scenes.water(absorption_per_m=0.5)
    built = build(scene, water=water, rig_poses=exposure_poses(scene, steps=64)[1])
    expected, error = transport.reference_radiance(built, view, samples_per_pixel=4096, batches=16, seed=5)

    def stock(seed, medium):
        description = film.sensor_description(view, built.world_from_camera) | ({"medium": medium} if medium else {})
        description["film"] = {
            "type": "specfilm", "width": 16, "height": 12, "rfilter": {"type": "box"},
            "component_format": "float32",
            "flat": {"type": "regular", "wavelength_min": 400, "wavelength_max": 700, "values": "1, 1"},
        }  # fmt: skip
        image = mi.render(built.scene, sensor=mi.load_dict(description), spp=512, seed=seed)
        return image.numpy()[..., 0] / 300.0  # the film integrates over the wavelengths

    def regions(image):
        return image.reshape(2, 6, 2, 8).mean(axis=(1, 3))

    found = np.stack([regions(stock(seed, built.medium)) for seed in range(8)])
    expected, variance = regions(expected[..., 1]), regions(error[..., 1] ** 2) / 48
    own_error = float((np.sqrt(variance) / expected).max())
    assert own_error < 0.01
    assert_mean_matches(found, expected, max_relative_standard_error=0.01, model_tolerance=3 * own_error)
    assert np.all(np.abs(regions(stock(1, None)) / expected - 1) > 0.1)


@PORTS
def test_new_poses_lens_and_port_do_not_compile_anew(port):
    """Expected: the same kernels, by their hashes. Negative control: a pinhole has other ones."""
    import drjit as dr
    import mitsuba as mi

    def draw(view, poses):
        sampler = mi.load_dict({"type": "independent"})
        sampler.seed(mi.UInt32(1), 640)
        rays, weights = film.Film(view).rays(poses, sampler, 0, 10, 640, 3)
        with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
            dr.kernel_history_clear()
            dr.eval(rays, weights)
            return [kernel["hash"] for kernel in dr.kernel_history([dr.KernelType.JIT])]

    one = film.view_of(scene_through(port))
    first = draw(one, np.tile(np.eye(4), (3, 1, 1)))
    changed = {"flat": {"gap_m": 0.02, "tilt_deg": 3.0}, "dome": {"inner_radius_m": 0.06, "thickness_m": 0.01}}
    numbers = {"n_glass": 1.6, "glass_absorption_per_m": 1.0} | changed[port["kind"]]
    other = scene_through(port | numbers, distortion=(0.1, 0.02, 0.001, 0.0), horizontal_fov_deg=50.0)
    assert first and draw(film.view_of(other), np.tile(np.eye(4), (5, 1, 1))) == first
    assert draw(film.view_of(scene_through(None)), np.tile(np.eye(4), (3, 1, 1))) != first
