"""The tank and its recipes: layouts differ between splits, views are paired, plants sway as a sequence goes on."""

import numpy as np
import pytest
from pydantic import TypeAdapter

from uwsim import files
from uwsim.dataset.recipe import Recipe, draw, draw_scene, load_recipe
from uwsim.scene import bodies
from uwsim.scene.load import load_scene
from uwsim.validation import validated

TURBIDITIES = ["tank_clear", "tank_low", "tank_medium", "tank_high"]
TANK_RECIPES = ("restoration_tank", "platform_tank")


@pytest.fixture(scope="module", params=TANK_RECIPES)
def shipped(request):
    """A shipped recipe, and what its frames are by their numbers: of a sequence the first and the last moment."""
    recipe, path = load_recipe(request.param)
    return recipe, {frame: draw(recipe, frame, where=path) for frame in range(recipe.frames) if _asked(recipe, frame)}


def _asked(recipe, frame) -> bool:
    group, index = recipe.locate(frame)
    return group.sequence is None or group.place(index).step in (0, group.sequence.count - 1)


def frames_of(recipe, drawn, group):
    return [one for frame, one in drawn.items() if recipe.locate(frame)[0].name == group.name]


def named(scene, name):
    return next(body for body in scene.bodies if body.name == name)


def test_all_of_a_tank_recipe_draws_in_its_turbidities(shipped):
    recipe, drawn = shipped
    for group in recipe.group:
        waters = [one.scene.water.name for one in frames_of(recipe, drawn, group)]
        here = TURBIDITIES if group.name != "hover" else ["tank_clear", "tank_medium"]
        assert [waters.count(name) for name in here] == [len(waters) / len(here)] * len(here)


@pytest.mark.parametrize("name", sorted(path.stem for path in files.shipped("scenes/datasets").glob("*.toml")))
def test_every_shipped_recipe_draws_the_first_frame_of_each_group(name):
    recipe, path = load_recipe(name)
    first = 0
    for group in recipe.group:
        assert draw_scene(recipe, first, where=path).rig.camera.width_px > 0
        first += group.count


def test_what_is_solid_and_large_stays_within_the_tank(shipped):
    """Plates, pipes and the places of stones and plants: nothing stands in a wall or under the tank's floor."""
    recipe, drawn = shipped
    for group in recipe.group:
        for one in {id(x.still.bodies): x for x in frames_of(recipe, drawn, group)}.values():
            tank = named(one.still, "tank")
            half = np.array([tank.width_m, tank.length_m]) / 2
            for body in one.still.bodies:
                if body.kind in ("rusty_wall", "pipe"):
                    corners = _box_corners(body)
                    assert np.all(np.abs(corners[:, :2]) < half), (group.name, body.name)
                    assert corners[:, 2].min() > tank.position_m[2], (group.name, body.name)
                elif body.kind in ("stones", "plants"):
                    reach = np.abs(body.position_m[:2]) + np.array(body.field_m) / 2
                    assert np.all(reach < half), (group.name, body.name)


def _box_corners(body) -> np.ndarray:
    if body.kind == "pipe":
        radius = body.radius_m + body.flange_m
        box = np.array([radius, radius, body.length_m / 2])
    else:
        box = np.array([body.width_m / 2, body.height_m / 2, body.rust_m])
    corners = np.array(np.meshgrid(*[(-1, 1)] * 3)).reshape(3, -1).T * box
    pose = body.world_from_body
    return corners @ pose[:3, :3].T + pose[:3, 3]


def test_layouts_of_different_splits_share_no_stone_plant_or_sand():
    recipe, path = load_recipe("restoration_tank")
    seen = {}
    for frame in range(recipe.frames):
        group = recipe.locate(frame)[0]
        for body in draw_scene(recipe, frame, where=path).bodies:
            if body.kind != "tank":
                seen.setdefault((body.kind, body.name, body.seed), set()).add(group.split)
    assert {group.split for group in recipe.group} == {"train", "val", "test"}
    assert all(len(splits) == 1 for splits in seen.values())


def test_pairs_differ_in_the_water_alone_and_views_in_the_place_of_the_rig():
    recipe, path = load_recipe("restoration_tank")
    scenes = [draw_scene(recipe, frame, where=path) for frame in range(recipe.frames)]
    for first in range(0, recipe.frames, 4):
        view = scenes[first : first + 4]
        assert [scene.water.name for scene in view] == TURBIDITIES
        assert {scene.model_copy(update={"water": None}).model_dump_json() for scene in view} == {
            view[0].model_copy(update={"water": None}).model_dump_json()
        }
    places = [scene.rig.position_m for scene in scenes[::4]]
    layouts = [scene.bodies for scene in scenes[::4]]
    pairs = list(zip(layouts, places, strict=True))
    assert all(pairs[i] != pairs[j] for i in range(len(pairs)) for j in range(i))
    assert len({hash(layout) for layout in map(str, layouts)}) == 6


