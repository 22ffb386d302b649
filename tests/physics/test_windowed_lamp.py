"""The lamp plugin behind a window gives the light of the exact flux tubes, and the energy that passed the glass."""

import numpy as np
import pytest

from tests.physics import lamp_plugin, scenes
from tests.physics.lamp_plugin import N_WATER, irradiance
from tests.references.monte_carlo import assert_mean_matches
from uwsim.optics import lamp_array, window_field
from uwsim.optics.window import water_intensity

COUNT = 20_000
IES = """IESNA:LM-63-2002
TILT=NONE
1 -1 1.0 10 5 1 2 0 0 0
1 1 10
0 10 20 30 40 50 60 70 80 90
0 90 180 270 360
900 880 800 700 560 400 250 120 40 0
900 860 760 600 400 240 120 40 10 0
900 890 850 800 700 560 400 220 90 0
900 870 780 650 480 330 180 80 20 0
900 880 800 700 560 400 250 120 40 0
"""
WINDOWS = {
    "thin air gap": {"air_gap_m": 0.001, "thickness_m": 0.003, "radius_m": 0.03},
    "usual": {"air_gap_m": 0.008, "thickness_m": 0.006, "radius_m": 0.03, "glass_absorption_per_m": 4.0},
    "acrylic, thick": {"air_gap_m": 0.03, "thickness_m": 0.02, "radius_m": 0.05, "n_glass": 1.49},
    "no glass": {"air_gap_m": 0.01, "thickness_m": 0.0, "radius_m": 0.02},
}


@pytest.fixture(scope="module", autouse=True)
def _variant(llvm_spectral):
    pass


def places(*, front_m, seed=1, count=COUNT):
    """Points (n, 3) float32 at depths 1 mm to 10 m before the front face, 0 to 3 depths from the axis."""
    rng = np.random.default_rng(seed)
    depth, turn = 10 ** rng.uniform(-3, 1, count), rng.uniform(0, 2 * np.pi, count)
    lateral = depth * np.where(rng.random(count) < 0.7, rng.uniform(0, 3, count), 10 ** rng.uniform(-5, 0.4, count))
    return np.stack([lateral * np.cos(turn), lateral * np.sin(turn), front_m + depth], axis=1).astype(np.float32)


def exact(lamp, points):
    """Return irradiance normal to the ray (n,), and the field, of the first LED of a lamp behind a flat window."""
    first = lamp.emitters[0]
    field = window_field.exact_field(
        first.beam, lamp.window.optical(n_water=N_WATER), lateral_m=points[:, :2].astype(float),
        depth_m=points[:, 2].astype(float) - lamp.window.front_m, emitter_m=first.position_m,
        calibration=lamp.window.calibration,
    )  # fmt: skip
    return field.irradiance_w_per_m2 / np.cos(field.water_angle_rad), field


@pytest.mark.parametrize("calibration", ["bare", "through_window"])
@pytest.mark.parametrize("window", WINDOWS.values(), ids=WINDOWS)
def test_irradiance_is_that_of_the_exact_flux_tubes(window, calibration):
    """Setup: 20,000 points, depths 1 mm to 10 m, to 3 depths beside the axis. Expected: `exact_field`, and its path.
    Tolerance: float32, 1e-4 (the worst are grazing rays: tangent in air 30 and more). Negative control: an air gap 1 %
    wider is seen."""
    lamp = lamp_plugin.lamp(window=window | {"calibration": calibration}, half_angle_deg=60.0)
    points = places(front_m=lamp.window.front_m)
    found, ds = irradiance(lamp_plugin.emitter(lamp), points)
    truth, field = exact(lamp, points)
    lit = (truth > 0) & (found > 0)
    assert np.sum((truth > 0) != (found > 0)) <= 2  # rays through the very edge
    assert 0.3 < lit.mean() < 0.95
    assert np.abs(found[lit] / truth[lit] - 1).max() < 1e-4
    assert np.abs(ds.dist.numpy()[lit] / field.path_m[lit] - 1).max() < 2e-6
    other = lamp_plugin.lamp(window=window | {"air_gap_m": 1.01 * window["air_gap_m"]}, half_angle_deg=60.0)
    assert np.abs(irradiance(lamp_plugin.emitter(other), points)[0][lit] / truth[lit] - 1).max() > 1e-3


