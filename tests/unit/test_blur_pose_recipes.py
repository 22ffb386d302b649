"""The shipped recipes of blur and pose sets hold what they promise: lengths, angles, places and orientations."""

import numpy as np
import pytest

from uwsim.camera import pose
from uwsim.dataset.recipe import draw, load_recipe

TABLE_ROWS_MM = {200: (0,), 400: (0, 50, 100), 600: (0, 50, 100), 800: (0, 50, 100), 1000: (0, 50, 100)}


def frames_of(recipe, name: str) -> range:
    first = 0
    for group in recipe.group:
        if group.name == name:
            return range(first, first + group.count)
        first += group.count
    raise AssertionError(name)


def test_a_blur_set_has_every_length_at_every_angle():
    """Expected: what the image's centre sees moves by the frame's entry of the grid, in the order of the grid."""
    recipe, where = load_recipe("blur_tank")
    frames = frames_of(recipe, "usaf")
    grid = [(length, angle) for length in (5, 10, 20, 40) for angle in (0, 30, 60, 90, 135)]
    assert len(frames) == 4 * len(grid)
    for number in (0, 7, 26, 59, 79):
        scene = draw(recipe, frames[number], where=where).scene
        half_s, world = scene.exposure.time_s / 2, scene.rig.world_from_rig
        ends = scene.rig.poses_at(np.array([-half_s, half_s]))
        point = pose.apply(world, np.array([0.0, 0.0, 0.4]))  # of the chart, 0.4 m ahead
        start, end = (scene.lens.project(pose.apply(pose.inverse(at), point))[0] for at in ends)
        right, down = end - start
        length, angle = grid[number % len(grid)]
        assert np.hypot(right, down) == pytest.approx(length, abs=1e-4)
        assert (np.degrees(np.arctan2(-down, right)) - angle + 90) % 180 == pytest.approx(90, abs=1e-3)
    waters = [draw(recipe, frames[number], where=where).scene.water.name for number in (0, 20, 40, 60)]
    assert waters == ["tank_clear", "tank_low", "tank_medium", "tank_high"]


def test_a_pose_set_has_the_places_and_orientations_of_the_tables():
    recipe, where = load_recipe("pose_tank")
    frames = frames_of(recipe, "bipyramid")
    assert len(frames) == 13 * 90
    rows = [(far, aside) for far, asides in TABLE_ROWS_MM.items() for aside in asides]
    for number in (0, 45, 90, 5 * 90 + 44, 13 * 90 - 1):
        scene = draw(recipe, frames[number], where=where).scene
        camera_from_body = pose.inverse(scene.rig.world_from_rig) @ scene.bodies[0].world_from_body
        far, aside = rows[number // 90]
        assert 1e3 * camera_from_body[:3, 3] == pytest.approx((aside, 0.0, far), abs=1e-6)
        # body z from straight at the camera by so much about the camera's x
        turn = np.radians(-88 + 2 * (number % 90))
        assert np.abs(camera_from_body[:3, 2] @ (1.0, 0.0, 0.0)) < 1e-9
        assert -camera_from_body[2, 2] == pytest.approx(np.cos(turn), abs=1e-9)
    angles = {tuple(value) for value in recipe.group[0].grid[1].set["bodies.markers.rotation_deg"]}
    assert len(angles) == 90


@pytest.mark.parametrize("name", ["stereo_rig", "calibration_port", "bipyramid_lit", "train", "charuco", "apriltag"])
def test_the_other_pose_sets_can_be_drawn(name):
    recipe, where = load_recipe("pose_tank")
    frames = frames_of(recipe, name)
    for frame in (frames[0], frames[-1]):
        drawn = draw(recipe, frame, where=where)
        assert drawn.scene.rig.camera.width_px == 640
        assert ("rig" in drawn.moment) == name.startswith("stereo")


def test_the_tables_whole():
    """Expected: the places and orientations of the full set, all combinations."""
    known, full = (
        {key: {tuple(value) for value in values} for grid in load_recipe(name)[0].group[0].grid
         for key, values in grid.set.items()}
        for name in ("pose_tables", "pose_tank")
    )  # fmt: skip
    assert known == full
    assert len(frames_of(load_recipe("pose_tables")[0], "bipyramid")) == 13 * 90


def test_the_benchmark_of_poses_has_the_tables_rows():
    """Expected: 13 places, each in the same six orientations of the ninety, places as in the full set; each other
    group can be drawn."""
    recipe, where = load_recipe("pose_bench")
    frames = frames_of(recipe, "bipyramid")
    assert len(frames) == 13 * 6
    rows = [(far, aside) for far, asides in TABLE_ROWS_MM.items() for aside in asides]
    full = {tuple(value) for value in load_recipe("pose_tank")[0].group[0].grid[1].set["bodies.markers.rotation_deg"]}
    assert {tuple(value) for value in recipe.group[0].grid[1].set["bodies.markers.rotation_deg"]} < full
    for number in (0, 7, 40, 77):
        scene = draw(recipe, frames[number], where=where).scene
        camera_from_body = pose.inverse(scene.rig.world_from_rig) @ scene.bodies[0].world_from_body
        far, aside = rows[number // 6]
        assert 1e3 * camera_from_body[:3, 3] == pytest.approx((aside, 0.0, far), abs=1e-6)
    gaps_m = {}
    for group in recipe.group[1:]:
        scene = draw(recipe, frames_of(recipe, group.name)[-1], where=where).scene
        gaps_m[group.name] = scene.lens.port.gap_m if scene.lens.port else None
    assert gaps_m["thick_port"] > gaps_m["bipyramid_turbid"] > 0 and gaps_m["apriltag"] is None
    assert gaps_m["apriltag_port"] == gaps_m["bipyramid_turbid"]
