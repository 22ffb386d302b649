"""Write the sequences of a recipe: the true motion of the rig, what its IMU says, and which frames belong to it."""

import shutil
from collections.abc import Collection, Iterator
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from uwsim.dataset import sequence as stored
from uwsim.dataset.frame import FORMAT_VERSION
from uwsim.dataset.moments import ALONE
from uwsim.dataset.recipe import Drawn, Group, Recipe, draw


def first_frames(recipe: Recipe) -> Iterator[tuple[Group, int, int]]:
    """Yield (group, combination, number of the first frame) of each sequence of a recipe."""
    start = 0
    for group in recipe.group:
        if group.sequence is not None:
            length = group.count // group.combinations
            for combination in range(group.combinations):
                yield group, combination, start + combination * length
        start += group.count


def write_sequences(recipe: Recipe, out: Path, *, where: object, without: Collection[str] = ()) -> None:
    """Write the sequences of `recipe` into the dataset folder `out`; where: the recipe's path.

    without: names of frames that could not be made. A sequence that lies there already with the same frames stays.
    """
    for group, combination, first in first_frames(recipe):
        folder = Path(out) / "sequences" / group.sequence_name(combination)
        drawn = draw(recipe, first, where=where)
        info = _info(recipe, group, combination, first, drawn, without)
        if folder.is_dir() and stored.read_sequence(folder).info == info:
            continue
        shutil.rmtree(folder, ignore_errors=True)
        if info.frames:
            stored.write_sequence(folder, info=info, **_tables(drawn, seed=recipe.seed, first=first))


def _tables(drawn: Drawn, *, seed: int, first: int) -> dict:
    """Return `trajectory` and `imu` as `write_sequence` takes them."""
    sequence = drawn.sequence
    path = sequence.trajectory.path(drawn.still.rig.world_from_rig, seed=seed, frame=first)
    times_ns = sequence.sample_times_ns()
    times_s = times_ns * 1e-9
    states = path.states(times_s)
    trajectory = {
        "time_ns": times_ns,
        "position_m": states.world_from_frame[:, :3, 3],
        "quaternion_xyzw": Rotation.from_matrix(states.world_from_frame[:, :3, :3]).as_quat(canonical=True),
        "velocity_m_per_s": states.velocity_m_per_s,
        "acceleration_m_per_s2": states.acceleration_m_per_s2,
        "angular_rate_rad_per_s": states.angular_rate_rad_per_s,
    }
    if sequence.imu is None:
        return {"trajectory": trajectory, "imu": None}
    measured = sequence.imu.sampled(path, times_s, seed=seed, frame=first)
    return {"trajectory": trajectory, "imu": {"time_ns": times_ns} | measured}


def _info(
    recipe: Recipe, group: Group, combination: int, first: int, drawn: Drawn, without: Collection[str]
) -> stored.SequenceInfo:
    cameras, sequence, exposure = group.cameras or (ALONE,), drawn.sequence, drawn.still.exposure
    frames = [
        {
            "name": f"{first + step * len(cameras) + number:06d}", "camera": camera.name,
            "time_ns": sequence.frame_time_ns(step),
        }
        for step in range(sequence.count)
        for number, camera in enumerate(cameras)
    ]  # fmt: skip
    return stored.SequenceInfo.model_validate(
        {
            "format": FORMAT_VERSION,
            "name": group.sequence_name(combination),
            "group": group.name,
            "seed": recipe.seed,
            "fps": sequence.fps,
            "exposure_time_s": exposure.time_s,
            "readout_s": exposure.readout_s,
            "cameras": [{"name": one.name, "rig_from_camera": one.rig_from_camera.tolist()} for one in cameras],
            "imu": None if sequence.imu is None else _imu(sequence.imu),
            "trajectory": sequence.trajectory.model_dump(mode="json"),
            "frames": [frame for frame in frames if frame["name"] not in without],
        }
    )


def _imu(imu) -> dict:
    given = imu.model_dump(exclude={"position_m", "rotation_deg"})
    return given | {"rig_from_imu": np.asarray(imu.rig_from_imu).tolist()}
