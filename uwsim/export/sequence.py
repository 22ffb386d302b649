"""The sequences of a dataset as trajectory formats take them: each camera's frames, the body and its states."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from uwsim.dataset.frame import Frame
from uwsim.dataset.sequence import Sequence
from uwsim.dataset.store import Dataset


@dataclass(frozen=True, kw_only=True, eq=False)
class Views:
    """What one camera of a rig took: `times_ns` (n,) int64 of mid-exposure, n `frames`, `world_from_camera`."""

    name: str
    rig_from_camera: np.ndarray
    times_ns: np.ndarray
    frames: tuple[Frame, ...]

    @property
    def world_from_camera(self) -> np.ndarray:
        """Poses at mid-exposure, (n, 4, 4) [m]."""
        return np.array([frame.world_from_camera for frame in self.frames])


@dataclass(frozen=True, kw_only=True, eq=False)
class States:
    """The true motion of the body: `times_ns` (n,), `world_from_body` (n, 4, 4) [m], velocity (n, 3) in the world."""

    times_ns: np.ndarray
    world_from_body: np.ndarray
    velocity_m_per_s: np.ndarray


def sequences(dataset: Dataset) -> tuple[Sequence, ...]:
    """Return the sequences of a dataset; ValueError in one line if it has none."""
    found = dataset.sequences
    if not found:
        raise ValueError(
            f"{dataset.folder}: holds single frames without times, allowed: a dataset with sequences (a recipe whose "
            "group has a `sequence`)"
        )
    return found


def views(dataset: Dataset, sequence: Sequence) -> list[Views]:
    """Return what each camera of the rig took, in the order of time."""
    found = []
    for camera in sequence.info.cameras:
        entries = [entry for entry in sequence.info.frames if entry.camera == camera.name]
        frames = tuple(dataset.frame(entry.name) for entry in entries)
        times_ns = np.array([entry.time_ns for entry in entries], np.int64)
        pose = np.array(camera.rig_from_camera)
        found.append(Views(name=camera.name, rig_from_camera=pose, times_ns=times_ns, frames=frames))
    return found


def rig_from_body(sequence: Sequence) -> np.ndarray:
    """Return the pose on the rig, (4, 4) [m], of the body of the ASL format: the IMU, the rig itself without one."""
    return np.eye(4) if sequence.info.imu is None else np.array(sequence.info.imu.rig_from_imu)


def states(sequence: Sequence) -> States:
    """Return the true motion of the body at the times of the sequence's trajectory.csv."""
    rig, mounted = sequence.trajectory, rig_from_body(sequence)
    turns = rig["world_from_rig"][:, :3, :3]
    # a point beside the rig's origin moves with its turn as well
    beside = np.cross(rig["angular_rate_rad_per_s"], mounted[:3, 3])
    return States(
        times_ns=rig["time_ns"],
        world_from_body=rig["world_from_rig"] @ mounted,
        velocity_m_per_s=rig["velocity_m_per_s"] + np.einsum("nij,nj->ni", turns, beside),
    )


def quaternions(poses: np.ndarray) -> np.ndarray:
    """Return unit quaternions (n, 4), x, y, z, w with w >= 0, of poses (n, 4, 4)."""
    return Rotation.from_matrix(poses[:, :3, :3]).as_quat(canonical=True)
