"""Waters added to the scene's in layers, plumes and cells."""

import numpy as np
import pytest

from tests.physics import scenes, slabs
from tests.references.monte_carlo import assert_mean_matches, assert_two_samples_agree
from uwsim.render import film, transport
from uwsim.render.build import build

G = 0.0  # the stock integrator's tail is worst with a forward peak
PLUME = {"name": "cloud", "kind": "plume", "position_m": [0.1, 0.5, -2.0], "sigma_m": [0.16, 0.16, 0.08]}
LAYER = {"name": "murk", "kind": "layer", "top_water_depth_m": 2.06, "bottom_water_depth_m": 3.5}


@pytest.fixture(scope="module", autouse=True)
def _variant(llvm_spectral):
    pass


def grey(absorption_per_m: float, scattering_per_m: float, g: float = G) -> dict:
    return slabs.tabulated(
        absorption_per_m=absorption_per_m, scattering_per_m=scattering_per_m, phase={"type": "hg", "g": g}
    )


def scene_with(water: dict, added: tuple = ()):
    """Return a grey wall at 1 m, 2 m below the surface, lit from the side; four regions in view."""
    scene = scenes.wall(distance_m=1.0, lamp_m=(0.8, 0.1, 0.0)).model_dump()
    scene["rig"] |= {"position_m": (0.0, 0.0, -2.0), "look_at_m": (0.0, 1.0, -2.0)}
    scene["rig"]["camera"] |= {"horizontal_fov_deg": 40.0}
    wall = scene["bodies"][0] | {"position_m": (0.0, 1.0, -2.0), "towards_m": (0.0, 0.0, -2.0), "width_m": 2.0,
                                 "height_m": 2.0}  # fmt: skip
    return scenes.Scene.model_validate(scene | {"water": water, "added_water": added, "bodies": [wall]})


def quarters(scene, *, samples: int, count: int, medium=None) -> np.ndarray:
    """Return means over the quarters of the view, all bands together, (count, 4); by `volpathmis` with a `medium`."""
    view = film.view_of(scene)
    built = build(scene, water=scene.water.optical(), rig_poses=scene.rig.world_from_rig[None])
    found = []
    for seed in range(count):
        options = {"samples_per_pixel": samples, "batches": 2, "seed": seed + (1000 if medium else 0)}
        if medium is None:
            image = transport.layers(built, view, **options)["radiance"]
        else:
            import dataclasses

            image = transport.reference_radiance(dataclasses.replace(built, medium=medium), view, **options)[0]
        found.append(image.reshape(2, 2, 2, 2, 3).mean(axis=(1, 3, 4)).ravel())
    return np.array(found)


def assert_equal(found, reference, *, largest: float):
    """Paired differences of two estimators about the reference's mean; `largest` relative standard error."""
    mean = reference.mean(axis=0)
    assert_mean_matches(mean + found - reference, mean, max_relative_standard_error=largest, model_tolerance=3e-3)


def test_cells_of_one_kind_are_homogeneous_water(tmp_path):
    """Setup: a third of absorption and scattering in the scene's water, the rest in a grid of 3 x 4 x 5 cells around
    everything. Expected: the image in homogeneous water of the sum. Tolerance: Monte Carlo of both (0.7 %), model 3e-3.
    Negative control: 5 % more in the grid."""

    def in_grid(whole):
        np.save(tmp_path / "ones.npy", np.ones((3, 4, 5)))
        grid = {
            "name": "box", "kind": "grid", "file": str(tmp_path / "ones.npy"),
            "low_m": [-60.0, -60.0, -60.0], "high_m": [60.0, 60.0, 60.0], "water": grey(0.2 * whole, 0.4 * whole),
        }  # fmt: skip
        return quarters(scene_with(grey(0.1, 0.2), (grid,)), samples=1024, count=8)

    homogeneous = quarters(scene_with(grey(0.3, 0.6)), samples=1024, count=8)
    assert_equal(in_grid(1.0), homogeneous, largest=0.007)
    with pytest.raises(AssertionError, match="biased"):
        assert_equal(in_grid(1.1), homogeneous, largest=0.007)


