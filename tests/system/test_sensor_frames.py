"""Frames with the options of the sensor, from the scene to the files."""

import numpy as np
import pytest

from tests.physics import scenes
from uwsim.bench.task import linear_buffer
from uwsim.dataset.check import check_frame
from uwsim.dataset.frame import FILES, RAW, read_frame, write_frame
from uwsim.dataset.make import make_frame
from uwsim.scene.models import Scene

DIGITAL = {
    "white_balance": (1.2, 1.0, 1.5), "dark_current_e_per_s": 500.0, "prnu": 0.01, "dsnu_e": 2.0, "adc_bits": 12,
    "black_level_dn": 64, "mosaic": "RGGB", "demosaic": "edge_aware", "raw": True,
    "vignetting": {"cos4": True, "polynomial": (-0.05,)},
}  # fmt: skip


@pytest.fixture(scope="module", autouse=True)
def _variant():
    from uwsim.render import variants

    variants.use()


def made(folder, auto, *, sensor=DIGITAL):
    values = scenes.wall(distance_m=1.0).model_dump()
    values["rig"]["camera"] |= {"width_px": 12, "height_px": 10, "horizontal_fov_deg": 40.0}
    values["sensor"], values["exposure"] = sensor, {"time_s": 0.005, "f_number": 2.0, "auto": auto}
    settings = {"name": "frame", "group": "g", "seed": 0, "frame": 0, "samples_per_pixel": 8, "batches": 2}
    write_frame(folder / "frame", **make_frame(Scene.model_validate(values), **settings))
    frame = read_frame(folder / "frame")
    check_frame(frame)
    return frame


@pytest.mark.parametrize("auto", [{"adjust": "time", "target": 0.3}, {"adjust": "gain", "target": 0.3}, None])
def test_a_frame_with_raw_picture_and_auto_exposure(tmp_path, auto):
    frame = made(tmp_path, auto)
    entry = frame.info.sensor
    assert {path.name for path in frame.folder.iterdir()} == {*FILES, RAW}
    assert frame.raw.shape == (10, 12) and entry.mosaic == "RGGB"
    assert entry.dark_e == pytest.approx(500 * entry.exposure_time_s)
    assert entry.gain_dn_per_e == pytest.approx(entry.gain * (4095 - 64) / entry.full_well_e)
    bright = np.minimum(linear_buffer(frame, "radiance").mean(axis=-1), 1).mean()
    if auto is None:
        assert (entry.auto, entry.exposure_time_s, entry.gain) == (None, 0.005, 1.0)
        return
    assert bright == pytest.approx(entry.auto.reached, rel=1e-4)
    assert entry.auto.reached == pytest.approx(0.3, rel=1e-4)
    assert (entry.exposure_time_s != 0.005, entry.gain != 1.0) == (auto["adjust"] == "time", auto["adjust"] == "gain")


def test_a_frame_without_the_options_has_no_raw_picture(tmp_path):
    frame = made(tmp_path, None, sensor={"white_balance": (1.2, 1.0, 1.5)})
    assert {path.name for path in frame.folder.iterdir()} == set(FILES)
    assert frame.info.sensor.adc_bits is None and frame.info.sensor.gain_dn_per_e is None
