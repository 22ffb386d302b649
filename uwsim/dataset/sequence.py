"""A sequence on disk: sequence.json, trajectory.csv and imu.csv in sequences/<name>/; see FORMAT.md."""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field
from scipy.spatial.transform import Rotation

from uwsim.dataset.parts import Matrix4, Vector3
from uwsim.files import read_json, write_json
from uwsim.validation import validated

DESCRIPTION, TRAJECTORY, IMU = "sequence.json", "trajectory.csv", "imu.csv"
_XYZ, _QUATERNION = ("x", "y", "z"), ("x", "y", "z", "w")
# quantity -> (name of its columns, their letters); columns are <name>_<letter>_<unit>
TRAJECTORY_COLUMNS = {
    "position_m": ("position_{}_m", _XYZ),
    "quaternion_xyzw": ("quaternion_{}", _QUATERNION),
    "velocity_m_per_s": ("velocity_{}_m_per_s", _XYZ),
    "acceleration_m_per_s2": ("acceleration_{}_m_per_s2", _XYZ),
    "angular_rate_rad_per_s": ("angular_rate_{}_rad_per_s", _XYZ),
}
IMU_COLUMNS = {
    "angular_rate_rad_per_s": ("angular_rate_{}_rad_per_s", _XYZ),
    "specific_force_m_per_s2": ("specific_force_{}_m_per_s2", _XYZ),
    "gyroscope_bias_rad_per_s": ("gyroscope_bias_{}_rad_per_s", _XYZ),
    "accelerometer_bias_m_per_s2": ("accelerometer_bias_{}_m_per_s2", _XYZ),
}


