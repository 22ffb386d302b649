"""A flat water surface from below: Snell's window, total reflection, lamps in the mirror, and the furnace."""

import numpy as np
import pytest
from scipy import integrate

from tests.physics import scenes, slabs
from tests.references.monte_carlo import assert_mean_matches
from uwsim.optics.fresnel import slab
from uwsim.optics.natural_light import cardioidal_sky, sky_transmittance, upward_view
from uwsim.optics.phase import henyey_greenstein

INDEX = 1.34
HG = {"type": "hg", "g": 0.6}


@pytest.fixture(scope="module", autouse=True)
def _variant(llvm_spectral):
    pass


def floor(reflectance: float) -> dict:
    return {
        "name": "floor", "kind": "rectangle", "width_m": 300.0, "height_m": 300.0, "reflectance": reflectance,
        "position_m": [0.0, 0.0, -1.0],
    }  # fmt: skip


def open_water(*, sky: str = "uniform", reflectance: float = 0.5, absorption_per_m=0.0, scattering_per_m=0.0):
    water = slabs.tabulated(absorption_per_m=absorption_per_m, scattering_per_m=scattering_per_m, phase=HG)
    day = {"sky_irradiance_w_per_m2": np.pi, "sky": sky}
    return slabs.scene_under(day, water=water, bodies=(floor(reflectance),), refractive_index=INDEX)


@pytest.mark.parametrize(("kind", "sky"), [("uniform", np.ones_like), ("cardioidal", cardioidal_sky)])
def test_snells_window(kind, sky):
    """Setup: clear water over a grey floor below a sky, seen from 0.5 m at nine angles. Expected: n^2 T L_sky inside
    the window of 48.3 deg with the mirrored floor, outside it the floor by total reflection; the floor's radiance
    from the sky's transmittance t and the surface's internal reflectance 1 - t / n^2. Tolerance: Monte Carlo (0.4 %),
    model 2e-3. Negative control: without n^2, and a window one index unit of 0.01 off."""
    scene, reflectance = open_water(sky=kind), 0.5
    angles = np.radians([0.0, 20.0, 40.0, 45.0, 47.5, 48.1, 48.5, 60.0, 80.0])

    def expected(n):
        passed = sky_transmittance(n_water=n, sky=sky)
        back = 1 - sky_transmittance(n_water=n) / n**2
        down = np.pi * passed / (1 - reflectance * back)
        # a sky of irradiance pi: radiance 1 on average over its flux
        scale = 1.0 if kind == "uniform" else 9 / 7
        return upward_view(
            angles, sky=lambda zenith: scale * sky(zenith), n_water=n, upwelling_w_per_m2_sr=reflectance * down / np.pi
        )

    found = slabs.radiances_towards(scene, depth_m=0.5, cosines=np.cos(angles), seeds=8, count=20_000)
    rule = {"max_relative_standard_error": 0.004, "model_tolerance": 2e-3}
    assert_mean_matches(found, expected(INDEX), **rule)
    for wrong in (expected(INDEX) / INDEX**2, expected(INDEX + 0.01)):
        with pytest.raises(AssertionError, match="biased"):
            assert_mean_matches(found, wrong, **rule)


@pytest.mark.parametrize("scattering_per_m", [1.0, pytest.param(3.0, marks=pytest.mark.slow)])
def test_furnace_below_a_uniform_sky(scattering_per_m):
    """Setup: water that only scatters over a white floor, uniform sky of radiance 1. Expected: radiance n^2 in every
    direction at every depth, floor, water and surface invisible. Tolerance: Monte Carlo (0.4 %), model 2e-3.
    Negative control: absorption of 0.01 /m."""

    def seen(absorption_per_m):
        scene = open_water(reflectance=1.0, scattering_per_m=scattering_per_m, absorption_per_m=absorption_per_m)
        views = [
            slabs.radiances_towards(scene, depth_m=depth_m, cosines=[-1.0, -0.3, 0.2, 0.7, 1.0], seeds=8, count=40_000)
            for depth_m in (0.05, 0.6)
        ]
        return np.concatenate(views, axis=1)

    rule = {"max_relative_standard_error": 0.004, "model_tolerance": 2e-3}
    assert_mean_matches(seen(0.0), INDEX**2, **rule)
    with pytest.raises(AssertionError, match="biased"):
        assert_mean_matches(seen(0.01), INDEX**2, **rule)


ABSORPTION = 0.3
CAMERA_M, WALL_M = 1.5, 2.0


