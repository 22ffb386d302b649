"""Broken input is refused: one line on standard error that names the place, exit code 2, and nothing written.

Every case starts from input that is accepted (the last tests are the control) and breaks one thing.
"""

import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tests.system.broken import RECIPE, RENDER, RESTORATION, SCENE, WRONG_PLY, Case, call, picture, put
from tests.system.broken_files import BENCHES, CHECKS, KNOWN, OUTPUTS, PHOTOGRAPHS
from tests.system.broken_placement import MOTIONS, PLACEMENTS, cube
from tests.system.broken_scenes import NAMED, RECIPES, SCENES
from tests.unit import synthetic
from uwsim import cli
from uwsim.dataset.recipe import draw_scene, load_recipe
from uwsim.files import sha256

CASES = SCENES + NAMED + RECIPES + PLACEMENTS + MOTIONS + OUTPUTS + CHECKS + BENCHES + PHOTOGRAPHS


@pytest.fixture(scope="module")
def sound(tmp_path_factory) -> Path:
    """A folder of input that is accepted: scene, recipe, dataset, photograph."""
    folder = tmp_path_factory.mktemp("sound")
    synthetic.write_dataset(folder / "data", (0, 2))
    put(folder, "scene.toml", SCENE)
    put(folder, "recipe.toml", RECIPE)
    put(folder, "garbage.ply", "ply\nthis is no mesh")
    put(folder, "garbage.obj", "v 1 2\nf 1 2 3\n")
    put(folder, "wrong.ply", WRONG_PLY)
    picture(folder, "a.png", np.random.default_rng(0).integers(0, 256, (64, 64, 3)).astype(np.uint8))
    return folder


def prepared(case: Case, sound: Path, folder: Path) -> dict[str, str]:
    for path in sound.iterdir():
        if path.is_file():
            shutil.copy(path, folder)
        elif case.needs_data:
            shutil.copytree(path, folder / path.name)
    case.prepare(folder)
    return listing(folder)


def listing(folder: Path) -> dict[str, str]:
    """Return {path: checksum} of all that lies in a folder; folders have the checksum ''."""
    return {
        path.relative_to(folder).as_posix(): sha256(path) if path.is_file() else ""
        for path in sorted(folder.rglob("*"))
    }


def assert_refused(case: Case, code: object, stdout: str, stderr: str) -> None:
    assert code == 2, (code, stderr)
    assert stdout == ""
    assert stderr.startswith("uwsim: ") and stderr.endswith("\n") and stderr.count("\n") == 1, stderr
    assert "\r" not in stderr and "\x1b" not in stderr
    for fragment in case.fragments:
        assert fragment in stderr


def run_here(arguments: tuple[str, ...], monkeypatch) -> object:
    """Run the command line in this process; return its exit code."""
    monkeypatch.setattr(sys, "argv", ["uwsim", *arguments])
    with pytest.raises(SystemExit) as stop:
        cli.main()
    return stop.value.code


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_broken_input_is_refused_in_one_line_and_leaves_nothing(case, sound, tmp_path, monkeypatch, capfd):
    before = prepared(case, sound, tmp_path)
    monkeypatch.chdir(tmp_path)
    code = run_here(case.arguments, monkeypatch)
    output = capfd.readouterr()
    assert_refused(case, code, output.out, output.err)
    assert listing(tmp_path) == before


@pytest.mark.parametrize("name", ["scene nan", "check EXR truncated and listed", "bench method exits on import"])
def test_a_process_of_its_own_refuses_alike(name, sound, tmp_path):
    (case,) = (case for case in CASES if case.name == name)
    before = prepared(case, sound, tmp_path)
    command = [sys.executable, "-W", "error", "-m", "uwsim.cli", *case.arguments]
    answer = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=120)
    assert_refused(case, answer.returncode, answer.stdout, answer.stderr)
    assert listing(tmp_path) == before


@pytest.mark.parametrize(
    ("arguments", "made"),
    [
        ((*RENDER, "--geometry-only"), {"out", "out/geometry.exr"}),
        (("check", "data"), set()),
        (("restore", "none", "a.png", "--out", "out"), {"out", "out/a.png"}),
        (("deblur", "mmse", "a.png", "--out", "out"), {"out", "out/a.png"}),
        (("deblur", "mmse", "a.png", "--out", "out", "--estimator", "cepstrum_minimum"), {"out", "out/a.png"}),
        (("deblur", "wiener", "a.png", "--out", "out", *KNOWN), {"out", "out/a.png"}),
        ((*RESTORATION, "--quick", "--json", "result.json"), {"result.json"}),
    ],
    ids=lambda value: value[0] if isinstance(value, tuple) else "",
)
def test_control_what_the_cases_start_from_is_accepted(arguments, made, sound, tmp_path, monkeypatch, capfd):
    before = prepared(call("control", ("data",)), sound, tmp_path)
    monkeypatch.chdir(tmp_path)
    code = run_here(arguments, monkeypatch)
    assert (code, capfd.readouterr().err) == (0, "")
    assert set(listing(tmp_path)) - set(before) == made


def test_control_one_may_be_in_a_room(sound, tmp_path, monkeypatch, capfd):
    """The mesh around the camera that is refused with its faces outwards is accepted with its faces inwards."""
    (case,) = (case for case in CASES if case.name == "placement camera inside, geometry")
    prepared(case, sound, tmp_path)
    put(tmp_path, "cube.ply", cube(outward=False))
    monkeypatch.chdir(tmp_path)
    assert run_here(case.arguments, monkeypatch) == 0, capfd.readouterr().err


def test_control_the_recipe_draws_scenes(sound, monkeypatch):
    monkeypatch.chdir(sound)
    loaded, path = load_recipe("recipe.toml")
    drawn = [draw_scene(loaded, frame, where=path) for frame in range(loaded.frames)]
    assert len({scene.rig.lamps[0].half_angle_deg for scene in drawn}) == 2
