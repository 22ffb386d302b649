"""EuRoC and TUM folders: what readers written from the published formats, and evo, find is the truth."""

import csv
import json
import os
import subprocess
import sys

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.unit import synthetic, synthetic_sequence
from uwsim.export.run import export
from uwsim.images import read_srgb

QUIET = {"shares": None, "progress": lambda *_: None}


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """The dataset, and its exports by name."""
    folder = tmp_path_factory.mktemp("sequence")
    dataset = synthetic_sequence.write_dataset(folder)
    for name in ("euroc", "tum"):
        export(dataset.folder, folder / name, format=name, **QUIET)
    return dataset, folder


def tum_table(path) -> np.ndarray:
    """Read a TUM trajectory: the published format has comments, then lines of numbers."""
    return np.array([line.split() for line in path.read_text().splitlines() if not line.startswith("#")])


def matrix(position, quaternion_xyzw) -> np.ndarray:
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_quat(np.asarray(quaternion_xyzw, float)).as_matrix()
    pose[:3, 3] = np.asarray(position, float)
    return pose


def euroc_table(path) -> tuple[list[str], np.ndarray]:
    with path.open() as stream:
        head, *rows = csv.reader(stream)
    return head, np.array(rows)


def sensor(path) -> dict:
    """Read a sensor.yaml with a YAML library, as ASL readers do."""
    yaml = pytest.importorskip("yaml", reason="pyyaml is not installed")
    return yaml.safe_load(path.read_text())


@pytest.mark.parametrize("camera", ["left", "right"])
def test_tum_poses_pictures_and_depth_are_those_of_the_frames(made, camera):
    dataset, folder = made
    root = folder / "tum" / f"circle_{camera}"
    names = dataset.sequences[0].frame_names(camera)
    truth, listed = tum_table(root / "groundtruth.txt"), tum_table(root / "depth.txt")
    assert len(truth) == len(listed) == len(names) == synthetic_sequence.FRAMES
    for name, row, (stamp, file), time_ns in zip(
        names, truth, listed, synthetic_sequence.frame_times_ns(), strict=True
    ):
        frame = dataset.frame(name)
        assert round(float(stamp) * 1e9) == time_ns == frame.info.time_ns
        np.testing.assert_allclose(matrix(row[1:4], row[4:]), frame.world_from_camera, atol=1e-12)
        depth_m = cv2.imread(str(root / file), cv2.IMREAD_UNCHANGED) / 5000
        np.testing.assert_allclose(depth_m, frame.buffer("z_depth"), atol=0.5 / 5000 + 1e-6)
        assert np.array_equal(read_srgb(root / file.replace("depth", "rgb")), frame.image)
    calibration = tum_table(root / "calibration.txt").astype(float)[0]
    np.testing.assert_allclose(calibration, [120, 120, 63.5, 47.5])


def test_euroc_states_are_those_of_the_imu(made):
    _, folder = made
    head, rows = euroc_table(folder / "euroc/circle/mav0/state_groundtruth_estimate0/data.csv")
    assert head[0] == "#timestamp [ns]" and len(head) == 17
    values, mounted = rows[:, 1:].astype(float), synthetic_sequence.rig_from_imu()
    for time_ns, row in zip(rows[:, 0].astype(np.int64), values, strict=True):
        true = synthetic_sequence.world_from_rig(time_ns / 1e9) @ mounted
        # w first
        np.testing.assert_allclose(matrix(row[:3], [*row[4:7], row[3]]), true, atol=1e-9)
        step_s = 1e-5
        ends = [(synthetic_sequence.world_from_rig(time_ns / 1e9 + s) @ mounted)[:3, 3] for s in (-step_s, step_s)]
        np.testing.assert_allclose(row[7:10], (ends[1] - ends[0]) / (2 * step_s), atol=1e-8)
    np.testing.assert_allclose(values[:, 10:13], synthetic_sequence.BIAS_RAD_PER_S)
    np.testing.assert_allclose(values[:, 13:], synthetic_sequence.BIAS_M_PER_S2)


def test_control_the_rigs_velocity_is_not_the_imus(made):
    dataset, folder = made
    _, rows = euroc_table(folder / "euroc/circle/mav0/state_groundtruth_estimate0/data.csv")
    rig = dataset.sequences[0].trajectory["velocity_m_per_s"]
    assert np.abs(rows[:, 8:11].astype(float) - rig).max() > 0.005


