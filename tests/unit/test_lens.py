"""One lens object for the pinhole in the water and for ports; what scenes say about ports and housings."""

import json

import numpy as np
import pytest

from tests.physics import scenes
from uwsim.camera import pinhole, port
from uwsim.camera.dome_port import DomePort
from uwsim.camera.flat_port import FlatPort, tilted_normal
from uwsim.camera.lens import Lens, lens_from_record, pixel_centres, port_record
from uwsim.camera.port import Status
from uwsim.scene.models import Scene

K = np.array([[500.0, 0, 330], [0, 510, 236], [0, 0, 1]])
DISTORTION = (-0.2, 0.05, 0.001, -0.002)
FLAT = FlatPort(
    gap_m=0.03, thickness_m=0.01, n_glass=1.5185, n_water=1.334, normal=tilted_normal(tilt_rad=0.2, azimuth_rad=0.7)
)
DOME = DomePort(inner_radius_m=0.05, thickness_m=0.005, n_glass=1.5, n_water=1.334, decentring_m=(0.003, -0.002, 0.006))
CENTRES = pixel_centres(width_px=64, height_px=48) * 10
EVERY = pytest.mark.parametrize("behind", [None, FLAT, DOME], ids=["pinhole", "flat", "dome"])


@EVERY
@pytest.mark.parametrize("coefficients", [(), DISTORTION], ids=["straight", "distorted"])
def test_a_point_on_a_ray_is_seen_in_the_ray_s_pixel(behind, coefficients):
    lens = Lens(K=K, coefficients=coefficients, port=behind)
    origins, directions = lens.rays(CENTRES)
    for range_m in (0.01, 1.0, 50.0):
        pixels, status = lens.project(origins + range_m * directions)
        assert np.all(status == Status.SEEN)
        assert np.abs(pixels - CENTRES).max() < 1e-8
    # negative control: a pinhole in the water at the same place sees the points elsewhere
    if behind is not None:
        seen = pinhole.project(origins + directions, K)
        assert np.median(np.linalg.norm(seen - CENTRES, axis=-1)) > 5


def test_without_port_and_distortion_it_is_the_pinhole_to_the_last_bit():
    lens = Lens(K=K)
    centres = pixel_centres(width_px=64, height_px=48)
    assert np.array_equal(lens.rays(centres)[1], pinhole.ray_directions(K, width_px=64, height_px=48))
    points = np.random.default_rng(1).normal(size=(100, 3)) + [0, 0, 2]
    assert np.array_equal(lens.project(points)[0], pinhole.project(points, K), equal_nan=True)
    assert np.all(lens.radiance_factor(centres) == 1)


def test_status_says_why_a_point_has_no_pixel():
    points = np.array([[0, 0, 1.0], [0, 0, -1.0], [np.nan, 0, 1.0], [0, 0, 0.01]])
    found = {name: Lens(K=K, port=p).project(points)[1].tolist() for name, p in (("none", None), ("flat", FLAT))}
    assert found["none"] == [Status.SEEN, Status.NO_PIXEL, Status.NOT_IN_WATER, Status.SEEN]
    assert found["flat"] == [Status.SEEN, Status.NOT_IN_WATER, Status.NOT_IN_WATER, Status.NOT_IN_WATER]


@pytest.mark.parametrize("behind", [FLAT, DOME], ids=["flat", "dome"])
def test_radiance_is_that_of_the_water_times_transmittance_over_the_index_squared(behind):
    lens = Lens(K=K, coefficients=DISTORTION, port=behind)
    expected = port.transmittance(CENTRES, port=behind, K=K, coefficients=DISTORTION) / 1.334**2
    assert lens.radiance_factor(CENTRES) == pytest.approx(expected, rel=1e-12)
    assert 0.5 < lens.radiance_factor(CENTRES).max() < 1 / 1.334**2


@EVERY
def test_the_record_of_a_frame_gives_the_lens_back(behind):
    lens = Lens(K=K, coefficients=DISTORTION, port=behind)
    record = {"K": K.tolist(), "distortion": DISTORTION, "port": port_record(behind)}
    found = lens_from_record(json.loads(json.dumps(record)))
    assert np.array_equal(found.rays(CENTRES)[1], lens.rays(CENTRES)[1])
    assert np.array_equal(found.radiance_factor(CENTRES), lens.radiance_factor(CENTRES))


