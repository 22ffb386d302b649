"""A lamp of finite size: a disc is the same light as Mitsuba's own, and what a ray sees of it is what lights."""

import dataclasses

import numpy as np
import pytest

from tests.physics import lamp_plugin, scenes
from tests.physics.lamp_plugin import N_WATER, irradiance
from tests.references.monte_carlo import assert_mean_matches
from uwsim.optics import window_field
from uwsim.render import film, transport
from uwsim.render.build import build

WINDOW = {"air_gap_m": 0.01, "thickness_m": 0.005, "radius_m": 0.03, "glass_absorption_per_m": 3.0}
RING = {"kind": "ring", "count": 5, "radius_m": 0.01, "outward_tilt_deg": 20.0}
SIDE = 64


@pytest.fixture(scope="module", autouse=True)
def _variant(llvm_spectral):
    pass


def states(side=SIDE):
    """Places on a lamp, the middles of side x side cells: an even sum over its area."""
    first, second = np.meshgrid(*[(np.arange(side) + 0.5) / side] * 2)
    return first.ravel(), second.ravel()


def disc_irradiance(*, radius_m, lateral_m, depth_m):
    """Return the irradiance on a parallel plane of a disc of uniform radiance 1, closed form. [W/m^2]

    Source: Howell, A catalog of radiation heat transfer configuration factors, B-13.
    """
    across, high = lateral_m / depth_m, radius_m / depth_m
    wide = 1 + across**2 + high**2
    return np.pi / 2 * (1 - (wide - 2 * high**2) / np.sqrt(wide**2 - 4 * across**2 * high**2))


@pytest.mark.parametrize(("lateral_m", "depth_m"), [(0.0, 0.02), (0.03, 0.03), (0.05, 0.02), (0.1, 1.0)])
def test_a_lambertian_disc_has_the_form_factor_of_a_disc(lateral_m, depth_m):
    """Setup: disc of 2 cm, half angle 60 degrees, 4096 even places. Expected: closed form of a disc of radiance
    I / area. Tolerance: 2e-3 (the sum). Negative control: near by, a point of the same intensity is off by 5 %."""
    lamp = lamp_plugin.lamp(die_radius_m=0.02, half_angle_deg=60.0)
    points = np.tile([[lateral_m, 0.0, depth_m]], (SIDE**2, 1))
    found, ds = irradiance(lamp_plugin.emitter(lamp), points, state=states())
    on_plane = np.mean(found * np.abs(ds.d.numpy()[2]))
    truth = disc_irradiance(radius_m=0.02, lateral_m=lateral_m, depth_m=depth_m) / (np.pi * 0.02**2)
    assert on_plane == pytest.approx(truth, rel=2e-3)
    squared = lateral_m**2 + depth_m**2
    point = (depth_m / np.sqrt(squared)) ** 2 / squared
    assert (abs(point / truth - 1) > 0.05) == (depth_m < 0.5)


def test_a_state_is_always_the_same_place_and_all_places_are_met_alike():
    """Expected: the LEDs in equal shares, on each the moments of a disc (r^2 / 4 per axis); the same state twice gives
    the same place. Tolerance: 2 % of the moments (4096 places)."""
    import mitsuba as mi

    lamp = lamp_plugin.lamp(die_radius_m=0.004, array={"kind": "grid", "rows": 2, "columns": 2, "pitch_m": 0.02})
    plugin, points = lamp_plugin.emitter(lamp), np.tile([[0.3, 0.1, 1.0]], (SIDE**2, 1))
    _, ds = irradiance(plugin, points, state=states())
    _, again = irradiance(plugin, points, state=states())
    np.testing.assert_array_equal(ds.p.numpy(), again.p.numpy())
    place = ds.p.numpy().T[:, :2]
    quadrant = (place[:, 0] > 0) * 2 + (place[:, 1] > 0)
    np.testing.assert_array_equal(np.bincount(quadrant), SIDE**2 / 4)
    inside = place - np.array([[-0.01, -0.01], [-0.01, 0.01], [0.01, -0.01], [0.01, 0.01]])[quadrant]
    assert np.hypot(*inside.T).max() <= 0.004 * (1 + 1e-5)
    np.testing.assert_allclose(np.cov(inside.T), np.eye(2) * 0.004**2 / 4, atol=0.02 * 0.004**2 / 4)
    default, _ = plugin.sample_direction(lamp_plugin.at(points[:1]), mi.Point2f(0.5))  # what older callers pass
    assert np.isfinite(default.dist.numpy()).all()


