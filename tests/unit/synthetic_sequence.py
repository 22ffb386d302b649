"""A small dataset with a sequence for unit tests: a rig of two cameras and an IMU on a circle, nothing rendered."""

import math
from pathlib import Path

import numpy as np

from tests.unit import synthetic
from uwsim.dataset import store
from uwsim.dataset.frame import write_frame
from uwsim.dataset.info import FrameInfo
from uwsim.dataset.sequence import SequenceInfo, write_sequence

FPS, FRAMES, IMU_HZ, RADIUS_M, RATE_RAD_PER_S = 10.0, 3, 50.0, 0.4, 0.5
CAMERAS_M = {"left": (-0.03, 0.0, 0.0), "right": (0.03, 0.0, 0.0)}
BIAS_RAD_PER_S, BIAS_M_PER_S2 = 0.001, 0.02


def world_from_rig(time_s: float) -> np.ndarray:
    """Return the rig on a circle about the world's z axis, camera axes, looking outwards."""
    angle = RATE_RAD_PER_S * time_s
    out = np.array([math.cos(angle), math.sin(angle), 0.0])
    down = np.array([0.0, 0.0, -1.0])
    pose = np.eye(4)
    pose[:3, :3] = np.stack([np.cross(down, out), down, out], axis=1)
    pose[:3, 3] = RADIUS_M * out - [0, 0, 2.0]
    return pose


def rig_from_camera(name: str) -> np.ndarray:
    pose = np.eye(4)
    pose[:3, 3] = CAMERAS_M[name]
    return pose


def rig_from_imu() -> np.ndarray:
    """Return an IMU beside the rig's origin, its x along the rig's y."""
    pose = np.eye(4)
    pose[:3, :3] = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    pose[:3, 3] = 0.05, 0.01, -0.02
    return pose


def frame_times_ns() -> list[int]:
    return [round((step + 0.5) / FPS * 1e9) for step in range(FRAMES)]


def write_dataset(folder: Path, *, imu: bool = True) -> store.Dataset:
    """Write the dataset: frames in the order left, right, left ...; its one sequence is called `circle`."""
    written = synthetic.write_dataset(folder / "made", (0,)).frame("000000")
    buffers = {name: written.buffer(name) for name in written.buffer_names}
    frames, target = [], folder / "data"
    for step, time_ns in enumerate(frame_times_ns()):
        for camera in CAMERAS_M:
            name, rig = f"{len(frames):06d}", world_from_rig(time_ns / 1e9)
            pose = (rig @ rig_from_camera(camera)).tolist()
            info = written.info.model_dump()
            info |= {
                "name": name, "frame": len(frames), "group": "circle", "time_ns": time_ns, "sequence": "circle",
                "rig": {"camera": camera, "moment": step, "rig_from_camera": rig_from_camera(camera).tolist(),
                        "world_from_rig": rig.tolist()},
            }  # fmt: skip
            info["camera"] |= {"world_from_camera": pose, "world_from_camera_through_exposure": (pose,)}
            made = FrameInfo.model_validate(info)
            write_frame(target / "frames" / name, image=written.image, buffers=buffers, info=made)
            frames.append({"name": name, "camera": camera, "time_ns": time_ns})
    _write_sequence(target / "sequences" / "circle", frames, imu=imu)
    manifest = store.read_manifest(folder / "made") | {"name": "circle", "files": store.checksums(target)}
    store.write_manifest(target, manifest)
    return store.open(target)


def _write_sequence(folder: Path, frames: list[dict], *, imu: bool) -> None:
    times_ns = np.round(np.arange(int(FRAMES / FPS * IMU_HZ) + 1) / IMU_HZ * 1e9).astype(np.int64)
    poses = np.array([world_from_rig(time / 1e9) for time in times_ns])
    out, along = poses[:, :3, 2], np.cross([0.0, 0.0, 1.0], poses[:, :3, 2])
    # the rig's y points down, so that it turns about -y
    turn = np.tile([0.0, -RATE_RAD_PER_S, 0.0], (len(times_ns), 1))
    trajectory = {
        "time_ns": times_ns, "position_m": poses[:, :3, 3], "quaternion_xyzw": _quaternions(poses),
        "velocity_m_per_s": RADIUS_M * RATE_RAD_PER_S * along,
        "acceleration_m_per_s2": -RADIUS_M * RATE_RAD_PER_S**2 * out, "angular_rate_rad_per_s": turn,
    }  # fmt: skip
    flat = np.ones((len(times_ns), 3))
    samples = {
        "time_ns": times_ns, "angular_rate_rad_per_s": 0.1 * flat, "specific_force_m_per_s2": 9.8 * flat,
        "gyroscope_bias_rad_per_s": BIAS_RAD_PER_S * flat, "accelerometer_bias_m_per_s2": BIAS_M_PER_S2 * flat,
    }  # fmt: skip
    noise = {
        "rate_hz": IMU_HZ, "rig_from_imu": rig_from_imu().tolist(), "gravity_m_per_s2": 9.80665,
        "gyroscope_noise_density_rad_per_s_per_sqrt_hz": 1e-4, "gyroscope_random_walk_rad_per_s2_per_sqrt_hz": 1e-05,
        "gyroscope_bias_rad_per_s": (BIAS_RAD_PER_S,) * 3, "accelerometer_noise_density_m_per_s2_per_sqrt_hz": 2e-3,
        "accelerometer_random_walk_m_per_s3_per_sqrt_hz": 3e-3, "accelerometer_bias_m_per_s2": (BIAS_M_PER_S2,) * 3,
    }  # fmt: skip
    cameras = [{"name": name, "rig_from_camera": rig_from_camera(name).tolist()} for name in CAMERAS_M]
    info = SequenceInfo.model_validate(
        {
            "format": 1, "name": "circle", "group": "circle", "seed": 7, "fps": FPS, "exposure_time_s": 0.01,
            "readout_s": 0.0, "cameras": cameras, "imu": noise if imu else None, "trajectory": {}, "frames": frames,
        }
    )  # fmt: skip
    write_sequence(folder, info=info, trajectory=trajectory, imu=samples if imu else None)


def _quaternions(poses: np.ndarray) -> np.ndarray:
    from scipy.spatial.transform import Rotation

    return Rotation.from_matrix(poses[:, :3, :3]).as_quat()