def night(*, lamp_depth_m: float, water: dict, baffle: bool, upwards_deg: float = 0.0):
    """A wall 2 m from an isotropic lamp of 1 W/sr, seen from 0.5 m at the lamp's depth; a baffle hides the lamp."""
    up = np.radians(upwards_deg)
    scene = slabs.scene_under({"sky_irradiance_w_per_m2": 1.0}, water=water, refractive_index=INDEX)
    black = {"kind": "rectangle", "width_m": 20.0, "reflectance": 0.0}
    bodies = [
        {
            "name": "wall", "kind": "rectangle", "width_m": 30.0, "height_m": 30.0, "reflectance": 0.5,
            "position_m": [0.0, WALL_M, -15.0], "towards_m": [0.0, 0.0, -15.0],
        }
    ]  # fmt: skip
    if baffle:
        place = {"position_m": [0.0, 1.0, -0.3 - 5.0], "towards_m": [0.0, 0.0, -5.3]}
        bodies.append(black | {"name": "baffle", "height_m": 10.0} | place)
    lamp = {
        "position_m": [0.0, -CAMERA_M * np.sin(up), -CAMERA_M * np.cos(up)], "look_at_m": [0.0, 0.0, 0.0],
        "radiant_intensity_w_per_sr": 1.0, "beam": {"angles_deg": [0.0, 180.0], "values": [1.0, 1.0]}, "spectrum": "E",
    }  # fmt: skip
    camera = {"width_px": 4, "height_px": 4, "horizontal_fov_deg": 0.2, "response": scenes.RESPONSE}
    rig = {
        "position_m": [0.0, CAMERA_M, -lamp_depth_m],
        "look_at_m": [0.0, CAMERA_M + np.cos(up), -lamp_depth_m + np.sin(up)],
        "camera": camera, "lamps": [lamp],
    }  # fmt: skip
    dark = {"spectrum": "E"}
    return scenes.Scene.model_validate(scene.model_dump() | {"bodies": bodies, "rig": rig, "daylight": dark})


def reflectance_below(angle_rad):
    total = INDEX * np.sin(angle_rad) >= 1
    inside = np.where(total, 0.0, angle_rad)
    return np.where(total, 1.0, 1 - slab(inside, n_in=INDEX, n_slab=1.0, n_out=1.0).transmittance)


@pytest.fixture
def one_segment(monkeypatch):
    from uwsim.render import integrator

    monkeypatch.setattr(integrator, "MOST_SEGMENTS", 1)


@pytest.mark.parametrize("lamp_depth_m", [1.4, 1.0, 0.8])
def test_wall_lit_by_way_of_the_surface(lamp_depth_m, one_segment):
    """Setup: isotropic lamp and a wall 2 m from it, its direct light behind a baffle; absorbing water; the light's
    angles at the surface are 36, 45 and 51 deg (total reflection). Expected: R(theta) I cos / d^2 exp(-c d) with the
    distance to the mirror image. Tolerance: Monte Carlo (0.2 %), model 3e-3 (narrow view). Negative control: 3 % more;
    and without baffle the direct light comes on top."""
    water = slabs.tabulated(absorption_per_m=ABSORPTION, scattering_per_m=0.0, phase=HG)
    distance = np.hypot(WALL_M, 2 * lamp_depth_m)
    angle = np.arctan2(WALL_M, 2 * lamp_depth_m)
    seen_m = WALL_M - CAMERA_M

    def radiance(share, length):
        return 0.5 / np.pi * share * WALL_M / length**3 * np.exp(-ABSORPTION * (length + seen_m)) * slabs.PER_NM

    def found(baffle):
        scene = night(lamp_depth_m=lamp_depth_m, water=water, baffle=baffle)
        return scenes.replicates(scene, water=scene.water.optical(), samples=256, count=8)

    mirrored, direct = radiance(reflectance_below(angle), distance), radiance(1.0, WALL_M)
    rule = {"max_relative_standard_error": 0.002, "model_tolerance": 3e-3}
    assert_mean_matches(found(True), mirrored, **rule)
    assert_mean_matches(found(False), mirrored + direct, **rule)
    with pytest.raises(AssertionError, match="biased"):
        assert_mean_matches(found(True), 1.03 * mirrored, **rule)


def test_wall_seen_by_way_of_the_surface(monkeypatch):
    """Setup: as above without baffle, the camera looks up by 30 deg: total reflection, then the wall. Expected: that
    point's radiance by lamp and mirror image, all of it direct: a reflection at the surface is no event. Tolerance:
    Monte Carlo (0.2 %), model 3e-3 (narrow view). Negative control: 3 % more; forward scatter is 0."""
    from uwsim.render import integrator

    monkeypatch.setattr(integrator, "MOST_SEGMENTS", 2)  # no light that the wall sends to the surface and back
    water = slabs.tabulated(absorption_per_m=ABSORPTION, scattering_per_m=0.0, phase=HG)
    depth_m, up = 0.1, np.radians(30.0)
    seen_m, wall_depth_m = (WALL_M - CAMERA_M) / np.cos(up), (WALL_M - CAMERA_M) * np.tan(up) - depth_m
    ways = [np.hypot(WALL_M, wall_depth_m - depth_m), np.hypot(WALL_M, wall_depth_m + depth_m)]
    parts = [0.5 / np.pi * WALL_M / way**3 * np.exp(-ABSORPTION * (way + seen_m)) * slabs.PER_NM for way in ways]

    scene = night(lamp_depth_m=depth_m, water=water, baffle=False, upwards_deg=30.0)

    def found(layer):
        return scenes.replicates(scene, water=scene.water.optical(), samples=256, count=8, layer=layer)

    rule = {"max_relative_standard_error": 0.002, "model_tolerance": 3e-3}
    assert_mean_matches(found("direct"), sum(parts), **rule)
    assert np.all(found("forward_scatter") == 0)
    with pytest.raises(AssertionError, match="biased"):
        assert_mean_matches(found("direct"), 1.03 * sum(parts), **rule)