def stock_medium(scene):
    """Return Mitsuba's `heterogeneous` medium with the same cells."""
    import mitsuba as mi

    from uwsim.scene.plumes import merged

    edges, shares = merged(scene.added_water)
    low, high = np.array([-2.0, -1.0, -4.0]), np.array([2.0, 3.0, 0.0])
    # cells of 2 cm, on whose edges those of layer and plume lie
    size = ((high - low) / 0.02).round().astype(int)
    middles = [lo + (np.arange(n) + 0.5) * 0.02 for lo, n in zip(low, size, strict=True)]
    index = [np.clip(np.searchsorted(e, m) - 1, 0, len(e) - 2) for e, m in zip(edges, middles, strict=True)]
    inside = [(m > e[0]) & (m < e[-1]) for e, m in zip(edges, middles, strict=True)]
    held = inside[0][:, None, None] & inside[1][None, :, None] & inside[2][None, None, :]
    attenuation = np.full(size, scene.water.optical().attenuation[0])
    for added, share in zip(scene.added_water, shares, strict=True):
        attenuation += added.water.optical().attenuation[0] * share[np.ix_(*index)] * held
    to_world = mi.ScalarTransform4f().translate(low.tolist()) @ mi.ScalarTransform4f().scale((high - low).tolist())
    grid = mi.VolumeGrid(attenuation.transpose(2, 1, 0).astype(np.float32)[..., None])
    return mi.load_dict(
        {
            "type": "heterogeneous",
            "sigma_t": {
                "type": "gridvolume", "grid": grid,
                "to_world": to_world, "filter_type": "nearest", "raw": True,
            },
            "albedo": {"type": "constvolume", "value": {"type": "uniform", "value": 2 / 3}},
            "phase": {"type": "hg", "g": G},
        }
    )  # fmt: skip


@pytest.mark.slow
def test_layer_and_plume_agree_with_the_stock_integrator():
    """Setup: a plume before and a layer below the axis of view, albedo 2/3 everywhere. Expected: the quarters of the
    image as by `volpathmis` in Mitsuba's `heterogeneous` medium with a grid of the same cells (`nearest`), by delta
    tracking. Tolerance: Monte Carlo of both (2 %), model 3e-3. Negative control: without the plume."""
    layer, plume = LAYER | {"water": grey(0.2, 0.4)}, PLUME | {"water": grey(0.8, 1.6)}
    scene = scene_with(grey(0.1, 0.2), (layer, plume))
    reference = quarters(scene, samples=16384, count=16, medium=stock_medium(scene))
    assert_two_samples_agree(quarters(scene, samples=1024, count=12), reference, largest=0.02)
    without = quarters(scene_with(grey(0.1, 0.2), (layer,)), samples=1024, count=12)
    with pytest.raises(AssertionError, match="biased"):
        assert_two_samples_agree(without, reference, largest=0.02)


def in_cells(scene, places: np.ndarray, length: np.ndarray) -> np.ndarray:
    """Return optical depths by quadrature over places (rays, steps, 3) in the cells of the scene's added waters."""
    from uwsim.scene.plumes import merged

    edges, shares = merged(scene.added_water)
    index = [np.clip(np.searchsorted(edges[k], places[..., k]) - 1, 0, len(edges[k]) - 2) for k in range(3)]
    within = np.all([(places[..., k] > edges[k][0]) & (places[..., k] < edges[k][-1]) for k in range(3)], axis=0)
    depth = scene.water.optical().attenuation[0] * length
    for added, share in zip(scene.added_water, shares, strict=True):
        depth += added.water.optical().attenuation[0] * (share[tuple(index)] * within).mean(axis=1) * length
    return depth