@pytest.mark.parametrize(("number", "camera"), [(0, "left"), (1, "right")])
def test_euroc_cameras_lie_where_the_sensor_files_say(made, number, camera):
    dataset, folder = made
    root = folder / "euroc/circle/mav0"
    described = sensor(root / f"cam{number}/sensor.yaml")
    body_from_camera = np.reshape(described["T_BS"]["data"], (4, 4))
    assert described["resolution"] == [synthetic.WIDTH_PX, synthetic.HEIGHT_PX]
    assert described["intrinsics"] == pytest.approx([120, 120, 63.5, 47.5])
    assert described["distortion_coefficients"] == [0.0] * 4 and described["rate_hz"] == synthetic_sequence.FPS
    head, rows = euroc_table(root / f"cam{number}/data.csv")
    assert head == ["#timestamp [ns]", "filename"]
    for name, (time_ns, file) in zip(dataset.sequences[0].frame_names(camera), rows, strict=True):
        frame = dataset.frame(name)
        world_from_body = synthetic_sequence.world_from_rig(int(time_ns) / 1e9) @ synthetic_sequence.rig_from_imu()
        np.testing.assert_allclose(world_from_body @ body_from_camera, frame.world_from_camera, atol=1e-9)
        assert np.array_equal(read_srgb(root / f"cam{number}/data" / file), frame.image)


def test_euroc_imu_has_its_samples_and_its_noise(made):
    dataset, folder = made
    _, rows = euroc_table(folder / "euroc/circle/mav0/imu0/data.csv")
    imu = dataset.sequences[0].imu
    assert np.array_equal(rows[:, 0].astype(np.int64), imu["time_ns"])
    np.testing.assert_array_equal(rows[:, 1:4].astype(float), imu["angular_rate_rad_per_s"])
    np.testing.assert_array_equal(rows[:, 4:].astype(float), imu["specific_force_m_per_s2"])
    described = sensor(folder / "euroc/circle/mav0/imu0/sensor.yaml")
    assert described["gyroscope_random_walk"] == 1e-05  # a number, not a text, also below 1e-4
    assert described["accelerometer_noise_density"] == 2e-3 and described["rate_hz"] == synthetic_sequence.IMU_HZ


def test_without_an_imu_the_body_is_the_rig_and_states_end_with_the_velocity(tmp_path):
    dataset = synthetic_sequence.write_dataset(tmp_path, imu=False)
    export(dataset.folder, tmp_path / "out", format="euroc", **QUIET)
    head, rows = euroc_table(tmp_path / "out/circle/mav0/state_groundtruth_estimate0/data.csv")
    assert len(head) == 11 and not (tmp_path / "out/circle/mav0/imu0").exists()
    rig = dataset.sequences[0].trajectory
    np.testing.assert_allclose(rows[:, 1:4].astype(float), rig["position_m"])
    np.testing.assert_allclose(rows[:, 8:11].astype(float), rig["velocity_m_per_s"])


def test_evo_reads_both(made, tmp_path):
    """evo, run apart (it writes settings into the home folder), finds the poses and an error of zero against them."""
    pytest.importorskip("evo", reason="evo is not installed")
    dataset, folder = made
    code = (
        "import sys, json, numpy as np\n"
        "from evo.tools import file_interface as f\n"
        "tum, euroc = f.read_tum_trajectory_file(sys.argv[1]), f.read_euroc_csv_trajectory(sys.argv[2])\n"
        "ok = [t.check()[0] for t in (tum, euroc)]\n"
        "print(json.dumps({'ok': ok, 'tum': np.array(tum.poses_se3).tolist(), 'stamps': tum.timestamps.tolist(),"
        " 'euroc': np.array(euroc.poses_se3).tolist()}))"
    )
    files = (
        folder / "tum/circle_left/groundtruth.txt",
        folder / "euroc/circle/mav0/state_groundtruth_estimate0/data.csv",
    )
    environment = os.environ | {"HOME": str(tmp_path), "MPLBACKEND": "Agg"}
    command = [sys.executable, "-W", "ignore", "-c", code, *map(str, files)]
    answer = subprocess.run(command, capture_output=True, text=True, env=environment, timeout=120)
    assert answer.returncode == 0, answer.stderr
    found = json.loads(answer.stdout.splitlines()[-1])
    assert found["ok"] == [True, True]
    names = dataset.sequences[0].frame_names("left")
    true = [dataset.frame(name).world_from_camera for name in names]
    np.testing.assert_allclose(found["tum"], true, atol=1e-9)
    np.testing.assert_allclose(np.array(found["stamps"]) * 1e9, synthetic_sequence.frame_times_ns(), atol=1)
    states = dataset.sequences[0].trajectory["world_from_rig"] @ synthetic_sequence.rig_from_imu()
    np.testing.assert_allclose(found["euroc"], states, atol=1e-9)


@pytest.mark.parametrize("name", ["euroc", "tum"])
def test_single_frames_are_no_sequence(tmp_path, name):
    dataset = synthetic.write_dataset(tmp_path / "data", (0,))
    with pytest.raises(ValueError, match="single frames without times, allowed: a dataset with sequences"):
        export(dataset.folder, tmp_path / "out", format=name, **QUIET)
    assert [path.name for path in tmp_path.iterdir()] == ["data"]


def test_sequences_have_no_splits(made, tmp_path):
    dataset, _ = made
    with pytest.raises(ValueError, match="--split: got shares for tum"):
        export(dataset.folder, tmp_path / "out", format="tum", shares={"train": 1.0}, progress=lambda *_: None)