def test_a_lens_without_a_ray_says_nan_and_not_a_number_made_up():
    lens = Lens(K=K, coefficients=(-0.5, 0, 0, 0))  # folds within the image
    directions = lens.rays(CENTRES)[1]
    assert np.isnan(directions[0, 0]).all() and np.isfinite(directions[24, 33]).all()
    assert np.isnan(lens.radiance_factor(CENTRES)[0, 0])


def scene_with(**camera) -> Scene:
    values = scenes.wall(distance_m=1.0).model_dump()
    values["rig"]["camera"] = {"width_px": 64, "height_px": 48, "horizontal_fov_deg": 60.0} | camera
    return Scene.model_validate({key: values[key] for key in ("name", "description", "water", "bodies", "exposure")} | {
        "rig": {key: values["rig"][key] for key in ("position_m", "look_at_m", "camera", "lamps")}
    })  # fmt: skip


def test_a_scene_s_lens_knows_port_distortion_and_water():
    assert scene_with().lens.port is None
    flat = {"kind": "flat", "gap_m": 0.03, "thickness_m": 0.01, "tilt_deg": 10.0, "azimuth_deg": 90.0}
    lens = scene_with(port=flat, distortion=(0.1, 0, 0, 0)).lens
    assert lens.coefficients == (0.1, 0, 0, 0)
    assert lens.port.n_glass == pytest.approx(1.5185, abs=1e-4)
    assert lens.port.n_water == scene_with().water.refractive_index
    assert lens.port.axis == pytest.approx([0, np.sin(np.radians(10)), np.cos(np.radians(10))])
    dome = {"kind": "dome", "inner_radius_m": 0.05, "thickness_m": 0.004, "decentring_m": (0.0, 0.0, 0.01)}
    assert scene_with(port=dome).lens.port.decentring_m == (0.0, 0.0, 0.01)


def test_the_front_face_is_where_the_water_begins():
    flat = {"kind": "flat", "gap_m": 0.03, "thickness_m": 0.01, "tilt_deg": 10.0, "azimuth_deg": 30.0}
    camera = scene_with(port=flat).rig.camera
    axis = camera.port.optical(n_water=1.33).axis
    assert camera.rig_from_front[:3, 2] == pytest.approx(axis, abs=1e-12)
    assert camera.rig_from_front[:3, 3] == pytest.approx(0.04 * axis)
    dome = {"kind": "dome", "inner_radius_m": 0.05, "thickness_m": 0.004, "decentring_m": (0.001, 0.0, 0.01)}
    assert scene_with(port=dome).rig.camera.rig_from_front[:3, 3] == pytest.approx([-0.001, 0, -0.01])
    assert np.array_equal(scene_with().rig.camera.rig_from_front, np.eye(4))


def test_a_housing_must_hold_the_view():
    flat = {"kind": "flat", "gap_m": 0.03, "thickness_m": 0.01}
    # corners: 0.03 m x 0.7217 in air (tan of the half diagonal) and 0.01 m x 0.4177 in glass
    scene_with(port=flat, housing={"radius_m": 0.026, "length_m": 0.2})
    with pytest.raises(ValueError, match=r"housing.radius_m: got 0.025 m, allowed: at least 0.02583"):
        scene_with(port=flat, housing={"radius_m": 0.025, "length_m": 0.2})
    scene_with(housing={"radius_m": 0.025, "length_m": 0.2})


@pytest.mark.parametrize(
    ("camera", "message"),
    [
        ({"distortion": (0.1, 0.2)}, "got 2 coefficients"),
        ({"port": {"kind": "flat", "gap_m": -0.1, "thickness_m": 0.01}}, "gap_m"),
        ({"port": {"kind": "round", "gap_m": 0.1, "thickness_m": 0.01}}, "flat"),
        (
            {"port": {"kind": "dome", "inner_radius_m": 0.01, "thickness_m": 0.0, "decentring_m": (0, 0.02, 0)}},
            "shorter",
        ),
    ],
)
def test_ports_that_cannot_be_are_refused(camera, message):
    with pytest.raises(ValueError, match=message):
        scene_with(**camera)
