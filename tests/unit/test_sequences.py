"""Sequences in recipes and on disk: who is when where, what is written is read, planted faults are found."""

import shutil

import numpy as np
import pytest

import uwsim.dataset
from tests.unit import synthetic
from uwsim.camera import pose
from uwsim.dataset import store
from uwsim.dataset.check import check
from uwsim.dataset.frame import write_frame
from uwsim.dataset.info import FrameInfo
from uwsim.dataset.make_sequence import first_frames, write_sequences
from uwsim.dataset.recipe import Recipe, draw, draw_scene, load_recipe, resolved
from uwsim.files import read_json, shipped, write_json
from uwsim.scene.load import load_scene
from uwsim.validation import validated

SWING = {"kind": "arm_swing", "speed_percent": 100.0}
PAIR = [{"name": "left", "position_m": [-0.03, 0.0, 0.0]}, {"name": "right", "rotation_deg": [0.0, -4.0, 0.0]}]
DRAW = {"rig.lamps.0.half_angle_deg": {"distribution": "uniform", "low": 20.0, "high": 40.0}}
SPEEDS = [{"set": {"sequence.trajectory.speed_percent": [20.0, 100.0], "water.name": ["tank_clear", "tank_low"]}}]


def recipe(*, sequence=None, **changes) -> Recipe:
    group = {"name": "one", "scene": "tank_markers"} | changes
    if sequence is not None:
        group["sequence"] = {"trajectory": SWING, "frames": 3} | sequence
    values = {"name": "test", "description": "", "seed": 1, "samples_per_pixel": 4, "batches": 2, "group": [group]}
    return validated(Recipe, values, where="test")


def drawn(made: Recipe) -> list:
    return [draw(made, frame, where="test") for frame in range(made.frames)]


def test_frames_of_a_sequence_share_what_is_drawn_and_follow_the_trajectory():
    made = recipe(sequence={"fps": 25.0, "start_s": 0.4}, draw=DRAW)
    frames = drawn(made)
    assert [one.moment["time_ns"] for one in frames] == [420_000_000, 460_000_000, 500_000_000]
    assert {one.moment["sequence"] for one in frames} == {"one"}
    assert len({one.scene.rig.lamps[0].half_angle_deg for one in frames}) == 1
    path = made.group[0].sequence.trajectory.path(frames[0].still.rig.world_from_rig, seed=1, frame=0)
    assert [one.scene.rig.world_from_rig for one in frames] == pytest.approx(path.poses(np.array([0.42, 0.46, 0.5])))
    half_s = frames[1].scene.exposure.time_s / 2
    ends = frames[1].scene.rig.poses_at(np.array([-half_s, half_s]))
    assert ends == pytest.approx(path.poses(0.46 + np.array([-half_s, half_s])), abs=2e-6)
    assert draw(made, 1, where="test") == frames[1]  # one frame alone


def test_a_grid_makes_one_sequence_of_each_combination():
    made = recipe(sequence={}, grid=SPEEDS)
    assert made.frames == 6
    frames = drawn(made)
    assert [one.moment["sequence"] for one in frames] == ["one_000"] * 3 + ["one_001"] * 3
    assert [one.sequence.trajectory.speed_percent for one in frames] == [20.0] * 3 + [100.0] * 3
    assert [one.scene.water.name for one in frames] == ["tank_clear"] * 3 + ["tank_low"] * 3
    assert [first for _, _, first in first_frames(made)] == [0, 3]
    data = resolved(made)
    assert validated(Recipe, data, where="test") == made
    assert "cameras" not in data["group"][0] and "sequence" not in resolved(recipe(frames=1))["group"][0]


def test_cameras_of_a_rig_see_the_same_moment_under_the_same_lamps():
    """Negative control: with the lamps of the scene as they are, they would move with each camera."""
    left, right, later, _ = drawn(recipe(frames=2, cameras=PAIR, draw=DRAW))
    assert (left.moment["rig"]["camera"], right.moment["rig"]["camera"]) == ("left", "right")
    assert [one.moment["rig"]["moment"] for one in (left, right, later)] == [0, 0, 1]
    assert "time_ns" not in left.moment
    for one, camera in ((left, PAIR[0]), (right, PAIR[1])):
        rig_from_camera = np.array(one.moment["rig"]["rig_from_camera"])
        expected = one.still.rig.world_from_rig @ rig_from_camera
        assert one.scene.rig.world_from_rig == pytest.approx(expected, abs=1e-12)
        assert rig_from_camera[:3, 3] == pytest.approx(camera.get("position_m", [0, 0, 0]))
    lamps = [one.scene.rig.world_from_rig @ one.scene.rig.lamps[0].rig_from_lamp for one in (left, right)]
    assert lamps[0] == pytest.approx(lamps[1], abs=1e-12)
    still = [one.scene.rig.world_from_rig @ one.still.rig.lamps[0].rig_from_lamp for one in (left, right)]
    assert np.abs(still[0] - still[1]).max() > 0.02
    half_angles = [one.scene.rig.lamps[0].half_angle_deg for one in (left, right, later)]
    assert half_angles[0] == half_angles[1] != half_angles[2]
    assert not left.scene.moves


