"""A dataset has the same bytes whether its generation was killed and resumed, and for any number of threads.

Each run is a process of its own; kills are SIGKILL at seeded random moments, so nothing can be tidied up.
"""

import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from uwsim.dataset import store
from uwsim.files import shipped

RECIPE = """
name = "small"
description = "Three frames of 32 x 24, the last in motion"
seed = {seed}
samples_per_pixel = 8
batches = 4
set = {{ "rig.camera.width_px" = 32, "rig.camera.height_px" = 24 }}
[[group]]
name = "chart"
scene = "tank_usaf"
frames = 2
[group.draw]
"rig.lamps.0.half_angle_deg" = {{ distribution = "uniform", low = 25.0, high = 45.0 }}
[[group]]
name = "motion"
scene = "tank_markers"
frames = 1
set = {{ "rig.motion.velocity_m_per_s" = [2.0, 1.0, 0.0] }}
"""
COMMAND = "from uwsim import cli; cli.main()"
WITH_THREADS = """
from uwsim.render import variants
variants.use()
import drjit
drjit.set_thread_count({threads})
assert drjit.thread_count() == {threads}
"""
STARTED_S = 120.0


def start(*arguments: str | Path, threads: int | None = None) -> subprocess.Popen:
    """Start the command line in a process of its own, with a number of rendering threads if given."""
    code = (WITH_THREADS.format(threads=threads) if threads else "") + COMMAND
    command = [sys.executable, "-W", "error", "-c", code, *map(str, arguments)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def finish(process: subprocess.Popen) -> None:
    output, problems = process.communicate(timeout=600)
    assert (process.returncode, problems) == (0, ""), (output, problems)


def generate(recipe: str | Path, out: Path, *options: str, threads: int | None = None) -> dict[str, str]:
    """Generate a dataset, check it, and return its checksums."""
    finish(start("generate", recipe, "--out", out, *options, threads=threads))
    finish(start("check", out))
    assert not list(out.rglob("*.partial*"))
    return store.open(out).manifest["files"]


def complete(out: Path) -> set[str]:
    return {path.name for path in (out / "frames").glob("*") if not path.name.endswith(".partial")}


def kill_when(recipe: str | Path, out: Path, *, frames: int, delay_s: float) -> set[str]:
    """Generate until so many frames are complete, then a little longer, then kill; return the complete frames."""
    process = start("generate", recipe, "--out", out, "--resume")
    deadline = time.monotonic() + STARTED_S
    while len(complete(out)) < frames or not (out / "dataset.json").exists():
        assert process.poll() is None and time.monotonic() < deadline, process.communicate()
        time.sleep(0.01)
    time.sleep(delay_s)
    process.send_signal(signal.SIGKILL)
    process.communicate()
    assert process.returncode == -signal.SIGKILL, "ended before it was killed: the test says nothing"
    return complete(out)


def interrupted(recipe: str | Path, out: Path, kills: list[tuple[int, float]]) -> dict[str, str]:
    """Generate with a kill after each (frames, delay); frames that were complete stay as they were."""
    before: dict[str, str] = {}
    for frames, delay_s in kills:
        found = kill_when(recipe, out, frames=frames, delay_s=delay_s)
        refused = start("check", out)
        assert "unfinished" in refused.communicate()[1] and refused.returncode == 2
        now = {file: checksum for file, checksum in store.checksums(out).items() if Path(file).parts[1] in found}
        assert before.items() <= now.items()
        before = now
    final = generate(recipe, out, "--resume")
    assert before.items() <= final.items()
    return final


@pytest.fixture(scope="module")
def small(tmp_path_factory) -> tuple[Path, dict[str, str]]:
    """The path of a small recipe, and the checksums of an uninterrupted run."""
    folder = tmp_path_factory.mktemp("small")
    (folder / "small.toml").write_text(RECIPE.format(seed=1))
    return folder / "small.toml", generate(folder / "small.toml", folder / "whole")


def test_killed_and_resumed_gives_the_same_bytes(small, tmp_path):
    recipe, whole = small
    delay_s = random.Random(1).uniform(0.0, 0.5)
    assert interrupted(recipe, tmp_path / "killed", [(1, delay_s)]) == whole
    assert len(whole) == 9


def test_another_number_of_threads_gives_the_same_bytes(small, tmp_path):
    recipe, whole = small
    assert generate(recipe, tmp_path / "one", threads=1) == whole


def test_control_another_seed_gives_other_bytes(small, tmp_path):
    _, whole = small
    (tmp_path / "other.toml").write_text(RECIPE.format(seed=2))
    other = generate(tmp_path / "other.toml", tmp_path / "other")
    assert other.keys() == whole.keys()
    assert all(other[file] != whole[file] for file in whole)


@pytest.mark.slow
def test_tiny_killed_three_times_and_with_three_threads(tmp_path):
    recipe = shipped("scenes/datasets") / "tiny.toml"
    rng = random.Random(7)
    whole = generate(recipe, tmp_path / "whole")
    kills = [(frames, rng.uniform(0.0, 2.0)) for frames in (0, 2, 4)]
    assert interrupted(recipe, tmp_path / "killed", kills) == whole
    assert generate(recipe, tmp_path / "three", threads=3) == whole
    assert len(whole) == 18