class _Strict(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class FrameOf(_Strict):
    """One frame of a sequence."""

    name: str
    camera: str
    time_ns: Annotated[int, Field(ge=0)]


class CameraOf(_Strict):
    """One camera of the rig; size, K, distortion and port stand in each of its frames."""

    name: str
    rig_from_camera: Matrix4


class ImuOf(_Strict):
    """The IMU's calibration, in the terms and units of Kalibr; biases are those at the first sample."""

    rate_hz: float
    rig_from_imu: Matrix4
    gravity_m_per_s2: float
    gyroscope_noise_density_rad_per_s_per_sqrt_hz: float
    gyroscope_random_walk_rad_per_s2_per_sqrt_hz: float
    gyroscope_bias_rad_per_s: Vector3
    accelerometer_noise_density_m_per_s2_per_sqrt_hz: float
    accelerometer_random_walk_m_per_s3_per_sqrt_hz: float
    accelerometer_bias_m_per_s2: Vector3


class SequenceInfo(_Strict):
    """The contents of sequence.json."""

    format: Literal[1]
    name: str
    group: str
    seed: int
    fps: float
    exposure_time_s: float
    readout_s: float
    cameras: tuple[CameraOf, ...]
    imu: ImuOf | None
    trajectory: dict
    frames: tuple[FrameOf, ...]


@dataclass(frozen=True)
class Sequence:
    """A sequence that lies in `folder`; its tables are read when asked for."""

    folder: Path
    info: SequenceInfo

    @property
    def name(self) -> str:
        return self.info.name

    def frame_names(self, camera: str | None = None) -> tuple[str, ...]:
        """Return the names of the frames in order of time, those of one camera or all; ValueError if it is unknown."""
        known = [one.name for one in self.info.cameras]
        if camera is not None and camera not in known:
            raise ValueError(f"{self.folder}: camera: got {camera!r}, allowed: {', '.join(known)}")
        return tuple(frame.name for frame in self.info.frames if camera in (None, frame.camera))

    @cached_property
    def trajectory(self) -> dict[str, np.ndarray]:
        """The rig's true motion: `time_ns` (n,) int64 and the quantities of TRAJECTORY_COLUMNS, and poses.

        `world_from_rig` (n, 4, 4) [m]. Velocity and acceleration along the world's axes, angular rate about the rig's.
        """
        found = read_table(self.folder / TRAJECTORY, TRAJECTORY_COLUMNS)
        poses = np.tile(np.eye(4), (len(found["time_ns"]), 1, 1))
        poses[:, :3, :3] = Rotation.from_quat(found["quaternion_xyzw"]).as_matrix()
        poses[:, :3, 3] = found["position_m"]
        return found | {"world_from_rig": poses}

    @cached_property
    def imu(self) -> dict[str, np.ndarray]:
        """What the IMU measured: `time_ns` (n,) int64 and the quantities of IMU_COLUMNS, (n, 3) in the IMU's frame.

        Raises ValueError if the sequence has none.
        """
        if self.info.imu is None:
            raise ValueError(f"{self.folder}: no {IMU}; a recipe asks for it with sequence.imu")
        return read_table(self.folder / IMU, IMU_COLUMNS)


def files_of(info: SequenceInfo) -> tuple[str, ...]:
    """Return the names of a sequence's files."""
    return (DESCRIPTION, TRAJECTORY, *([IMU] if info.imu is not None else []))


def read_sequence(folder: Path) -> Sequence:
    """Open the sequence in `folder`; ValueError in one line if its description is missing or broken."""
    path = Path(folder) / DESCRIPTION
    return Sequence(folder=Path(folder), info=validated(SequenceInfo, read_json(path), where=path))


def write_sequence(folder: Path, *, info: SequenceInfo, trajectory: dict, imu: dict | None) -> None:
    """Write a sequence to `<folder>.partial`, then rename: `folder` is complete or absent.

    trajectory, imu: `time_ns` (n,) and the quantities of TRAJECTORY_COLUMNS, IMU_COLUMNS.
    Raises ValueError unless there is an `imu` if and only if `info` says so.
    """
    import shutil

    if (imu is None) != (info.imu is None):
        raise ValueError(f"{folder}: imu {'not ' if imu is None else ''}given, sequence.json says {info.imu}")
    partial = Path(folder).with_name(Path(folder).name + ".partial")
    shutil.rmtree(partial, ignore_errors=True)
    partial.mkdir(parents=True)
    write_json(partial / DESCRIPTION, info.model_dump(mode="json"))
    _write_table(partial / TRAJECTORY, TRAJECTORY_COLUMNS, trajectory)
    if imu is not None:
        _write_table(partial / IMU, IMU_COLUMNS, imu)
    partial.rename(folder)


def _names(columns: dict) -> list[str]:
    return ["time_ns", *(text.format(letter) for text, letters in columns.values() for letter in letters)]


def _write_table(path: Path, columns: dict, values: dict[str, np.ndarray]) -> None:
    rows = np.concatenate([np.asarray(values[name], float) for name in columns], axis=1)
    # 12 digits: 1e-12 m, and below any noise
    lines = [
        ",".join([str(int(time_ns)), *(f"{number:.12g}" for number in row)])
        for time_ns, row in zip(values["time_ns"], rows, strict=True)
    ]
    path.write_text("\n".join([",".join(_names(columns)), *lines]) + "\n", encoding="utf-8")


def read_table(path: Path, columns: dict) -> dict[str, np.ndarray]:
    """Read a CSV file of a sequence; ValueError in one line unless it has these columns, finite, in order of time."""
    try:
        head, *lines = Path(path).read_text(encoding="utf-8").splitlines() or [""]
    except (OSError, UnicodeDecodeError) as error:
        raise ValueError(f"{path}: not readable: {error}") from None
    names = _names(columns)
    if head.split(",") != names:
        raise ValueError(f"{path}: columns are {head[:80]!r}, allowed: {','.join(names)}")
    try:
        cells = [line.split(",") for line in lines]
        times_ns = np.array([int(row[0]) for row in cells], np.int64)
        numbers = np.array([[float(cell) for cell in row[1:]] for row in cells], float)
    except ValueError as error:
        raise ValueError(f"{path}: not a table of numbers: {error}") from None
    if numbers.shape != (len(times_ns), len(names) - 1) or not len(times_ns) or not np.all(np.isfinite(numbers)):
        raise ValueError(
            f"{path}: table of shape {numbers.shape}, allowed: {len(names)} finite columns, at least a row"
        )
    if np.any(np.diff(times_ns) <= 0):
        raise ValueError(f"{path}: time_ns does not increase in row {int(np.argmax(np.diff(times_ns) <= 0)) + 3}")
    found, start = {"time_ns": times_ns}, 0
    for name, (_, letters) in columns.items():
        found[name] = numbers[:, start : start + len(letters)]
        start += len(letters)
    return found