def test_depth_through_plume_and_layer():
    """Setup: 4000 random rays of finite length through a plume, a layer and water around. Expected: optical depths by
    quadrature (2000 steps) over the cells (5e-3, a step too many or few at an edge), and over the Gaussian itself
    (cells of a quarter of a standard deviation: 1 % of the plume's own depth on average, 6 % rms); the free path of
    any depth leads to that depth again (float32: 1e-4). Negative control: half the plume."""
    import mitsuba as mi

    from uwsim.render.medium import Medium

    scene = scene_with(grey(0.1, 0.2), (LAYER | {"water": grey(0.5, 1.0)}, PLUME | {"water": grey(1.0, 2.0)}))
    medium = Medium(build(scene, water=scene.water.optical(), rig_poses=scene.rig.world_from_rig[None]))
    k = medium.coefficients(mi.Spectrum(500.0))
    rng, count = np.random.default_rng(2), 4000
    start = rng.uniform([-0.6, -0.3, -2.6], [0.8, 1.3, -1.4], (count, 3))
    end = np.array(PLUME["position_m"]) + rng.normal(size=(count, 3)) * 0.4
    way = end - start
    length = np.linalg.norm(way, axis=1)
    way /= length[:, None]
    origin, direction, reach = mi.Point3f(start.T), mi.Vector3f(way.T), mi.Float(length)
    found = np.array(medium.depth(k, origin, direction, reach, mi.Bool(True)))[0]

    steps = (np.arange(2000) + 0.5) / 2000
    places = start[:, None] + (length[:, None] * steps)[..., None] * way[:, None]
    offset = (places - PLUME["position_m"]) / PLUME["sigma_m"]
    inside = np.all(np.abs(offset) < 3, axis=-1)
    cloud = 3.0 * (np.exp(-0.5 * (offset**2).sum(axis=-1)) * inside).mean(axis=1) * length
    murk = 1.5 * ((places[..., 2] < -2.06) & (places[..., 2] > -3.5)).mean(axis=1) * length
    truth = 0.3 * length + murk + cloud
    through = cloud > 0.1
    assert through.sum() > 500
    error = (found - truth)[through] / cloud[through]
    assert abs(error.mean()) < 0.01
    assert np.sqrt(np.mean(error**2)) < 0.06
    np.testing.assert_allclose(found, in_cells(scene, places, length), atol=5e-3)
    assert abs((found - truth + 0.5 * cloud)[through] / cloud[through]).mean() > 0.4

    asked = mi.Float(rng.uniform(0.01, 5, count))
    path = medium.free_path(k, 0, origin, direction, asked, mi.Bool(True))
    again = medium.depth(k, origin, direction, path, mi.Bool(True))[0]
    np.testing.assert_allclose(np.array(again), np.array(asked), rtol=1e-4, atol=1e-5)


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_rays_along_the_edges_of_cells(axis, sign, tmp_path):
    """Setup: rays along the world's axes, with zeros of both signs, that start on edges and corners of cells. Expected:
    the whole column in every case. Round-off 1e-5."""
    import mitsuba as mi

    from uwsim.render.medium import Medium

    np.save(tmp_path / "ones.npy", np.ones((4, 4, 4)))
    grid = {
        "name": "box", "kind": "grid", "file": str(tmp_path / "ones.npy"),
        "low_m": [-2.0, -2.0, -4.0], "high_m": [2.0, 2.0, 0.0], "water": grey(0.5, 0.5),
    }  # fmt: skip
    scene = scene_with(grey(0.0, 0.0), (grid,))
    medium = Medium(build(scene, water=scene.water.optical(), rig_poses=scene.rig.world_from_rig[None]))
    k = medium.coefficients(mi.Spectrum(500.0))
    for zero in (0.0, -0.0):
        direction = np.full(3, zero)
        direction[axis] = sign
        for offset in (0.0, 0.5):
            start = np.array([offset, offset, -2.0 + offset])
            start[axis] = 0.0 if axis < 2 else -2.0
            depth = medium.depth(k, mi.Point3f(start), mi.Vector3f(direction), mi.Float(np.inf), mi.Bool(True))
            assert np.array(depth)[0] == pytest.approx(2.0, rel=1e-5), (start, direction)