def test_bodies_move_on_from_frame_to_frame():
    turn = {"velocity_m_per_s": [0.1, 0.0, 0.0], "rotation_deg_per_s": [0.0, 30.0, 0.0]}
    frames = drawn(recipe(sequence={"fps": 20.0}, set={"bodies.board.motion": turn}))
    boards = [one.scene.bodies[0] for one in frames]
    first = frames[0].still.bodies[0]
    for board, time_s in zip(boards, (0.025, 0.075, 0.125), strict=True):
        assert board.world_from_body == pytest.approx(first.poses_at(np.array([time_s]))[0], abs=1e-12)
        assert board.motion == first.motion
    snow = {
        "name": "snow", "kind": "marine_snow", "low_m": [0, 0.2, -1], "high_m": [0.5, 0.7, -0.5], "count": 5,
        "diameters_m": [0.001, 0.002], "reflectance": 0.5, "seed": 1, "motion": {"velocity_m_per_s": [0, 0, -0.2]},
    }  # fmt: skip
    frames = drawn(recipe(sequence={"fps": 20.0}, set={"bodies.floor": snow}))
    assert [one.scene.bodies[2].low_m[2] for one in frames] == pytest.approx([-1.005, -1.015, -1.025])


def test_a_body_on_a_trajectory_moves_on_by_the_clock_of_the_sequence(tmp_path):
    """Negative control: with the times as they are it would do the same in every frame."""
    text = (shipped("scenes") / "tank_markers.toml").read_text()
    path = (
        "trajectory = { times_s = [0.0, 0.2], positions_m = [[0.0, 0.8, -0.6], [0.1, 0.8, -0.6]], "
        "look_at_m = [[0.0, 0.0, -0.6], [0.0, 0.0, -0.6]] }"
    )
    place = "position_m = [0.0, 0.8, -0.6]\ntowards_m = [0.0, 0.0, -0.6]\n"
    assert place in text
    (tmp_path / "moving.toml").write_text(text.replace(place, path + "\n"))
    scene = str(tmp_path / "moving.toml")
    set_ = {"exposure.time_s": 0.02}
    with pytest.raises(ValueError, match="do not cover the exposure"):
        drawn(recipe(frames=1, scene=scene, set=set_))
    with pytest.raises(ValueError, match="do not cover the exposure"):
        drawn(recipe(sequence={"fps": 20.0}, scene=scene, set=set_))  # nor do they in the scene itself
    (tmp_path / "moving.toml").write_text(text.replace(place, path.replace("[0.0, 0.2]", "[-0.2, 0.2]") + "\n"))
    frames = drawn(recipe(sequence={"fps": 20.0}, scene=scene, set=set_))
    assert [one.scene.bodies[0].world_from_body[0, 3] for one in frames] == pytest.approx(
        [0.05 + 0.25 * time_s for time_s in (0.025, 0.075, 0.125)], abs=1e-4
    )


