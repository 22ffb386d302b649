"""Recipes: what is drawn depends on (seed, frame, key) and on nothing else, and stays within its bounds."""

import numpy as np
import pytest

from uwsim.dataset.recipe import Choice, Recipe, Uniform, draw_scene, load_recipe, put, resolved
from uwsim.files import shipped
from uwsim.validation import validated

HALF_ANGLE = "rig.lamps.0.half_angle_deg"
RANGES = {HALF_ANGLE: {"distribution": "uniform", "low": 20.0, "high": 40.0}}
TURNS = {"bodies.board.rotation_deg": {"distribution": "uniform", "low": [-9.0, 0.0, 1.0], "high": [9.0, 0.0, 2.0]}}
FACTORS = {"water.particle_factor": {"distribution": "log_uniform", "low": 0.01, "high": 100.0}}


def recipe(draw: dict, *, seed: int = 1, frames: int = 20, **changes) -> Recipe:
    group = {"name": "one", "scene": "tank_markers", "frames": frames, "draw": draw} | changes
    values = {"name": "test", "description": "", "seed": seed, "samples_per_pixel": 4, "batches": 2, "group": [group]}
    return validated(Recipe, values, where="test")


def scenes(made: Recipe) -> list:
    return [draw_scene(made, frame, where="test") for frame in range(made.frames)]


def half_angles(made: Recipe) -> list[float]:
    return [scene.rig.lamps[0].half_angle_deg for scene in scenes(made)]


def test_the_same_seed_and_frame_draw_the_same_scene():
    made = recipe(RANGES | TURNS, frames=3)
    assert scenes(made) == scenes(recipe(RANGES | TURNS, frames=3))
    assert draw_scene(made, 2, where="test") == scenes(made)[2]  # one frame alone


def test_control_seed_and_frame_matter():
    assert half_angles(recipe(RANGES, seed=1)) != half_angles(recipe(RANGES, seed=2))
    assert len(set(half_angles(recipe(RANGES)))) == 20


def test_a_new_draw_shifts_no_other():
    assert half_angles(recipe(RANGES, frames=5)) == half_angles(recipe(TURNS | RANGES | FACTORS, frames=5))


def test_two_draws_of_one_frame_are_independent():
    made = recipe(RANGES | {"water.particle_factor": RANGES[HALF_ANGLE]}, frames=8)
    pairs = [(scene.rig.lamps[0].half_angle_deg, scene.water.particle_factor) for scene in scenes(made)]
    assert all(abs(angle - factor) > 1e-6 for angle, factor in pairs)


def test_frames_keep_their_values_when_a_group_grows():
    assert half_angles(recipe(RANGES, frames=5)) == half_angles(recipe(RANGES, frames=9))[:5]


def test_uniform_fills_its_bounds():
    rng = np.random.default_rng(0)
    kind = validated(Uniform, RANGES[HALF_ANGLE], where="test")
    angles = [kind.draw(rng) for _ in range(300)]
    assert 20 <= min(angles) < 20.5 and 39.5 < max(angles) <= 40  # 300 draws miss the last 2.5 % with 0.0005
    turns = np.array([scene.bodies[0].rotation_deg for scene in scenes(recipe(TURNS, frames=40))])
    assert np.all((turns >= [-9, 0, 1]) & (turns <= [9, 0, 2]))
    assert np.ptp(turns, axis=0) == pytest.approx([18, 0, 1], rel=0.15)
    assert np.all(turns[:, 1] == 0)


def test_log_uniform_is_uniform_in_the_logarithm():
    kind = validated(Uniform, FACTORS["water.particle_factor"], where="test")
    rng = np.random.default_rng(0)
    drawn = np.array([kind.draw(rng) for _ in range(4000)])
    assert drawn.min() >= 0.01 and drawn.max() <= 100
    # standard error of a share of one half: 0.8 %
    assert np.mean(drawn < 1) == pytest.approx(0.5, abs=0.04)
    assert np.mean(drawn < 50) < 0.95  # a uniform draw would have one half here


def test_in_order_takes_turns_within_a_group_and_choice_takes_all():
    names = ["tank_clear", "tank_low", "tank_high"]
    draw = {"water.name": {"distribution": "in_order", "values": names}}
    assert [scene.water.name for scene in scenes(recipe(draw, frames=5))] == [*names, *names[:2]]
    kind = validated(Choice, {"distribution": "choice", "values": names}, where="test")
    rng = np.random.default_rng(0)
    picked = [kind.pick(rng, 0) for _ in range(300)]
    assert set(picked) == set(names)
    assert [picked.count(name) / 300 for name in names] == pytest.approx([1 / 3] * 3, abs=0.12)


def test_values_keep_their_kind():
    values = {"distribution": "in_order", "values": [3, 2.5, "a", True, [1, 2], {"name": "b"}]}
    picked = [validated(Choice, values, where="test").pick(np.random.default_rng(0), index) for index in range(6)]
    assert [repr(value) for value in picked] == ["3", "2.5", "'a'", "True", "(1.0, 2.0)", "{'name': 'b'}"]


def test_set_goes_before_draw_and_the_group_before_the_recipe():
    path = shipped("scenes/datasets") / "tiny.toml"
    tiny, where = load_recipe(str(path))
    assert draw_scene(tiny, 0, where=where).rig.camera.width_px == 64
    made = recipe(RANGES, frames=1, set={HALF_ANGLE: 80.0, "exposure.time_s": 0.5})
    scene = draw_scene(made, 0, where="test")
    assert scene.exposure.time_s == 0.5
    assert scene.rig.lamps[0].half_angle_deg <= 40


