"""Verify the sequences of a dataset: their files, their tables, and that their frames say the same."""

import numpy as np

from uwsim.dataset.sequence import Sequence, files_of
from uwsim.dataset.store import Dataset


def check_sequences(dataset: Dataset) -> None:
    """Raise ValueError in one line that names the first fault; frames that belong to no sequence listed are one."""
    members: dict[str, str] = {}
    for sequence in dataset.sequences:
        _check_files(dataset, sequence)
        for frame in sequence.info.frames:
            if frame.name not in dataset.frame_names:
                raise ValueError(f"{sequence.folder}: frame {frame.name} is not part of the dataset")
            if frame.name in members:
                raise ValueError(f"{sequence.folder}: frame {frame.name} is also one of {members[frame.name]}")
            members[frame.name] = sequence.name
        _check_tables(sequence)
        _check_frames(dataset, sequence)
    for frame in dataset.frames:
        if frame.info.sequence != members.get(frame.name):
            raise ValueError(
                f"{frame.folder}: frame.json says sequence {frame.info.sequence}, "
                f"it is listed by {members.get(frame.name) or 'none'}"
            )


def _check_files(dataset: Dataset, sequence: Sequence) -> None:
    if sequence.folder.name != sequence.name:
        raise ValueError(f"{sequence.folder}: sequence.json calls itself {sequence.name!r}")
    start = f"sequences/{sequence.name}/"
    found = {file.removeprefix(start) for file in dataset.manifest["files"] if file.startswith(start)}
    if found != set(files_of(sequence.info)):
        raise ValueError(f"{sequence.folder}: has {sorted(found)}, allowed: {sorted(files_of(sequence.info))}")


def _check_tables(sequence: Sequence) -> None:
    """Tables are readable and cover the frames; the IMU's samples are those of the trajectory."""
    times_ns = sequence.trajectory["time_ns"]
    for frame in sequence.info.frames:
        if not times_ns[0] <= frame.time_ns <= times_ns[-1]:
            raise ValueError(
                f"{sequence.folder}: frame {frame.name} at {frame.time_ns} ns, allowed: within trajectory.csv, "
                f"{times_ns[0]} to {times_ns[-1]} ns"
            )
    if np.abs(np.linalg.norm(sequence.trajectory["quaternion_xyzw"], axis=1) - 1).max() > 1e-9:
        raise ValueError(f"{sequence.folder}: trajectory.csv has quaternions that are not of unit length")
    if sequence.info.imu is not None and not np.array_equal(sequence.imu["time_ns"], times_ns):
        raise ValueError(f"{sequence.folder}: imu.csv and trajectory.csv have different time_ns")


def _check_frames(dataset: Dataset, sequence: Sequence) -> None:
    """Frames have the time, camera and calibration that sequence.json says, and lie on the trajectory."""
    calibration = {camera.name: camera.rig_from_camera for camera in sequence.info.cameras}
    for listed in sequence.info.frames:
        info, where = dataset.frame(listed.name).info, f"{sequence.folder}: frame {listed.name}"
        if info.rig is None or (info.time_ns, info.rig.camera) != (listed.time_ns, listed.camera):
            raise ValueError(f"{where}: frame.json gives another time or camera")
        if not np.allclose(info.rig.rig_from_camera, calibration[listed.camera], rtol=0, atol=1e-12):
            raise ValueError(f"{where}: frame.json gives another rig_from_camera")
        _check_place(sequence, info, where)


def _check_place(sequence: Sequence, info, where: str) -> None:
    """The rig lies where the samples next to the frame's time lead to by their velocity and acceleration."""
    table = sequence.trajectory
    nearest = int(np.argmin(np.abs(table["time_ns"] - info.time_ns)))
    step_s = (info.time_ns - table["time_ns"][nearest]) * 1e-9
    velocity, acceleration = table["velocity_m_per_s"][nearest], table["acceleration_m_per_s2"][nearest]
    expected = table["position_m"][nearest] + step_s * velocity + step_s**2 / 2 * acceleration
    # between samples the acceleration is off by no more than its largest, the velocity by what it changes in a step
    highest = np.linalg.norm(table["acceleration_m_per_s2"], axis=1).max()
    changes = np.linalg.norm(np.diff(table["velocity_m_per_s"], axis=0), axis=1).max(initial=0.0)
    allowed = 1e-9 + step_s**2 * highest + abs(step_s) * changes
    missed = float(np.linalg.norm(np.array(info.rig.world_from_rig)[:3, 3] - expected))
    if missed > allowed:
        raise ValueError(f"{where}: the rig is {missed:.3g} m off trajectory.csv, allowed: {allowed:.3g} m")