def test_light_leaves_through_the_aperture_alone():
    """Setup: points on rays through the outer face within 1 % of the aperture's edge, LED 5 mm off the axis.
    Expected: lit inside, dark outside; `ds.p` is the point on the face (round-off 1e-6 m); dark on and behind the
    face."""
    lamp = lamp_plugin.lamp(
        window=WINDOWS["usual"], half_angle_deg=60.0, array={"kind": "ring", "count": 4, "radius_m": 0.005}
    )
    plugin = lamp_plugin.emitter(lamp)
    window = lamp.window.optical(n_water=N_WATER)
    rng = np.random.default_rng(4)
    turn = rng.uniform(0, 2 * np.pi, COUNT)
    edge = rng.uniform(0.99, 1.01, COUNT)
    exits = 0.03 * edge[:, None] * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    offset = exits - lamp.emitters[0].position_m
    radius = np.linalg.norm(offset, axis=1)
    tangent = window_field.air_tangent(window, radius_m=radius, depth_m=np.zeros(COUNT))
    slope = np.tan(window.water_angle_rad(np.arctan(tangent)))
    depth = 10 ** rng.uniform(-2, 0, COUNT)
    across = exits + offset * (slope * depth / radius)[:, None]
    points = np.concatenate([across, (lamp.window.front_m + depth)[:, None]], axis=1)
    found, ds = irradiance(plugin, points, state=(0.125, 0.5))
    clear = np.abs(edge - 1) > 1e-4
    np.testing.assert_array_equal((found > 0)[clear], (edge < 1)[clear])
    entry = ds.p.numpy().T[found > 0]
    assert np.abs(entry[:, :2] - exits[found > 0]).max() < 3e-6
    assert np.abs(entry[:, 2] - lamp.window.front_m).max() < 1e-7
    behind = np.array([[0, 0, lamp.window.front_m], [0.1, 0, 0.005], [0, 0, -1]])
    assert not irradiance(plugin, behind)[0].any()


@pytest.fixture
def ies_file(tmp_path):
    path = tmp_path / "lopsided.ies"
    path.write_text(IES)
    return str(path)


@pytest.mark.parametrize("windowed", [True, False])
def test_a_ring_of_lopsided_beams_is_the_sum_of_its_leds(ies_file, windowed):
    """Setup: 5 tilted LEDs with a profile that depends on the azimuth, with and without a window. Expected: mean over
    the LEDs of the plugin = sum of their fields. Tolerance: 3e-4 (float32 1e-4, azimuths tabulated by degrees).
    Negative control: the same ring turned by 20 degrees."""
    values = {
        "half_angle_deg": None,
        "ies": ies_file,
        "array": {"kind": "ring", "count": 5, "radius_m": 0.008, "outward_tilt_deg": 20.0},
        "window": WINDOWS["usual"] if windowed else None,
    }
    lamp = lamp_plugin.lamp(**values)
    points = places(front_m=lamp.rig_from_front[2, 3], count=4000)
    points = points[np.hypot(points[:, 0], points[:, 1]) < 1.5 * (points[:, 2] - lamp.rig_from_front[2, 3])]

    def ring(made):
        return np.mean([irradiance(lamp_plugin.emitter(made), points, state=((k + 0.5) / 5, 0.5))[0] for k in range(5)],
                       axis=0)  # fmt: skip

    if windowed:
        # `array_irradiance` sums on the plane; its rays differ in angle, and so each is divided by its own cosine
        one_by_one = []
        for single in lamp.emitters:
            made = window_field.exact_field(
                single.beam, lamp.window.optical(n_water=N_WATER), lateral_m=points[:, :2].astype(float),
                depth_m=points[:, 2] - lamp.window.front_m, emitter_m=single.position_m,
            )  # fmt: skip
            one_by_one.append(made)
        truth = sum(field.irradiance_w_per_m2 / np.cos(field.water_angle_rad) for field in one_by_one)
        on_plane = lamp_array.array_irradiance(
            lamp.emitters, lamp.window.optical(n_water=N_WATER), lateral_m=points[:, :2].astype(float),
            depth_m=points[:, 2] - lamp.window.front_m,
        )  # fmt: skip
        np.testing.assert_allclose(sum(field.irradiance_w_per_m2 for field in one_by_one), on_plane)
    else:
        offsets = [points - np.array([*single.position_m, 0.0]) for single in lamp.emitters]
        truth = sum(
            single.beam.intensity(offset / np.linalg.norm(offset, axis=1)[:, None]) / np.sum(offset**2, axis=1)
            for single, offset in zip(lamp.emitters, offsets, strict=True)
        )
    bright = truth > 1e-3 * (truth * points[:, 2] ** 2).max() / points[:, 2] ** 2
    assert bright.mean() > 0.5
    worst = np.abs(ring(lamp)[bright] / truth[bright] - 1)
    assert np.quantile(worst, 0.999) < 3e-4
    turned = lamp_plugin.emitter(lamp, poses=lamp_plugin.lamp(roll_deg=20.0).rig_from_lamp[None] @ np.eye(4))
    wrong = np.mean([irradiance(turned, points, state=((k + 0.5) / 5, 0.5))[0] for k in range(5)], axis=0)
    assert np.quantile(np.abs(wrong[bright] / truth[bright] - 1), 0.9) > 1e-2