def test_groups_are_numbered_through():
    tiny, where = load_recipe("tiny")
    assert tiny.frames == 6
    assert [(tiny.locate(frame)[0].name, tiny.locate(frame)[1]) for frame in range(6)] == [
        ("chart", 0), ("chart", 1), ("markers", 0), ("markers", 1), ("motion", 0), ("motion", 1),
    ]  # fmt: skip
    with pytest.raises(ValueError, match="frame 6: the recipe has 6 frames"):
        tiny.locate(6)
    assert draw_scene(tiny, 4, where=where).rig.motion is not None
    assert draw_scene(tiny, 3, where=where).rig.motion is None


@pytest.mark.parametrize("path", sorted(shipped("scenes/datasets").glob("*.toml")), ids=lambda path: path.stem)
def test_shipped_recipes_draw_all_their_scenes(path):
    made, where = load_recipe(str(path))
    assert made.name == path.stem
    drawn = [draw_scene(made, frame, where=where) for frame in range(made.frames)]
    assert len({scene.model_dump_json() for scene in drawn}) == made.frames


GRID = [
    {"set": {"rig.lamps.0.look_at_m": [[0.0, 0.0, 1.0], [0.0, 0.0, 2.0]], "exposure.time_s": [0.1, 0.2]}},
    {"multiply": {"rig.lamps.0.half_angle_deg": [0.5, 1.0, 1.5], "rig.position_m": [1.0, 1.0, 1.0]}},
]


def grid_recipe(grid: list, **changes) -> Recipe:
    group = {"name": "one", "scene": "tank_markers", "grid": grid} | changes
    values = {"name": "test", "description": "", "seed": 1, "samples_per_pixel": 4, "batches": 2, "group": [group]}
    return validated(Recipe, values, where="test")


def test_a_grid_takes_all_combinations_the_last_axis_fastest():
    made = grid_recipe(GRID)
    assert made.frames == 6
    base = half_angles(recipe({}, frames=1))[0]
    drawn = scenes(made)
    assert [scene.rig.lamps[0].half_angle_deg / base for scene in drawn] == pytest.approx([0.5, 1.0, 1.5] * 2)
    moved = [(scene.rig.lamps[0].look_at_m[2], scene.exposure.time_s) for scene in drawn]
    assert moved == [(1.0, 0.1)] * 3 + [(2.0, 0.2)] * 3  # keys of one axis move together
    assert len({scene.model_dump_json() for scene in drawn}) == 6


def test_axes_multiply_what_sets_axes_and_draws_put_there():
    drawn = {"distribution": "in_order", "values": [10.0, 20.0]}
    twice = [{"multiply": {HALF_ANGLE: [1.0, 2.0]}}, {"multiply": {HALF_ANGLE: [1.0, 1.5]}}]
    assert half_angles(grid_recipe(twice, set={HALF_ANGLE: 20.0})) == pytest.approx([20, 30, 40, 60])
    assert half_angles(grid_recipe(twice, draw={HALF_ANGLE: drawn})) == pytest.approx([10, 30, 20, 60])


def test_groups_with_and_without_a_grid_are_numbered_through_and_recorded():
    values = grid_recipe(GRID).model_dump()
    values["group"] = [*values["group"], {"name": "two", "scene": "tank_markers", "frames": 2}]
    made = validated(Recipe, values, where="test")
    assert made.frames == 8
    assert [made.locate(frame)[0].name for frame in range(8)] == ["one"] * 6 + ["two"] * 2
    data = resolved(made)
    assert "grid" in data["group"][0]
    assert "grid" not in data["group"][1]
    assert validated(Recipe, data, where="test") == made


@pytest.mark.parametrize(
    ("grid", "changes", "part"),
    [
        (GRID, {"frames": 6}, "frames: got 6 with a grid"),
        ([], {}, "frames: missing"),
        ([{"set": {"a": [1], "b": [1, 2]}}], {}, "same length"),
        ([{"set": {}}], {}, "at least one"),
        ([{"set": {"exposure.time_s": 1}}], {}, "allowed: a list"),
        ([{"multiply": {"exposure.time_s": ["a"]}}], {}, "allowed: a number"),
        ([{"multiply": {"bodies.0.kind": [2]}}], {}, "allowed: a number or a list of numbers"),
        ([{"multiply": {"rig.lamps.0.power": [2]}}], {}, "no 'power' there"),
        ([{"scale": {"exposure.time_s": [2]}}], {}, "unknown key, allowed: set, multiply"),
    ],
)
def test_a_grid_that_is_none_is_refused_in_one_line(grid, changes, part):
    with pytest.raises(ValueError, match=part) as caught:
        draw_scene(grid_recipe(grid, **changes), 0, where="test")
    assert "\n" not in str(caught.value)


def test_put_finds_entries_by_name_and_number_and_makes_tables():
    values = {"lamps": [{"name": "a"}, {"name": "b"}]}
    put(values, "lamps.b.power", 3, where="test")
    put(values, "lamps.0.power", 4, where="test")
    put(values, "motion.speed", 5, where="test")
    assert values == {"lamps": [{"name": "a", "power": 4}, {"name": "b", "power": 3}], "motion": {"speed": 5}}
    with pytest.raises(ValueError, match="no entry 'c', allowed"):
        put(values, "lamps.c.power", 3, where="test")
