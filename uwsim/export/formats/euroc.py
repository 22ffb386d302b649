"""EuRoC / ASL folders: one per sequence; times in nanoseconds, transforms to the body.

```
<sequence>/mav0/body.yaml
                cam0/data.csv, data/<time_ns>.png, sensor.yaml      cam1 ... for further cameras of the rig
                imu0/data.csv, sensor.yaml                          where the sequence has an IMU
                state_groundtruth_estimate0/data.csv, sensor.yaml   true states of the body in the world
```

The body is the IMU, and the rig where there is none. States have EuRoC's columns, at the times of the IMU; without an
IMU there are no biases, and the states end with the velocity.
Source: ASL dataset format, Burri et al. 2016, The EuRoC micro aerial vehicle datasets, IJRR 35(10).
"""

import shutil
from pathlib import Path

import numpy as np

from uwsim.dataset.sequence import Sequence
from uwsim.dataset.store import Dataset
from uwsim.export.about import write_about
from uwsim.export.cameras import Pinhole, camera_text, pinhole_of
from uwsim.export.sequence import Views, quaternions, rig_from_body, sequences, states, views
from uwsim.files import write_text

SPLITS = False


def _columns(name: str, unit: str, letters: str = "xyz") -> list[str]:
    return [f"{name}_{letter} [{unit}]" for letter in letters]


_RATE, _FORCE = _columns("w_RS_S", "rad s^-1"), _columns("a_RS_S", "m s^-2")
_STATE = [*_columns("p_RS_R", "m"), *_columns("q_RS", "", "wxyz"), *_columns("v_RS_R", "m s^-1")]
_BIASES = [*_columns("b_w_RS_S", "rad s^-1"), *_columns("b_a_RS_S", "m s^-2")]


def export(dataset: Dataset, folder: Path, *, splits: dict[str, str], progress) -> str:
    """Write the sequences; see the module."""
    found, pinholes, done = sequences(dataset), [], 0
    for sequence in found:
        target = folder / sequence.name / "mav0"
        for number, view in enumerate(views(dataset, sequence)):
            (target / f"cam{number}" / "data").mkdir(parents=True)
            pinholes.append(pinhole_of(view.frames, with_distortion=True))
            for time_ns, frame in zip(view.times_ns, view.frames, strict=True):
                progress(f"euroc: {frame.name}", done, len(dataset))
                shutil.copyfile(frame.folder / "image.png", target / f"cam{number}" / "data" / f"{time_ns}.png")
                done += 1
            _write_camera(sequence, view, target / f"cam{number}", pinholes[-1])
        write_text(target / "body.yaml", f"comment: {sequence.name}\n")
        _write_states(sequence, target / "state_groundtruth_estimate0")
        if sequence.info.imu is not None:
            _write_imu(sequence, target / "imu0")
    paragraphs = [
        camera_text(pinholes),
        "The body, frame S of `state_groundtruth_estimate0`, is the IMU, and the rig where there is none; R is the "
        "world. `T_BS` takes points of a sensor to the body; cameras have x right, y down, z forward. Pictures are in "
        "colour, their times those of mid-exposure; the states stand at the times of the IMU, in between (the poses of "
        "the pictures themselves are in the TUM export).",
    ]
    write_about(folder, dataset, title="EuRoC / ASL sequences", paragraphs=paragraphs)
    return f"{done} frames in {len(found)} sequence(s)"


def _write_camera(sequence: Sequence, view: Views, folder: Path, pinhole: Pinhole) -> None:
    pictures = [f"{time},{time}.png" for time in view.times_ns]
    write_text(folder / "data.csv", "\n".join(["#timestamp [ns],filename", *pictures]) + "\n")
    camera, K = view.frames[0].info.camera, pinhole.K
    off = f"of the best-fitting pinhole, off by {pinhole.rms_px:.3g} px rms and {pinhole.max_px:.3g} px at most"
    text = _yaml(
        "camera", f"{view.name}; intrinsics {'exact' if pinhole.is_exact else off}",
        np.linalg.inv(rig_from_body(sequence)) @ view.rig_from_camera,
        rate_hz=sequence.info.fps, resolution=[camera.width_px, camera.height_px], camera_model="pinhole",
        intrinsics=[float(value) for value in (K[0, 0], K[1, 1], K[0, 2], K[1, 2])],
        distortion_model="radial-tangential", distortion_coefficients=list(pinhole.distortion) or [0.0] * 4,
    )  # fmt: skip
    write_text(folder / "sensor.yaml", text)


def _write_states(sequence: Sequence, folder: Path) -> None:
    found = states(sequence)
    pose, header = found.world_from_body, list(_STATE)
    values = [pose[:, :3, 3], np.roll(quaternions(pose), 1, axis=1), found.velocity_m_per_s]
    if sequence.info.imu is not None:
        header += _BIASES
        values += [sequence.imu["gyroscope_bias_rad_per_s"], sequence.imu["accelerometer_bias_m_per_s2"]]
    _write_table(folder, header, found.times_ns, np.column_stack(values))
    write_text(folder / "sensor.yaml", _yaml("visual-inertial", "truth of the simulation", np.eye(4)))


def _write_imu(sequence: Sequence, folder: Path) -> None:
    imu, given = sequence.imu, sequence.info.imu
    values = np.column_stack([imu["angular_rate_rad_per_s"], imu["specific_force_m_per_s2"]])
    _write_table(folder, [*_RATE, *_FORCE], imu["time_ns"], values)
    text = _yaml(
        "imu", "simulated, with the noise stated here", np.eye(4), rate_hz=given.rate_hz,
        gyroscope_noise_density=given.gyroscope_noise_density_rad_per_s_per_sqrt_hz,
        gyroscope_random_walk=given.gyroscope_random_walk_rad_per_s2_per_sqrt_hz,
        accelerometer_noise_density=given.accelerometer_noise_density_m_per_s2_per_sqrt_hz,
        accelerometer_random_walk=given.accelerometer_random_walk_m_per_s3_per_sqrt_hz,
    )  # fmt: skip
    write_text(folder / "sensor.yaml", text)


def _write_table(folder: Path, header: list[str], times_ns: np.ndarray, values: np.ndarray) -> None:
    folder.mkdir()
    rows = [",".join([str(time), *map(repr, row)]) for time, row in zip(times_ns, values.tolist(), strict=True)]
    write_text(folder / "data.csv", "\n".join([",".join(["#timestamp [ns]", *header]), *rows]) + "\n")


def _yaml(kind: str, comment: str, body_from_sensor: np.ndarray, **entries: object) -> str:
    data = ", ".join(map(repr, body_from_sensor.ravel().tolist()))
    lines = [f"sensor_type: {kind}", f"comment: {comment}", "T_BS:", "  cols: 4", "  rows: 4", f"  data: [{data}]"]
    # a mantissa with a point: YAML 1.1 takes 1e-05 for text
    lines += [f"{key}: {_number(value)}" for key, value in entries.items()]
    return "\n".join(lines) + "\n"


def _number(value: object) -> str:
    if isinstance(value, list):
        return f"[{', '.join(map(_number, value))}]"
    text = repr(value) if isinstance(value, float) else str(value)
    return text if "e" not in text or "." in text or not isinstance(value, float) else text.replace("e", ".0e")
