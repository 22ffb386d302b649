"""Examples of the README: TOML is taken by the models it is an example of, a program does what it says."""

import re
import tomllib
from pathlib import Path

import numpy as np
import pytest

from uwsim.dataset.recipe import Recipe, draw_scene
from uwsim.metrics.pose import rotation_error_deg
from uwsim.scene import truth
from uwsim.scene.models import Scene
from uwsim.validation import validated

README = Path(__file__).parents[2] / "README.md"


def blocks() -> list[dict]:
    return [tomllib.loads(text) for text in re.findall(r"```toml\n(.*?)```", README.read_text(encoding="utf-8"), re.S)]


def is_recipe(block: dict) -> bool:
    return "group" in block


def programs() -> list[str]:
    return re.findall(r"```python\n(.*?)```", README.read_text(encoding="utf-8"), re.S)


def test_the_example_of_outliers_runs_and_finds_what_it_says():
    """Expected: the numbers in its comments, and the true pose. Control: the eight wrong points count as such."""
    (text,) = (program for program in programs() if "solve_robust" in program)
    names = {}
    exec(compile(text, str(README), "exec"), names)
    found, placed = names["found"], names["placed"]
    assert f"found.solution.ok[0]  # {found.solution.ok[0]}\n" in text
    assert f"found.inliers.sum()  # {found.inliers.sum()}\n" in text
    assert not found.inliers[:8].any()
    assert rotation_error_deg(found.solution.rotation, placed.rotation)[0] < 0.1
    assert np.allclose(found.solution.translation_m, placed.translation_m, rtol=2e-3)


def test_there_are_examples_of_a_scene_and_of_a_recipe():
    assert sorted(map(is_recipe, blocks())) == [False, True]


def test_the_scene_is_a_scene_and_shows_what_there_is():
    (values,) = (block for block in blocks() if not is_recipe(block))
    scene = validated(Scene, values, where=README)
    assert scene.moves
    assert scene.lens.port is not None
    assert {body.kind for body in scene.bodies} == {"marker_board", "marine_snow"}
    truth.sensor_constants(scene)


def test_control_a_misspelt_key_is_refused():
    (values,) = (block for block in blocks() if not is_recipe(block))
    values["rig"]["camera"]["prot"] = values["rig"]["camera"].pop("port")
    with pytest.raises(ValueError, match="prot"):
        validated(Scene, values, where=README)


def test_the_recipe_draws_scenes():
    (values,) = (block for block in blocks() if is_recipe(block))
    recipe = validated(Recipe, values, where=README)
    assert recipe.orders
    assert draw_scene(recipe, recipe.frames - 1, where=README).bodies[0].name == "board"