@pytest.mark.parametrize("calibration", ["bare", "through_window"])
def test_a_dome_neither_bends_nor_shifts(calibration):
    """Setup: dome of 20 mm, aperture 70 degrees. Expected: `dome_field`, path from the outer face, dark inside it and
    beyond the aperture. Tolerance: float32 1e-5. Negative control: without the glass 4 % more."""
    lamp = lamp_plugin.lamp(window={"kind": "dome", "inner_radius_m": 0.02, "thickness_m": 0.004,
                                    "half_aperture_deg": 70.0, "calibration": calibration})  # fmt: skip
    points = places(front_m=0.0, count=COUNT)
    points = points[np.linalg.norm(points, axis=1) > 0.0241]
    found, ds = irradiance(lamp_plugin.emitter(lamp), points)
    field = window_field.dome_field(
        lamp.emitters[0].beam, lamp.window.optical(n_water=N_WATER),
        lateral_m=points[:, :2].astype(float), depth_m=points[:, 2].astype(float),
    )  # fmt: skip
    truth = field.irradiance_w_per_m2 / np.cos(field.water_angle_rad)
    in_air = 1.0 if calibration == "bare" else lamp.window.optical(n_water=1.0).transmittance
    lit = truth > 0
    np.testing.assert_array_equal(found > 0, lit)
    assert 0.5 < lit.mean() < 0.97
    np.testing.assert_allclose(found[lit] * in_air, truth[lit], rtol=1e-4)
    np.testing.assert_allclose(ds.dist.numpy()[lit], field.path_m[lit], rtol=2e-6, atol=1e-8)
    assert not irradiance(lamp_plugin.emitter(lamp), [[0, 0, 0.023], [0.01, 0, 0.01]])[0].any()
    without, _ = irradiance(lamp_plugin.emitter(lamp_plugin.lamp()), points)
    assert np.all(np.abs(without[lit] * in_air / truth[lit] - 1) > 0.02)


@pytest.mark.parametrize("window", ["usual", "acrylic, thick"])
def test_energy_through_a_plane_in_the_water_is_what_passed_the_glass(window):
    """Setup: flux through a plane 0.2 m before the window by quadrature over the plugin. Expected: integral of
    I T over the cone of the aperture. Tolerance: 1e-4 (quadrature and float32). Negative control: without T, and
    without the factor cos of the plane."""
    lamp = lamp_plugin.lamp(window=WINDOWS[window], half_angle_deg=60.0)
    optical = lamp.window.optical(n_water=N_WATER)
    nodes, weights = np.polynomial.legendre.leggauss(400)
    angles = np.linspace(0, np.pi / 2 * 0.9999, 200_001)
    largest = float(np.interp(optical.radius_m, optical.exit_radius_m(angles), angles))
    edge = 0.2 * np.tan(optical.water_angle_rad(np.array(largest))) + optical.radius_m
    radius, width = 0.5 * edge * (nodes + 1), 0.5 * edge * weights
    points = np.stack([radius, 0 * radius, np.full(400, lamp.window.front_m + 0.2)], axis=1)
    found, ds = irradiance(lamp_plugin.emitter(lamp), points)
    cosine = np.abs(ds.d.numpy()[2])
    flux = 2 * np.pi * np.sum(found * cosine * radius * width)
    angle, share = 0.5 * largest * (nodes + 1), 0.5 * largest * weights
    emitted = 2 * np.pi * np.cos(angle) * np.sin(angle) * share
    assert flux == pytest.approx(np.sum(emitted * optical.transmittance(angle)), rel=1e-4)
    assert flux != pytest.approx(np.sum(emitted), rel=1e-2)
    assert 2 * np.pi * np.sum(found * radius * width) != pytest.approx(flux, rel=1e-2)