def test_every_place_of_a_disc_behind_a_window_is_a_point_lamp_there():
    """Setup: disc of 5 mm behind a window, 4096 places, one point 1 to 20 cm away. Expected: `exact_field` of a point
    lamp shifted to that place. Tolerance: float32 1e-4. Negative control: of one in the middle."""
    lamp = lamp_plugin.lamp(die_radius_m=0.005, window=WINDOW)
    bare = lamp_plugin.lamp(die_radius_m=0.005)
    optical, count = lamp.window.optical(n_water=N_WATER), SIDE**2
    rng = np.random.default_rng(6)
    depth = 10 ** rng.uniform(-2, -0.7, count)
    points = np.stack([*(rng.uniform(-1, 1, (2, count)) * depth), 0.015 + depth], axis=1).astype(np.float32)
    place = irradiance(lamp_plugin.emitter(bare), points, state=states())[1].p.numpy().T
    found, _ = irradiance(lamp_plugin.emitter(lamp), points, state=states())

    def truth(shift):
        # the aperture of an exact field stands before its own lamp: here without one
        field = window_field.exact_field(
            lamp.emitters[0].beam, dataclasses.replace(optical, radius_m=np.inf), lateral_m=points[:, :2] - shift,
            depth_m=points[:, 2].astype(float) - 0.015,
        )  # fmt: skip
        return field.irradiance_w_per_m2 / np.cos(field.water_angle_rad)

    lit = found > 0
    assert lit.mean() > 0.5
    np.testing.assert_allclose(found[lit], truth(place[:, :2].astype(float))[lit], rtol=1e-4)
    assert np.median(np.abs(found[lit] / truth(np.zeros(2))[lit] - 1)) > 0.01


CASES = {
    "bare disc": {"half_angle_deg": 50.0, "die_radius_m": 0.01},
    "disc behind a window": {"half_angle_deg": 50.0, "die_radius_m": 0.006, "window": WINDOW},
    "calibrated through it": {"die_radius_m": 0.006, "window": WINDOW | {"calibration": "through_window"}},
    "ring behind a window": {"half_angle_deg": 40.0, "die_radius_m": 0.003, "window": WINDOW, "array": RING},
    "bare ring": {"half_angle_deg": 40.0, "die_radius_m": 0.003, "array": RING},
}