@pytest.mark.parametrize(
    ("sequence", "changes", "part"),
    [
        ({}, {"frames": 3}, "frames: got 3 with a sequence"),
        ({"duration_s": 1.0}, {}, "either frames or duration_s"),
        ({"frames": None, "duration_s": 0.01}, {}, "allowed: at least 0.0333333"),
        ({"fps": 100.0}, {"set": {"exposure.time_s": 0.02}}, "exposure.time_s: got 0.02 s, allowed: at most 0.01 s"),
        ({"fps": 100.0}, {"set": {"exposure.readout_s": 0.02}}, "exposure.readout_s: got 0.02 s"),
        ({}, {"set": {"rig.motion.velocity_m_per_s": [1.0, 0.0, 0.0]}}, "rig.motion: given with a sequence"),
        ({}, {"set": {"sequence.trajectory.speed": 3.0}}, "trajectory.speed: unknown key"),
        ({}, {"set": {"sequence.fps": 0.0}}, "sequence: fps: got 0.0, allowed: > 0"),
        ({}, {"set": {"sequence.frames": 4}}, "sequence has 4 frames, allowed: as in the group, 3"),
        ({"trajectory": {"kind": "fly"}}, {}, "kind: got 'fly', allowed: 'arm_linear', 'arm_swing', 'hover'"),
        ({}, {"cameras": [{"name": "a"}, {"name": "a"}]}, "not unique"),
        (None, {"frames": 1, "set": {"sequence.fps": 3.0}}, "sequence: unknown key"),
    ],
)
def test_a_sequence_that_is_none_is_refused_in_one_line(sequence, changes, part):
    with pytest.raises(ValueError, match=part) as caught:
        draw_scene(recipe(sequence=sequence, **changes), 0, where="test")
    assert "\n" not in str(caught.value)


def test_a_trajectory_out_of_the_water_is_refused():
    hover = {"kind": "hover", "current": {"drift_m_per_s": [0.0, 0.0, 5.0]}}
    with pytest.raises(ValueError, match="below the water surface"):
        drawn(recipe(sequence={"trajectory": hover, "frames": 10}))


def test_two_sequences_of_one_name_are_refused():
    group = recipe(sequence={}, grid=SPEEDS).model_dump()["group"][0]
    other = {"name": "one_001", "scene": "tank_markers", "sequence": {"trajectory": SWING, "frames": 1}}
    values = recipe(frames=1).model_dump() | {"group": [group, other]}
    with pytest.raises(ValueError, match="two sequences would be called one_001"):
        validated(Recipe, values, where="test")


@pytest.fixture(scope="module")
def sound(tmp_path_factory):
    """A dataset with the sequences of tiny_sequence; its frames are synthetic pictures with the right numbers."""
    folder = tmp_path_factory.mktemp("data") / "sound"
    made, where = load_recipe("tiny_sequence")
    write_sequences(made, folder, where=where)
    single = synthetic.write_dataset(folder.parent / "single", (0,)).frame("000000")
    buffers = {name: single.buffer(name) for name in single.buffer_names}
    for frame in range(made.frames):
        write_frame(
            folder / f"frames/{frame:06d}", image=single.image, buffers=buffers, info=_info(single, made, frame)
        )
    sealed(folder, store.open(single.folder.parent.parent).manifest)
    return store.open(folder)


def _info(single, made: Recipe, frame: int) -> FrameInfo:
    one = draw(made, frame, where="test")
    values = single.info.model_dump() | {"name": f"{frame:06d}", "frame": frame} | one.moment
    values["camera"] = values["camera"] | {"world_from_camera": one.scene.rig.world_from_rig.tolist()}
    return FrameInfo.model_validate(values)


def sealed(folder, manifest: dict) -> None:
    store.write_manifest(folder, manifest | {"files": store.checksums(folder)})


def test_sequences_there_and_back(sound):
    dataset = uwsim.dataset.open(sound.folder)
    assert check(sound.folder) == 7
    arm, hover = dataset.sequences
    assert (arm.name, hover.name) == ("arm", "hover")
    assert arm.frame_names() == ("000000", "000001", "000002")
    assert hover.frame_names("right") == ("000004", "000006")
    with pytest.raises(ValueError, match="got 'up', allowed: left, right"):
        hover.frame_names("up")
    assert np.all(np.diff(arm.imu["time_ns"]) == 5_000_000)
    assert arm.imu["time_ns"][0] == 500_000_000
    assert arm.imu["time_ns"][-1] >= 600_000_000
    assert arm.trajectory["velocity_m_per_s"][0] == pytest.approx([0.1, 0, 0])
    assert arm.trajectory["world_from_rig"][0] == pytest.approx(
        draw(load_recipe("tiny_sequence")[0], 0, where="test").still.rig.world_from_rig
        @ pose.from_parts(np.eye(3), (-0.0625, 0, 0))
    )  # at full speed since 0.25 s, 12.5 mm of which the ramp took: -0.1 + 0.0125 + 0.025
    # the IMU is turned by 90 degrees about the rig's z: its x axis is the rig's y, which points down
    assert arm.imu["specific_force_m_per_s2"].mean(axis=0) == pytest.approx([-9.80665, 0, 0], abs=0.05)
    assert np.array(arm.info.imu.rig_from_imu)[:3, 3] == pytest.approx([0.05, 0, -0.02])


