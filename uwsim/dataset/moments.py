"""Scenes of frames that belong together: one moment of a sequence, as one of a rig's cameras sees it.

The scene model has one camera, in the rig's origin, and one exposure. A moment of a sequence is that scene with the
rig on the path that it takes through the exposure, and its bodies where they have moved to; another camera of the rig
is a scene whose rig lies in that camera, with the lamps moved against it.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from uwsim.camera import pose
from uwsim.scene.models import Scene
from uwsim.scene.placed import BodyMotion
from uwsim.scene.sequence import RigCamera, Sequence, trajectory_values

ALONE = RigCamera(name="camera")
"""The camera of a rig that has one, in the rig's origin."""


@dataclass(frozen=True)
class Place:
    """Which frame of its group a frame is: of which combination, step of its sequence and camera.

    `first`: index in the group of the first frame that shares the combination; `moment`: frames taken at once share it.
    """

    combination: int
    step: int
    camera: int
    first: int
    moment: int

    @classmethod
    def of(cls, index: int, *, steps: int, cameras: int) -> "Place":
        moment, camera = divmod(index, cameras)
        combination, step = divmod(moment, steps)
        return cls(
            combination=combination, step=step, camera=camera, first=combination * steps * cameras, moment=moment
        )


def at_moment(
    still: Scene, values: dict, *, sequence: Sequence | None, name: str, cameras: tuple[RigCamera, ...], place: Place,
    seed: int, first: int, where: object,
) -> tuple[dict, dict]:  # fmt: skip
    """Return the values of the scene of one frame, and its `time_ns`, `sequence`, `rig` in frame.json.

    still, values: the scene as drawn. name: of the sequence. (seed, first) name the random streams.
    Raises ValueError in one line.
    """
    camera = cameras[place.camera] if cameras else ALONE
    rig_from_camera = camera.rig_from_camera
    values = values | {"rig": dict(values["rig"])}
    poses_at, middle_s, moment = still.rig.poses_at, 0.0, {}
    if sequence is not None:
        for key in ("motion", "trajectory"):
            if getattr(still.rig, key) is not None:
                raise ValueError(
                    f"{where}: rig.{key}: given with a sequence, allowed: one way to say how the rig moves"
                )
        sequence.check_exposure(still.exposure, where=where)
        time_ns = sequence.frame_time_ns(place.step)
        middle_s = time_ns * 1e-9
        poses_at = sequence.trajectory.path(still.rig.world_from_rig, seed=seed, frame=first).poses
        values["bodies"] = [
            _carried_on(body, entry, middle_s, where=where)
            for body, entry in zip(still.bodies, values["bodies"], strict=True)
        ]
        moment = {"time_ns": time_ns, "sequence": name}
    for key in ("position_m", "look_at_m", "roll_deg", "motion"):
        values["rig"].pop(key, None)
    values["rig"]["trajectory"] = trajectory_values(
        lambda times_s: poses_at(times_s) @ rig_from_camera, middle_s=middle_s, half_s=still.shutter.span_s / 2,
        where=where,
    )  # fmt: skip
    if cameras:
        values["rig"]["lamps"] = [
            entry | _lamp_place(pose.inverse(rig_from_camera) @ lamp.rig_from_lamp)
            for lamp, entry in zip(still.rig.lamps, values["rig"].get("lamps", ()), strict=True)
        ]
    moment["rig"] = {
        "camera": camera.name, "moment": place.moment, "rig_from_camera": rig_from_camera.tolist(),
        "world_from_rig": poses_at(np.array([middle_s]))[0].tolist(),
    }  # fmt: skip
    return values, moment


def _lamp_place(camera_from_lamp: np.ndarray) -> dict:
    """Return the keys of a lamp that put it at a pose (4, 4)."""
    at, aim = camera_from_lamp[:3, 3], camera_from_lamp[:3, 3] + camera_from_lamp[:3, 2]
    turn = pose.looking_at(at, aim)[:3, :3].T @ camera_from_lamp[:3, :3]
    return {
        "position_m": at.tolist(), "look_at_m": aim.tolist(),
        "roll_deg": float(np.degrees(np.arctan2(turn[1, 0], turn[0, 0]))),
    }  # fmt: skip


def _carried_on(body, entry: dict, time_s: float, *, where: object) -> dict:
    """Return the values of a body that moves or sways, `time_s` after the time at which the scene gives its place.

    That is time 0 of the sequence's trajectory, and of the body's own.
    """
    if body.kind == "plants" and body.sway_deg > 0:
        entry = entry | {"sway_phase_deg": body.swayed(time_s)}
    if not body.moves:
        return entry
    trajectory, motion = getattr(body, "trajectory", None), getattr(body, "motion", None)
    if trajectory is not None:
        return entry | {"trajectory": entry["trajectory"] | {"times_s": [t - time_s for t in trajectory.times_s]}}
    if not isinstance(motion, BodyMotion):
        raise ValueError(f"{where}: body {body.name} moves, allowed in a sequence: motion or a trajectory")
    if body.kind == "marine_snow":
        if any(motion.rotation_deg_per_s):
            raise ValueError(
                f"{where}: body {body.name}: motion.rotation_deg_per_s: got {motion.rotation_deg_per_s}, "
                "allowed in a sequence: 0 (the box stays parallel to the world's axes)"
            )
        way_m = np.multiply(motion.velocity_m_per_s, time_s)
        return entry | {key: np.add(entry[key], way_m).tolist() for key in ("low_m", "high_m")}
    then = body.poses_at(np.array([time_s]))[0]
    turned = Rotation.from_matrix(then[:3, :3]).as_euler("XYZ", degrees=True)
    kept = {key: value for key, value in entry.items() if key != "towards_m"}
    return kept | {"position_m": then[:3, 3].tolist(), "rotation_deg": turned.tolist()}