def test_the_source_seems_to_be_where_the_light_spreads_from():
    """Setup: points before a window. Expected: distance D to `source_seen_from` with E = I_w / D^2, I_w the intensity
    in the water; on the ray; on the axis: the paraxial image. Tolerance: float32 1e-4. Where it is dark: the image.
    Negative control: the LED itself is no such point."""
    import mitsuba as mi

    lamp = lamp_plugin.lamp(window=WINDOWS["usual"], half_angle_deg=60.0)
    plugin, optical = lamp_plugin.emitter(lamp), lamp.window.optical(n_water=N_WATER)
    points = places(front_m=lamp.window.front_m)
    source = plugin.source_seen_from(lamp_plugin.at(points), mi.Point2f(0.5)).numpy().T
    found, ds = irradiance(plugin, points)
    lit = found > 0
    _, field = exact(lamp, points)
    distance = np.linalg.norm(points.astype(float) - source, axis=1)
    intensity = water_intensity(lamp.emitters[0].beam, optical, water_angle_rad=field.water_angle_rad)
    np.testing.assert_allclose((found * distance**2)[lit], intensity[lit], rtol=2e-4)
    direction = (source - points) / distance[:, None]
    assert np.abs(np.sum(direction * ds.d.numpy().T, axis=1)[lit] - 1).max() < 1e-5
    image = [0, 0, lamp.window.front_m - optical.virtual_distance_m]
    np.testing.assert_allclose(source[~lit], np.tile(image, (np.sum(~lit), 1)), atol=1e-5)  # from 30 m
    axis = plugin.source_seen_from(lamp_plugin.at([[0, 0, 0.5]]), mi.Point2f(0.5)).numpy()[:, 0]
    np.testing.assert_allclose(axis, image, atol=1e-6)
    naive = np.linalg.norm(points, axis=1)
    assert np.median(np.abs((found * naive**2)[lit] / intensity[lit] - 1)) > 0.01


def test_the_lamp_moves_with_the_exposure():
    """Setup: two poses. Expected: at each half of the exposure the irradiance of the lamp at rest there, bit by bit
    near enough (1e-5); and another one at the other half."""
    lamp = lamp_plugin.lamp(window=WINDOWS["usual"])
    poses = np.stack([lamp_plugin.lamp(position_m=p, look_at_m=t).rig_from_lamp
                      for p, t in (((0, 0, 0), (0, 0.1, 1)), ((0.1, 0, 0), (0, 0, 1)))])  # fmt: skip
    points = places(front_m=0.2, count=500)
    both = lamp_plugin.emitter(lamp, poses=poses)
    first, second = (irradiance(both, points, time=time)[0] for time in (0.25, 0.75))
    for half, pose_there, other in ((first, poses[:1], second), (second, poses[1:], first)):
        still, _ = irradiance(lamp_plugin.emitter(lamp, poses=pose_there), points)
        np.testing.assert_allclose(half, still, rtol=1e-5)
        assert not np.allclose(other, still, rtol=1e-2)


def test_light_by_the_direction_alone_is_the_same():
    """Expected: `eval_direction` at what `sample_direction` returned gives its value again, to the last bit."""
    import mitsuba as mi

    lamp = lamp_plugin.lamp(window=WINDOWS["usual"], die_radius_m=0.002)
    plugin, reference = lamp_plugin.emitter(lamp), lamp_plugin.at(places(front_m=0.02, count=500))
    sample = mi.Point2f(np.random.default_rng(0).random((2, 500)).astype(np.float32))
    ds, value = plugin.sample_direction(reference, sample)
    np.testing.assert_array_equal(plugin.eval_direction(reference, ds).numpy(), value.numpy())