@pytest.mark.parametrize("case", CASES.values(), ids=CASES)
@pytest.mark.parametrize("place_m", [(0.01, 0.005, 0.05), (0.05, -0.02, 0.2)])
def test_what_rays_see_is_what_lights(case, place_m):
    """Setup: radiance of 8 x 400,000 rays from a place to the exit aperture (or the plane of the LEDs), weighted by
    solid angle. Expected: the irradiance of the same lamp, mean over 4096 places on it (those of a ring cut at its
    LEDs). Tolerance: Monte Carlo; model 2e-3 (the sum over places). Negative control: radiance without n^2."""
    lamp = lamp_plugin.lamp(**case)
    plugin = lamp_plugin.emitter(lamp)
    front, radius = (WINDOW["air_gap_m"] + WINDOW["thickness_m"], 0.03) if lamp.window else (0.0, 0.015)
    side = 80
    points = np.tile([place_m], (side**2, 1))
    truth = np.mean(irradiance(plugin, points, state=states(side))[0])

    def from_seen(seed, count=400_000):
        rng = np.random.default_rng(seed)
        turn, out = rng.uniform(0, 2 * np.pi, count), radius * np.sqrt(rng.random(count))
        aim = np.stack([out * np.cos(turn), out * np.sin(turn), np.full(count, front)], axis=1)
        offset = aim - place_m
        length = np.linalg.norm(offset, axis=1)
        direction = offset / length[:, None]
        distance, radiance = lamp_plugin.seen(plugin, place_m, direction)
        met = np.isfinite(distance)
        if lamp.window:
            np.testing.assert_allclose(distance[met], length[met], rtol=1e-5)
        np.testing.assert_array_equal(radiance > 0, met)
        # the tilted discs of the bare ring stand up to 1 mm out of the plane aimed at: `radius` is wide enough for them
        return np.mean(radiance * np.pi * radius**2 * -direction[:, 2] / length**2)

    found = np.array([from_seen(seed) for seed in range(8)])
    assert_mean_matches(found, truth, max_relative_standard_error=0.01, model_tolerance=2e-3)
    if lamp.window:
        with pytest.raises(AssertionError, match="biased"):
            assert_mean_matches(found / N_WATER**2, truth, max_relative_standard_error=0.01, model_tolerance=2e-3)


def test_radiance_on_the_axis_and_misses():
    """Expected: T n^2 I / area on the axis of a disc behind a window, I / area without; nothing beside the disc, from
    behind, in total reflection or for a point. Tolerance: float32 1e-5."""
    bare, behind = (
        lamp_plugin.lamp(die_radius_m=0.005, window=window, half_angle_deg=60.0) for window in (None, WINDOW)
    )
    for lamp, path, gain in (
        (bare, 0.5, 1.0),
        (behind, 0.485, float(behind.window.optical(n_water=N_WATER).radiance_ratio(0.0))),
    ):
        plugin = lamp_plugin.emitter(lamp)
        origin = np.array([[0, 0, 0.5], [0, 0, 0.5], [0, 0, -0.5], [0.02, 0, 0.5]])
        direction = np.array([[0, 0, -1], [0, 0, 1], [0, 0, 1], [0, 0, -1]])
        distance, radiance = lamp_plugin.seen(plugin, origin, direction)
        np.testing.assert_allclose(distance, [path, np.inf, np.inf, np.inf], rtol=1e-6)
        np.testing.assert_allclose(radiance, [gain / (np.pi * 0.005**2), 0, 0, 0], rtol=1e-5)
    steep = np.array([[np.sin(0.9), 0, -np.cos(0.9)]])  # beyond the critical angle, 48 degrees
    distance, radiance = lamp_plugin.seen(lamp_plugin.emitter(behind), -steep * 0.02 + [0, 0, 0.015], steep)
    assert not np.isfinite(distance).any() and not radiance.any()
    distance, radiance = lamp_plugin.seen(lamp_plugin.emitter(lamp_plugin.lamp()), [[0, 0, 0.5]], [[0, 0, -1]])
    assert not np.isfinite(distance).any() and not radiance.any()


DIE_M, LAMP_M, WALL_M = 0.2, 0.3, 0.2


def wall(*, die_radius_m):
    lamp = lamp_plugin.lamp(
        position_m=(LAMP_M, 0.0, 0.0), look_at_m=(LAMP_M, 0.0, 1.0), half_angle_deg=60.0, die_radius_m=die_radius_m
    )
    return lamp_plugin.wall_lit_by(lamp, distance_m=WALL_M)


