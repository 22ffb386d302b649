"""Spheres that shine by themselves: what reaches the camera straight, and what water scatters out of it.

Setup: the lit spheres of a marker layout, with next to no other light.
Expected: in water that only absorbs L exp(-c r), all of it direct; in water that scatters the image of Mitsuba's
`volpathmis` with area emitters on the same spheres, the halo beside the sphere in `forward_scatter`.
Tolerance: Monte Carlo of both, model (facets of the spheres: 0.1 %; float32).
"""

import dataclasses

import numpy as np
import pytest

from tests.physics import scenes
from tests.references.monte_carlo import assert_mean_matches
from uwsim.optics.spectrum import WAVELENGTHS_NM, band_mean
from uwsim.render import film, transport
from uwsim.render.build import body_shapes, build, integrator_description, numbered, spectrum
from uwsim.scene.models import Scene

RADIANCE = 6.0
RADIUS_M, AT_M = 0.05, 0.5


@pytest.fixture(scope="module", autouse=True)
def _variant(llvm_spectral):
    pass


def scene_of(*, aside_m: float = 0.0, fov_deg: float = 0.5, radiance: float = RADIANCE) -> Scene:
    """Return a sphere straight ahead, or `aside_m` to the right; the other three of its layout are out of reach."""
    values = scenes.wall(distance_m=1.0).model_dump()
    values["rig"]["camera"] |= {"horizontal_fov_deg": fov_deg}
    values["rig"]["lamps"] = [values["rig"]["lamps"][0] | {"radiant_intensity_w_per_sr": 1e-9}]
    centre = np.array([aside_m, AT_M, -100.0])
    values["bodies"] = [
        {
            "name": "markers", "kind": "marker_layout", "layout": "planar_4", "edge_m": 200.0,
            "sphere_radius_m": RADIUS_M, "position_m": tuple(centre - (100.0, 100.0, 0.0)),
            "radiance_w_per_m2_sr": radiance, "spectrum": "LED-B4",
        }
    ]  # fmt: skip
    return Scene.model_validate(values)


def test_straight_light_is_the_sphere_s_dimmed_by_the_water():
    """Negative control: 3 % more water in between."""
    scene, water = scene_of(), scenes.spectral_water(low_per_m=0.3, high_per_m=1.5)
    view = film.view_of(scene)
    built = build(scene, water=water, rig_poses=scene.rig.world_from_rig[None])
    found = [transport.layers(built, view, samples_per_pixel=1024, batches=2, seed=seed) for seed in range(8)]

    def expected(range_m):
        own = scene.bodies[0].glow["spheres"]
        return band_mean(own * np.exp(-water.absorption * range_m), view.response)

    assert not any(one[name].any() for one in found for name in ("forward_scatter", "backscatter"))
    means = np.stack([one["direct"].mean(axis=(0, 1)) for one in found])
    rule = {"max_relative_standard_error": 0.003, "model_tolerance": 2e-3}
    assert_mean_matches(means, expected(AT_M - RADIUS_M), **rule)
    with pytest.raises(AssertionError, match="biased"):
        assert_mean_matches(means, expected(1.03 * (AT_M - RADIUS_M)), **rule)
    assert band_mean(scene.bodies[0].glow["spheres"], np.ones((len(WAVELENGTHS_NM), 1)))[0] * 300 == pytest.approx(
        RADIANCE, rel=1e-3
    )


def with_emitters(scene: Scene, water):
    """Return the scene with area emitters on the spheres, for Mitsuba's integrator."""
    import mitsuba as mi

    built = build(scene, water=water, rig_poses=scene.rig.world_from_rig[None])
    ((_, body),) = numbered(scene.bodies)
    mesh = body_shapes(mi, body)["spheres"]
    light = {"type": "area", "radiance": spectrum(body.glow["spheres"])}
    parameters, properties = mi.traverse(mesh), mi.Properties()
    properties["bsdf"], properties["emitter"] = mesh.bsdf(), mi.load_dict(light)
    lit = mi.Mesh("lit", vertex_count=mesh.vertex_count(), face_count=mesh.face_count(), props=properties)
    copied = mi.traverse(lit)
    for key in ("vertex_positions", "faces"):
        copied[key] = parameters[key]
    copied.update()
    description = {"type": "scene", "integrator": integrator_description("volpathmis"), "lit": lit}
    return dataclasses.replace(built, scene=mi.load_dict(description, optimize=False))


def test_halo_is_that_of_the_reference_integrator():
    """Setup: view just beside the sphere's rim in water that scatters. Expected: the reference's mean, and that it is
    forward scatter. Negative control: a sphere 10 % brighter."""
    scene = scene_of(aside_m=0.075, fov_deg=2.0)
    view, water = film.view_of(scene), scenes.water(absorption_per_m=0.2, scattering_per_m=1.5, g=0.8)
    built = build(scene, water=water, rig_poses=scene.rig.world_from_rig[None])
    found = [transport.layers(built, view, samples_per_pixel=2048, batches=2, seed=seed) for seed in range(12)]
    other = with_emitters(scene, water)
    reference = np.stack(
        [
            transport.reference_radiance(other, view, samples_per_pixel=2048, batches=2, seed=100 + seed)[0].mean(
                (0, 1)
            )
            for seed in range(12)
        ]
    )
    means = np.stack([one["radiance"].mean(axis=(0, 1)) for one in found])
    forward = np.mean([one["forward_scatter"].mean() for one in found])
    assert forward > 0.999 * means.mean()
    expected = reference.mean(axis=0)
    print(f"{means.mean(axis=0)} +- {means.std(axis=0) / np.sqrt(12)}, reference {expected}")
    rule = {"max_relative_standard_error": 0.02, "model_tolerance": 5e-3}
    assert_mean_matches(expected + means - reference, expected, **rule)
    with pytest.raises(AssertionError, match="biased"):
        assert_mean_matches(expected + 1.1 * means - reference, expected, **rule)


def test_spheres_that_do_not_shine_change_nothing():
    """Expected: radiance 0 is the scene without it, to the last bit; and the spectrum is checked."""
    dark = scene_of(radiance=0.0)
    assert dark.bodies[0].glow == {}
    view = film.view_of(dark)
    built = build(dark, water=None, rig_poses=dark.rig.world_from_rig[None])
    assert (
        built.glowing == {}
        and transport.layers(built, view, samples_per_pixel=8, batches=2, seed=1)["direct"].max() < 1e-6
    )
    for spectrum_of, message in (("no-such-lamp", "no-such-lamp"), ({"wavelengths_nm": (400.0, 700.0),
                                                                     "values": (0.0, 0.0)}, "no power")):  # fmt: skip
        with pytest.raises(ValueError, match=message):
            type(dark.bodies[0]).model_validate(dark.bodies[0].model_dump() | {"spectrum": spectrum_of})