@pytest.mark.parametrize(
    ("other_count", "changes"),
    [
        (7, {}),
        (8, {"window": WINDOWS["usual"]}),
        (9, {"window": {"kind": "dome", "inner_radius_m": 0.02, "thickness_m": 0.003}}),
        (
            10,
            {
                "window": WINDOWS["usual"],
                "die_radius_m": 0.001,
                "array": {"kind": "ring", "count": 3, "radius_m": 0.01},
            },
        ),
    ],
    ids=["bare", "flat", "dome", "ring of discs"],
)
def test_other_numbers_are_no_other_kernel(changes, other_count):
    """Setup: the lamp again with another pose, intensity, beam, window, die and water. Expected: the same
    kernels, by their hash. Negative control: a lamp of another number of LEDs has others."""
    import drjit as dr
    import mitsuba as mi

    other = {
        "half_angle_deg": 35.0, "radiant_intensity_w_per_sr": 7.0, "spectrum": "D65",
        "window": {key: 1.1 * value if isinstance(value, float) else value
                   for key, value in changes.get("window", {}).items()} or None,
        "die_radius_m": 1.5 * changes.get("die_radius_m", 0),
        "array": changes.get("array") and changes["array"] | {"radius_m": 0.008, "outward_tilt_deg": 5.0},
    }  # fmt: skip

    def kernels(lamp, n_water, place_m):
        plugin = lamp_plugin.emitter(lamp, n_water=n_water, poses=scenes.rig_at(place_m)[None])
        dr.kernel_history_clear()
        reference = lamp_plugin.at(places(front_m=0.1, count=64))
        ray = mi.Ray3f(reference.p, mi.Vector3f(0, 0, -1), 0.0, reference.wavelengths)
        dr.eval(plugin.sample_direction(reference, mi.Point2f(reference.p.x, reference.p.y)), plugin.seen(ray),
                plugin.source_seen_from(reference, mi.Point2f(reference.p.x, reference.p.y)))  # fmt: skip
        return [kernel["hash"] for kernel in dr.kernel_history() if kernel["type"] == dr.KernelType.JIT]

    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        dr.kernel_history_clear()
        first = kernels(lamp_plugin.lamp(**changes), 1.34, 0.0)
        second = kernels(lamp_plugin.lamp(**other), 1.33, 0.3)
        third = kernels(lamp_plugin.lamp(array={"kind": "ring", "count": other_count, "radius_m": 0.02}), 1.34, 0.0)
    assert len(first) > 0
    assert second == first
    assert third != first


def test_in_absorbing_water_the_path_counts_from_the_window():
    """Setup: wall at 0.3 m in water of 2 /m, lit by a lamp 14 mm behind the outer face of its window, Mitsuba's own
    integrator. Expected: rho / pi x E x exp(-a (path in the water + 0.3 m)). Tolerance: Monte Carlo (wavelengths),
    model 2e-3 (rays start 0.2 mm before the wall; 0.2 deg view). Negative control: the path counted from the LED."""
    lamp = lamp_plugin.lamp(
        window=WINDOWS["usual"], position_m=(0.05, 0.0, 0.0), look_at_m=(0.05, 0.0, 1.0), half_angle_deg=50.0
    )
    scene = lamp_plugin.wall_lit_by(lamp, distance_m=0.3)
    water = scenes.water(absorption_per_m=2.0)
    found = scenes.replicates(scene, water=water, samples=1024, count=16, reference=True)
    field = window_field.exact_field(
        lamp.emitters[0].beam, lamp.window.optical(n_water=scene.water.refractive_index),
        lateral_m=np.array([-0.05, 0]), depth_m=np.array(0.3 - lamp.window.front_m), attenuation_per_m=2.0,
    )  # fmt: skip
    truth = 0.5 / np.pi * float(field.irradiance_w_per_m2) * np.exp(-2 * 0.3) / 300
    assert_mean_matches(found, np.full(3, truth), max_relative_standard_error=0.004, model_tolerance=2e-3)
    wrong = truth * np.exp(-2.0 * lamp.window.front_m)
    with pytest.raises(AssertionError, match="biased"):
        assert_mean_matches(found, np.full(3, wrong), max_relative_standard_error=0.004, model_tolerance=2e-3)