def test_single_frames_have_no_keys_of_sequences(tmp_path):
    dataset = synthetic.write_dataset(tmp_path / "single", (0,))
    assert dataset.sequences == ()
    assert not {"time_ns", "sequence", "rig"} & set(read_json(dataset.folder / "frames/000000/frame.json"))


@pytest.mark.parametrize(
    ("name", "part"),
    [
        ("time", "another time or camera"),
        ("listed", "also one of"),
        ("missing", "is not part of the dataset"),
        ("place", "off trajectory.csv"),
        ("imu", "different time_ns"),
        ("order", "time_ns does not increase in row 3"),
        ("cells", "not a table of numbers"),
        ("columns", "columns are"),
        ("file", "has .*allowed"),
        ("loose", "it is listed by none"),
    ],
)
def test_planted_faults_are_found(sound, tmp_path, name, part):
    folder = tmp_path / "broken"
    shutil.copytree(sound.folder, folder)
    arm = folder / "sequences/arm"
    description, table, imu = arm / "sequence.json", arm / "trajectory.csv", arm / "imu.csv"
    values = read_json(description)
    frames = values["frames"]
    match name:
        case "time":
            frames[1]["time_ns"] += 1000
        case "listed":
            frames[1] = frames[0]
        case "missing":
            frames[1]["name"] = "000099"
        case "loose":
            del frames[2]
        case "place":
            path = folder / "frames/000001/frame.json"
            frame = read_json(path)
            for pose_of in (frame["rig"]["world_from_rig"], frame["camera"]["world_from_camera"]):
                pose_of[0][3] += 0.01
            write_json(path, frame)
        case "imu":
            imu.write_text("\n".join(imu.read_text().splitlines()[:-1]) + "\n")
        case "order":
            lines = table.read_text().splitlines()
            table.write_text("\n".join([lines[0], lines[2], lines[1], *lines[3:]]) + "\n")
        case "cells":
            table.write_text(table.read_text().replace("500000000", "x", 1))
        case "columns":
            table.write_text(table.read_text().replace("_m_per_s,", "_cm_per_s,", 1))
        case "file":
            (arm / "more.csv").write_text("")
    write_json(description, values)
    sealed(folder, sound.manifest)
    with pytest.raises(ValueError, match=part) as caught:
        check(folder)
    assert "\n" not in str(caught.value)


def test_control_a_changed_byte_and_a_stray_folder_are_found(sound, tmp_path):
    folder = tmp_path / "broken"
    shutil.copytree(sound.folder, folder)
    (folder / "sequences/stray").mkdir()
    with pytest.raises(ValueError, match="folder sequences/stray is not part"):
        check(folder)
    (folder / "sequences/stray").rmdir()
    path = folder / "sequences/arm/imu.csv"
    path.write_text(path.read_text() + "\n")
    with pytest.raises(ValueError, match="imu.csv was changed"):
        check(folder)


def test_the_platform_is_that_of_the_dissertation():
    """Chapter 6: 1280 x 720, 80 deg, 30 frames per second; the paraxial 64 deg in water is 58 deg at the edges."""
    scene = load_scene("tank_platform")
    assert scene.rig.camera.K[0, 0] == pytest.approx(763, abs=0.5)
    assert (scene.rig.camera.width_px, scene.rig.camera.height_px) == (1280, 720)
    assert scene.exposure.time_s <= 1 / 30
    _, directions = scene.lens.rays(np.array([[0.0, 360.0], [1280.0, 360.0]]))
    edges_deg = np.degrees(np.arccos(directions[0] @ directions[1]))
    assert edges_deg == pytest.approx(
        2 * np.degrees(np.arcsin(np.sin(np.radians(40)) / scene.water.refractive_index)), abs=1e-6
    )
    assert 2 * np.degrees(np.arctan(640 / (763 * 1.3335))) == pytest.approx(64.3, abs=0.1)
    for percent in (20.0, 60.0, 100.0):
        motion = {"kind": "arm_linear", "speed_percent": percent}
        made = recipe(scene="tank_platform", sequence={"trajectory": motion, "start_s": 1.0, "frames": 1})
        half_s = scene.exposure.time_s / 2
        ends = draw_scene(made, 0, where="test").rig.poses_at(np.array([-half_s, half_s]))
        assert np.linalg.norm(ends[1, :3, 3] - ends[0, :3, 3]) == pytest.approx(percent / 1000 * scene.exposure.time_s)