def test_the_tank_is_filmed_by_the_platform():
    """Chapter 6: 1280 x 720 and 80 deg in air, f = 763 px, behind a flat port; 12 bits; light sets the gain."""
    scene, recipe = load_scene("tank"), load_recipe("platform_tank")[0]
    assert scene.rig.camera.K[0, 0] == pytest.approx(763, abs=0.5)
    assert scene.rig.camera.port.kind == "flat" and scene.sensor.adc_bits == 12
    assert scene.exposure.auto.adjust == "gain" and scene.exposure.time_s <= 1 / 30
    assert all(group.sequence.fps == 30.0 and group.sequence.imu is not None for group in recipe.group)
    assert [len(group.cameras) for group in recipe.group] == [0, 0, 2]


def test_the_arm_moves_at_the_speeds_asked_for(shipped):
    recipe, drawn = shipped
    if recipe.name != "platform_tank":
        pytest.skip("no arm")
    speeds = []
    for one in (one for group in recipe.group[:2] for one in frames_of(recipe, drawn, group)):
        ends = one.scene.rig.poses_at(np.array([-0.5, 0.5]) * one.scene.exposure.time_s)[:, :3, 3]
        speeds.append(one.sequence.trajectory.speed_m_per_s)
        assert np.linalg.norm(ends[1] - ends[0]) / one.scene.exposure.time_s == pytest.approx(speeds[-1], rel=0.03)
    assert sorted(set(speeds)) == pytest.approx([0.02, 0.04, 0.06, 0.08, 0.1])


# ---- plants that sway ----


def plants(**changes):
    values = {"name": "grass", "kind": "plants", "seed": 1, "count": 12, "field_m": (0.3, 0.3)}
    return TypeAdapter(bodies.Body).validate_python(values | {"position_m": (0.0, 0.0, -0.7)} | changes)


def swaying(**changes) -> Recipe:
    """A sequence of 12 frames, two per second, in the tank."""
    group = {
        "name": "sway", "scene": "tank", "set": changes,
        "sequence": {"fps": 2.0, "frames": 12, "trajectory": {"kind": "arm_swing", "speed_percent": 20.0}},
    }  # fmt: skip
    values = {"name": "test", "description": "", "seed": 1, "samples_per_pixel": 4, "batches": 2, "group": [group]}
    return validated(Recipe, values, where="test")


def grass_of(recipe: Recipe, frame: int):
    return named(draw_scene(recipe, frame, where="test"), "eelgrass")


def test_frames_of_a_sequence_show_plants_that_sway_and_come_back_after_a_period():
    recipe = swaying(**{"bodies.eelgrass.sway_period_s": 3.0})
    grass = [grass_of(recipe, frame) for frame in range(12)]
    phases = [body.sway_phase_deg for body in grass]
    assert phases[:4] == pytest.approx([30.0, 90.0, 150.0, 210.0])  # the middles of the frames' periods
    assert phases[6:] == pytest.approx(phases[:6])
    first, second, again = (grass[frame].parts["plants"].vertices for frame in (0, 1, 6))
    assert np.abs(first - second).max() > 0.02
    assert first == pytest.approx(again, abs=1e-9)
    roots = first[:, 2] < 1e-3
    assert roots.any() and np.abs(first - second)[roots].max() < 0.002
    assert np.array_equal(first, grass_of(swaying(), 0).parts["plants"].vertices)  # one frame, made again alone


def test_control_plants_that_do_not_sway_are_the_same_in_every_frame():
    recipe = swaying(**{"bodies.eelgrass.sway_deg": 0.0})
    assert len({grass_of(recipe, frame).model_dump_json() for frame in range(12)}) == 1


def test_other_seeds_sway_otherwise():
    moved = [
        plants(seed=seed, sway_phase_deg=90.0).parts["plants"].vertices - plants(seed=seed).parts["plants"].vertices
        for seed in (1, 2)
    ]
    assert np.abs(moved[0] - moved[1]).max() > 0.01


def test_tips_are_as_fast_as_the_docstring_says():
    """Expected: 0.08 m/s at most, half of the surface below 0.013 m/s. Tolerance: printed digits."""
    step_deg = 1.0
    step_s = step_deg / 360 * plants().sway_period_s
    fastest, usual = [], []
    for phase in range(0, 360, 30):
        ends = [plants(sway_phase_deg=phase + sign * step_deg / 2).parts["plants"].vertices for sign in (-1, 1)]
        speed = np.linalg.norm(ends[1] - ends[0], axis=-1) / step_s
        fastest.append(speed.max())
        usual.append(np.median(speed))
    assert max(fastest) == pytest.approx(0.08, abs=0.005)
    assert max(usual) == pytest.approx(0.013, abs=0.0005)
    assert 0.016 * 763 * 1.3335 * max(fastest) == pytest.approx(1.4, abs=0.1)


@pytest.mark.parametrize("changes", [{"sway_period_s": 0.0}, {"sway_deg": -1.0}, {"sway_period_s": "long"}])
def test_impossible_sways_are_refused(changes):
    with pytest.raises(ValueError, match=next(iter(changes))):
        plants(**changes)
