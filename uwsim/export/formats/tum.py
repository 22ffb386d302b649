"""TUM RGB-D folders: one per sequence (and camera), poses as lines of `timestamp tx ty tz qx qy qz qw`.

```
<sequence>/rgb.txt, rgb/<seconds>.png          timestamp, file; <sequence>_<camera> where the rig has several
           depth.txt, depth/<seconds>.png      z-depth in 1/5000 m, 0: no body seen
           groundtruth.txt                     world_from_camera at mid-exposure
           accelerometer.txt                   timestamp ax ay az [m/s^2] in the IMU's axes, where there is an IMU
           calibration.txt                     fx fy cx cy [px], OpenCV's pixels
```

Source: "File formats", RGB-D SLAM dataset and benchmark, TUM computer vision group.
"""

import shutil
from pathlib import Path

import numpy as np

from uwsim.dataset.sequence import Sequence
from uwsim.dataset.store import Dataset
from uwsim.export.about import write_about
from uwsim.export.cameras import camera_text, pinhole_of
from uwsim.export.pictures import depth_steps
from uwsim.export.sequence import Views, quaternions, sequences, views
from uwsim.files import write_text
from uwsim.images import write_png

SPLITS = False
STEP_M = 1 / 5000


def export(dataset: Dataset, folder: Path, *, splits: dict[str, str], progress) -> str:
    """Write the sequences; see the module. Raises ValueError where a depth is beyond 13.1 m, where 16 bits end."""
    found, pinholes, done = sequences(dataset), [], 0
    for sequence in found:
        taken = views(dataset, sequence)
        for view in taken:
            target = folder / (f"{sequence.name}_{view.name}" if len(taken) > 1 else sequence.name)
            for name in ("rgb", "depth"):
                (target / name).mkdir(parents=True)
            pinholes.append(pinhole_of(view.frames))
            for time_ns, frame in zip(view.times_ns, view.frames, strict=True):
                progress(f"tum: {frame.name}", done, len(dataset))
                shutil.copyfile(frame.folder / "image.png", target / "rgb" / f"{seconds(time_ns)}.png")
                write_png(target / "depth" / f"{seconds(time_ns)}.png", depth_steps(frame, STEP_M))
                done += 1
            _write_tables(sequence, view, target, pinholes[-1].K)
    paragraphs = [
        camera_text(pinholes),
        "Poses are `world_from_camera` at mid-exposure, camera axes x right, y down, z forward. Depth is along the "
        "optical axis, in 1/5000 m.",
    ]
    write_about(folder, dataset, title="TUM RGB-D sequences", paragraphs=paragraphs)
    return f"{done} frames in {len(found)} sequence(s)"


def seconds(time_ns: int) -> str:
    """Return whole nanoseconds as decimal seconds, exactly."""
    sign, size = "-" if time_ns < 0 else "", abs(int(time_ns))
    return f"{sign}{size // 10**9}.{size % 10**9:09d}"


def _write_tables(sequence: Sequence, view: Views, target: Path, K: np.ndarray) -> None:
    stamps = [seconds(time) for time in view.times_ns]
    for name in ("rgb", "depth"):
        _write(target / f"{name}.txt", "timestamp filename", [[stamp, f"{name}/{stamp}.png"] for stamp in stamps])
    poses = view.world_from_camera
    rows = np.column_stack([poses[:, :3, 3], quaternions(poses)])
    header = "timestamp tx ty tz qx qy qz qw"
    _write(target / "groundtruth.txt", header, [[stamp, *row] for stamp, row in zip(stamps, rows, strict=True)])
    _write(target / "calibration.txt", "fx fy cx cy", [[K[0, 0], K[1, 1], K[0, 2], K[1, 2]]])
    if sequence.info.imu is not None:
        samples = zip(sequence.imu["time_ns"], sequence.imu["specific_force_m_per_s2"], strict=True)
        _write(target / "accelerometer.txt", "timestamp ax ay az", [[seconds(time), *force] for time, force in samples])


def _write(path: Path, header: str, rows: list[list]) -> None:
    texts = [" ".join(value if isinstance(value, str) else repr(float(value)) for value in row) for row in rows]
    write_text(path, "\n".join([f"# {header}", *texts]) + "\n")
