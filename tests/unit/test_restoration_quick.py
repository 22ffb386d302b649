"""The quick run of the restoration benchmark shows scenes of the full one, smaller and in the same waters."""

import pytest

from uwsim.bench.definition import read_definition
from uwsim.dataset.recipe import draw, load_recipe

WATERS = ["tank_clear", "tank_low", "tank_medium", "tank_high"]
SIZE = {"width_px", "height_px"}


def scenes(name: str, frames) -> list[dict]:
    recipe, where = load_recipe(name)
    return [draw(recipe, frame, where=where).scene.model_dump() for frame in frames]


def without_size(scene: dict) -> dict:
    camera = {key: value for key, value in scene["rig"]["camera"].items() if key not in SIZE}
    return scene | {"rig": scene["rig"] | {"camera": camera}}


@pytest.mark.parametrize(("first", "of_the_full"), [(0, 8), (4, 24)])
def test_a_scene_is_one_of_the_full_set(first, of_the_full):
    """Control: not its neighbour."""
    quick = scenes("restoration_quick", range(first, first + 4))
    assert [scene["water"]["name"] for scene in quick] == WATERS
    full = scenes("restoration_bench", range(of_the_full, of_the_full + 4))
    assert [without_size(scene) for scene in quick] == [without_size(scene) for scene in full]
    assert quick != full
    (other,) = scenes("restoration_bench", [of_the_full + 4])
    assert without_size(quick[0]) != without_size(other)


def test_a_quick_run_takes_every_frame_of_the_quick_set():
    definition = read_definition("restoration")[1]
    recipes = [load_recipe(name)[0] for name in (definition.dataset, definition.quick_dataset)]
    assert [recipe.frames for recipe in recipes] == [48, definition.quick_cases]