def stock_disc_replicates(*, water, samples, count=16):
    """Return means over the image, (count, 3), of the wall lit by Mitsuba's own disc of the same flux."""
    import mitsuba as mi

    from uwsim.render.build import _bodies, integrator_description

    scene = wall(die_radius_m=DIE_M)
    view, pose = film.view_of(scene), scene.rig.world_from_rig
    built = build(scene, water=water, rig_poses=pose[None])
    place = (pose @ scene.rig.lamps[0].rig_from_lamp) @ np.diag([DIE_M, DIE_M, 1, 1])
    description = {
        "type": "scene",
        "integrator": integrator_description("path" if built.medium is None else "volpathmis"),
        "disc": {
            "type": "disk",
            "to_world": mi.ScalarTransform4f(place),
            "bsdf": {"type": "diffuse", "reflectance": {"type": "uniform", "value": 0.0}},
            "emitter": {
                "type": "area",
                "radiance": {"type": "uniform", "value": float(1 / lamp_plugin.WIDTH_NM / (np.pi * DIE_M**2))},
            },
        },
    }
    if built.medium is not None:
        description["disc"] |= {"exterior": built.medium, "interior": built.medium}
    stock = dataclasses.replace(built, scene=mi.load_dict(description | _bodies(mi, scene), optimize=False))
    settings = {"samples_per_pixel": samples, "batches": 2}
    return np.stack(
        [transport.reference_radiance(stock, view, **settings, seed=seed)[0].mean(axis=(0, 1)) for seed in range(count)]
    )


@pytest.mark.parametrize(
    ("absorption_per_m", "scattering_per_m", "samples"),
    [(0.0, 0.0, 256), (0.5, 0.0, 256), pytest.param(0.1, 0.3, 512, marks=pytest.mark.slow)],
)
def test_a_wall_lit_by_a_disc_is_that_lit_by_mitsubas_own(absorption_per_m, scattering_per_m, samples):
    """Setup: wall at 20 cm, disc of 20 cm radius 30 cm beside the camera, without water, in absorbing and in scattering
    water, Mitsuba's path tracers for both. Expected: the same. Tolerance: Monte Carlo, two samples; model 2e-3
    (Mitsuba's rays start 0.2 mm before the wall). Negative control: a point in the disc's place."""
    water = scenes.water(absorption_per_m=absorption_per_m, scattering_per_m=scattering_per_m, g=0.5)
    water = None if absorption_per_m == 0 else water
    settings = {"water": water, "samples": samples, "count": 16}
    stock = stock_disc_replicates(**settings)
    ours = scenes.replicates(wall(die_radius_m=DIE_M), **settings, reference=True)
    point = scenes.replicates(wall(die_radius_m=0.0), **settings, reference=True)
    limits = {"max_relative_standard_error": 0.012, "model_tolerance": 2e-3}
    assert_mean_matches(ours / stock.mean(axis=0), 1.0, **limits)
    assert_mean_matches(stock / ours.mean(axis=0), 1.0, **limits)
    with pytest.raises(AssertionError, match="biased"):  # by a quarter
        assert_mean_matches(point / stock.mean(axis=0), 1.0, max_relative_standard_error=0.05)


@pytest.mark.parametrize("changes", [{}, {"array": {"kind": "grid", "rows": 1, "columns": 2, "pitch_m": 0.02}}])
def test_a_place_on_an_led_gets_no_light(changes):
    """Setup: a bare lamp, and one of two LEDs, asked about the place of the LED itself, as where a place of scattering
    is rounded onto it. Expected: zeros, and finite numbers. Negative control: a micrometre before it there is light."""
    plugin = lamp_plugin.emitter(lamp_plugin.lamp(**changes))
    led = lamp_plugin.lamp(**changes).lamp_from_led[0, :3, 3]
    found, ds = lamp_plugin.irradiance(plugin, led, state=(0.1, 0.5))
    assert found == [0.0]
    assert np.all(np.isfinite(ds.d.numpy())) and np.all(np.isfinite(ds.dist.numpy()))
    assert lamp_plugin.irradiance(plugin, led + [0, 0, 1e-6], state=(0.1, 0.5))[0] > 1e9