@pytest.mark.parametrize("lamp_depth_m", [0.7, 0.25])
def test_light_of_the_mirror_image_scattered_once(lamp_depth_m, one_segment):
    """Setup: as above in scattering water, without baffle; the camera looks along the surface. Expected: the
    backscatter is the airlight integral of the lamp and of its mirror image, each place with its own Fresnel
    reflectance. Tolerance: Monte Carlo (0.5 %), model 3e-3. Negative control: the lamp alone."""
    a, b = 0.2, 0.5
    water = slabs.tabulated(absorption_per_m=a, scattering_per_m=b, phase=HG)
    scene = night(lamp_depth_m=lamp_depth_m, water=water, baffle=False)
    found = scenes.replicates(scene, water=scene.water.optical(), samples=2048, count=8, layer="backscatter")

    def along(s, mirrored):
        place = np.array([CAMERA_M + s, -lamp_depth_m])  # world y, z
        source = np.array([0.0, lamp_depth_m if mirrored else -lamp_depth_m])
        way = place - source
        length = np.linalg.norm(way)
        cosine = -way[0] / length  # light goes on to the camera, towards -y
        share = reflectance_below(np.arctan2(abs(way[0]), abs(way[1]))) if mirrored else 1.0
        phase = henyey_greenstein(cosine, g=HG["g"])
        return share * b * phase * np.exp(-(a + b) * (s + length)) / length**2 * slabs.PER_NM

    seen_m = WALL_M - CAMERA_M
    image, lamp = (integrate.quad(along, 0, seen_m, args=(m,), epsrel=1e-9, limit=500)[0] for m in (True, False))
    rule = {"max_relative_standard_error": 0.005, "model_tolerance": 3e-3}
    assert_mean_matches(found, lamp + image, **rule)
    with pytest.raises(AssertionError, match="biased"):
        assert_mean_matches(found, lamp, **rule)


def straight_down(scene, *, depth_m: float, seeds: int, count: int) -> np.ndarray:
    """Return layers and orders of the radiance seen straight down from a depth, (seeds, 5)."""
    import mitsuba as mi

    from uwsim.render.build import build
    from uwsim.render.integrator import LampWalk

    built = build(scene, water=scene.water.optical(), rig_poses=scene.rig.world_from_rig[None])
    walk, sampler, found = LampWalk(built), mi.load_dict({"type": "independent"}), []
    for seed in range(seeds):
        sampler.seed(seed, count)
        rays = mi.Ray3f(mi.Point3f(0.0, 0.0, -depth_m), mi.Vector3f(0.0, 0.0, -1.0))
        rays.time, rays.wavelengths = mi.Float(0.5), mi.Spectrum(*slabs.WAVELENGTHS_OF_RAYS_NM)
        found.append([np.array(layer).mean() for layer in walk(rays, sampler)])
    return np.array(found) / slabs.PER_NM


def test_light_of_the_sky_by_order_of_scattering():
    """Setup: scattering water over a grey floor below a uniform sky of radiance 1, seen straight down. Expected: what
    no particle scattered is albedo / pi x the integral of n^2 T exp(-c h / mu) mu over Snell's window, dimmed again;
    what one particle scattered back the integral of b p(-mu) over window and ray. Tolerance: Monte Carlo (1 %), model
    2e-3. Negative control: the layers with light of all orders."""
    a, b, reflectance, depth_m, floor_m = 0.3, 0.6, 0.5, 0.4, 1.0
    c, edge = a + b, np.sqrt(1 - 1 / INDEX**2)
    found = straight_down(
        open_water(reflectance=reflectance, absorption_per_m=a, scattering_per_m=b),
        depth_m=depth_m,
        seeds=16,
        count=160_000,
    )

    def sky(mu):
        return INDEX**2 * (1 - reflectance_below(np.arccos(mu)))

    def on_floor(mu):
        return 2 * np.pi * mu * sky(mu) * np.exp(-c * floor_m / mu)

    def on_ray(mu):
        rate, length = c * (1 + 1 / mu), floor_m - depth_m
        along = np.exp(-c * depth_m / mu) * (1 - np.exp(-rate * length)) / rate
        return 2 * np.pi * sky(mu) * b * henyey_greenstein(-mu, g=HG["g"]) * along

    unscattered = reflectance / np.pi * np.exp(-c * (floor_m - depth_m)) * integrate.quad(on_floor, edge, 1)[0]
    single = integrate.quad(on_ray, edge, 1)[0]
    rule = {"max_relative_standard_error": 0.01, "model_tolerance": 2e-3}
    assert_mean_matches(found[:, 3:], np.array([unscattered, single]), **rule)
    with pytest.raises(AssertionError, match="biased"):
        assert_mean_matches(
            found[:, [0, 2]], np.array([unscattered, single]), **rule | {"max_relative_standard_error": 0.05}
        )
