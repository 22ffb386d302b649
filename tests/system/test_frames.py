"""Frames of unusual scenes are complete and sound."""

import numpy as np
import pytest

from tests.physics import scenes
from uwsim.dataset.check import check_frame
from uwsim.dataset.frame import read_frame, write_frame
from uwsim.dataset.make import make_frame
from uwsim.scene.models import Scene


@pytest.fixture(scope="module", autouse=True)
def _variant():
    from uwsim.render import variants

    variants.use()


def scene(*, body_y_m=1.0, velocity=None, **water):
    values = scenes.wall(distance_m=1.0).model_dump()
    values["rig"]["camera"] |= {"width_px": 8, "height_px": 6, "horizontal_fov_deg": 40.0}
    values["rig"]["motion"] = velocity and {"velocity_m_per_s": velocity}
    values["bodies"] = [values["bodies"][0] | {"position_m": (0.0, body_y_m, -100.0), "width_m": 0.5, "height_m": 0.5}]
    values["water"] = {"name": "tank_clear"} | water
    return Scene.model_validate(values)


def made(tmp_path, scene, **options):
    settings = {"name": "frame", "group": "g", "seed": 0, "frame": 0, "samples_per_pixel": 8, "batches": 2} | options
    write_frame(tmp_path / "frame", **make_frame(scene, **settings))
    frame = read_frame(tmp_path / "frame")
    check_frame(frame)
    return frame


def test_a_moving_rig_that_sees_nothing(tmp_path):
    frame = made(tmp_path, scene(body_y_m=-1.0, velocity=(1.0, 0.0, 0.0)))
    assert frame.info.blur is None
    assert frame.buffer("sharp").shape == (6, 8, 3)
    assert not frame.buffer("instance").any()
    assert np.all(np.isinf(frame.buffer("range")))


def test_a_moving_rig_labels_its_motion(tmp_path):
    frame = made(tmp_path, scene(velocity=(2.0, 0.0, 0.0)))
    focal_px = frame.K[0, 0]
    assert frame.info.blur.length_px == pytest.approx(focal_px * 2.0 * 0.01 / 1.0, rel=1e-3)
    assert frame.info.blur.angle_deg % 180 == pytest.approx(0, abs=1e-3)
    flow = frame.buffer("flow_end") - frame.buffer("flow_start")
    assert np.all(flow[frame.buffer("instance") > 0][:, 0] < 0)  # the rig moves right, the picture moves left
    assert len(frame.info.camera.times_s) == 17


def test_black_water_and_a_murky_tank(tmp_path):
    """Transmission of a few parts in a billion stays above zero where a lit body is seen."""
    frame = made(tmp_path, scene(name="tank_high", particle_factor=1.5))
    seen = frame.buffer("instance") > 0
    assert np.all(frame.buffer("transmission")[seen] > 0)
    assert frame.buffer("transmission")[seen].max() < 1e-4


def test_the_same_frame_again_and_another_seed(tmp_path):
    first, again, other = (
        make_frame(scene(), name="f", group="g", seed=seed, frame=0, samples_per_pixel=8, batches=2)["buffers"]
        for seed in (3, 3, 4)
    )
    assert all(np.array_equal(first[name], again[name]) for name in first)
    assert not np.array_equal(first["radiance"], other["radiance"])
    assert np.array_equal(first["range"], other["range"])
