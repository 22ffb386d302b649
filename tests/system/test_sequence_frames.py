"""Sequences from the command line: sound, on their trajectory, the same bytes when gone on with; a pair of cameras.

Setup: three frames of a swinging arm with an IMU, and one moment of a rig with two cameras, of 32 x 24.
Expected: poses at the frames' times are those of trajectory.csv; what one camera sees lies where the other sees it.
Tolerance: digits of the tables (1e-9 m); for the pair half a pixel's footprint, the width of a range step across it.
"""

import contextlib
import io
import shutil
import sys

import numpy as np
import pytest

import uwsim.dataset
from uwsim import cli
from uwsim.camera import pose
from uwsim.camera.lens import lens_from_record, pixel_centres
from uwsim.dataset import store

RECIPE = """
name = "small"
description = "A swinging arm, and a pair of cameras"
seed = 1
samples_per_pixel = 8
batches = 4
set = { "rig.camera.width_px" = 32, "rig.camera.height_px" = 24, "exposure.time_s" = 0.04 }
[[group]]
name = "arm"
scene = "tank_markers"
[group.sequence]
fps = 25.0
frames = 3
trajectory = { kind = "arm_swing", speed_percent = 100.0 }
imu = { rate_hz = 200.0 }
[[group]]
name = "pair"
scene = "tank_markers"
frames = 1
[[group.cameras]]
name = "left"
position_m = [-0.1, 0.0, 0.0]
[[group.cameras]]
name = "right"
position_m = [0.1, 0.0, 0.0]
rotation_deg = [0.0, -8.0, 0.0]
"""


def run(*arguments) -> tuple[int, str]:
    """Run the command line in this process; return its exit code and what it prints."""
    text, given = io.StringIO(), sys.argv
    sys.argv = ["uwsim", *map(str, arguments)]
    try:
        with contextlib.redirect_stdout(text), contextlib.redirect_stderr(text), pytest.raises(SystemExit) as stop:
            cli.main()
    finally:
        sys.argv = given
    return stop.value.code, text.getvalue()


@pytest.fixture(scope="module")
def made(tmp_path_factory) -> store.Dataset:
    folder = tmp_path_factory.mktemp("small")
    (folder / "small.toml").write_text(RECIPE)
    assert run("generate", folder / "small.toml", "--out", folder / "data")[0] == 0
    code, text = run("check", folder / "data")
    assert code == 0, text
    return uwsim.dataset.open(folder / "data")


def test_frames_lie_on_the_trajectory_and_move_through_their_exposure(made):
    (sequence,) = made.sequences
    assert sequence.frame_names() == ("000000", "000001", "000002")
    table = sequence.trajectory
    for name in sequence.frame_names():
        info = made.frame(name).info
        (at,) = np.flatnonzero(table["time_ns"] == info.time_ns)
        assert info.camera.world_from_camera == pytest.approx(table["world_from_rig"][at], abs=1e-9)
        # the exposure is as long as the period: it begins four samples before and ends four after
        through = np.array(info.camera.world_from_camera_through_exposure)
        assert np.ptp(info.camera.times_s) == pytest.approx(0.04)
        for pose_then, then in ((through[0], at - 4), (through[-1], at + 4)):
            assert pose_then == pytest.approx(table["world_from_rig"][then], abs=3e-6)
        assert np.abs(through[0] - through[-1]).max() > 2e-3  # control: it does move
        # a swing about the rig's y, which points down, at 0.1 m/s on a circle of 0.3 m: the image moves sideways
        assert info.blur.angle_deg % 180 == pytest.approx(0, abs=1.0) or info.blur.angle_deg == pytest.approx(
            180, abs=1
        )
    assert np.array_equal(sequence.imu["time_ns"], table["time_ns"])


def test_a_pair_of_cameras_sees_the_same_points(made):
    left, right = made.frame("000003"), made.frame("000004")
    assert left.info.rig.moment == right.info.rig.moment == 0
    assert left.info.lamps[0].position_m == pytest.approx(right.info.lamps[0].position_m, abs=1e-9)
    height, width = left.image.shape[:2]
    lens = lens_from_record(left.info.camera.model_dump())
    origins, directions = lens.rays(pixel_centres(width_px=width, height_px=height))
    seen = left.buffer("instance") == 1
    points = pose.apply(left.world_from_camera, (origins + directions * left.buffer("range")[..., None])[seen])

    def missed(world_from_right) -> float:
        local = pose.apply(pose.inverse(world_from_right), points)
        pixels = lens.project(local)[0]
        column, row = np.floor(pixels).astype(int).T
        inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
        assert inside.sum() > 20
        there = right.buffer("z_depth")[row[inside], column[inside]]
        board = right.buffer("instance")[row[inside], column[inside]] == 1
        return float(np.median(np.abs(there - local[inside, 2])[board])) if board.any() else np.inf

    assert missed(right.world_from_camera) < 0.01
    assert missed(left.world_from_camera) > 0.01  # control: seen from the wrong camera


def test_going_on_gives_the_same_bytes(made, tmp_path):
    begun = tmp_path / "begun"
    shutil.copytree(made.folder, begun)
    shutil.rmtree(begun / "frames/000002")
    (begun / "sequences/arm").rename(begun / "sequences/arm.partial")
    (begun / "sequences/arm.partial/imu.csv").unlink()
    store.write_manifest(begun, made.manifest | {"complete": False, "files": {}})
    code, text = run("generate", made.folder.parent / "small.toml", "--out", begun, "--resume")
    assert code == 0, text
    assert store.open(begun).manifest["files"] == made.manifest["files"]
    assert not list(begun.rglob("*.partial*"))


def test_an_exposure_longer_than_the_period_is_refused(tmp_path):
    (tmp_path / "long.toml").write_text(RECIPE.replace("fps = 25.0", "fps = 30.0"))
    code, text = run("generate", tmp_path / "long.toml", "--out", tmp_path / "data")
    assert code == 2
    assert "at most 0.0333333 s" in " ".join(text.split())
    assert not (tmp_path / "data").exists()
