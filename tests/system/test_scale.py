"""A dataset has the same bytes whoever makes it: one process, several, or the workers of a Dask cluster; killed or not.

Every run, scheduler and worker is a process of its own; kills are SIGKILL, so nothing can be tidied up.
"""

import contextlib
import json
import os
import random
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest
from test_resume import complete, finish, start

from uwsim.dataset import store, task
from uwsim.dataset.check import check
from uwsim.dataset.generate import generate
from uwsim.dataset.recipe import load_recipe
from uwsim.render import variants

RECIPE = """
name = "many"
description = "{frames} frames of {width} x {height}"
seed = 4
samples_per_pixel = {samples}
batches = 2
set = {{ "rig.camera.width_px" = {width}, "rig.camera.height_px" = {height} }}
[[group]]
name = "markers"
scene = "tank_markers"
frames = {frames}
[group.draw]
"rig.lamps.0.half_angle_deg" = {{ distribution = "uniform", low = 25.0, high = 45.0 }}
"""
DASK_S = 60.0


def written(folder: Path, *, frames: int, width: int = 32, height: int = 24, samples: int = 8) -> Path:
    folder.mkdir(exist_ok=True)
    path = folder / "many.toml"
    path.write_text(RECIPE.format(frames=frames, width=width, height=height, samples=samples))
    return path


def checksums(out: Path) -> dict[str, str]:
    """Return the checksums of a finished dataset, after looking that it is sound and nothing is left behind."""
    check(out)
    assert not list(out.rglob("*partial*"))
    return store.open(out).manifest["files"]


def wait_for(out: Path, frames: int, process: subprocess.Popen) -> None:
    deadline = time.monotonic() + 120
    while len(complete(out)) < frames:
        assert process.poll() is None and time.monotonic() < deadline, process.communicate()
        time.sleep(0.02)


def children(process: subprocess.Popen) -> list[int]:
    """Return the worker processes of a run: those of its children that multiprocessing began."""
    found = []
    for entry in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            parent = int((entry / "stat").read_text().rpartition(")")[2].split()[1])
            if parent == process.pid and b"spawn_main" in (entry / "cmdline").read_bytes():
                found.append(int(entry.name))
    return found


@pytest.fixture(scope="module")
def recipe(tmp_path_factory) -> Path:
    return written(tmp_path_factory.mktemp("scale"), frames=8)


@pytest.fixture(scope="module")
def whole(recipe) -> dict[str, str]:
    """The checksums of a run in one process with one thread."""
    out = recipe.parent / "whole"
    finish(start("generate", recipe, "--out", out, "--threads", "1"))
    return checksums(out)


def test_two_workers_of_one_thread_give_the_same_bytes(recipe, whole, tmp_path):
    finish(start("generate", recipe, "--out", tmp_path / "out", "--workers", "2", "--threads", "1"))
    assert checksums(tmp_path / "out") == whole


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="finds the workers in /proc")
def test_a_killed_worker_process_costs_no_frame(recipe, whole, tmp_path):
    out = tmp_path / "out"
    run = start("generate", recipe, "--out", out, "--workers", "2", "--threads", "1")
    wait_for(out, 1, run)
    os.kill(children(run)[0], signal.SIGKILL)
    finish(run)
    assert checksums(out) == whole


def test_a_killed_run_leaves_no_worker_and_goes_on(recipe, whole, tmp_path):
    out = tmp_path / "out"
    run = start("generate", recipe, "--out", out, "--workers", "2", "--threads", "1")
    wait_for(out, 2, run)
    workers = children(run)
    run.kill()
    run.communicate()
    assert len(complete(out)) < 8, "ended before it was killed: the test says nothing"
    deadline = time.monotonic() + 20
    while any((Path("/proc") / str(worker)).exists() for worker in workers) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not any((Path("/proc") / str(worker)).exists() for worker in workers)
    finish(start("generate", recipe, "--out", out, "--workers", "2", "--threads", "1", "--resume"))
    assert checksums(out) == whole


def test_a_frame_that_cannot_be_made_is_recorded_left_out_and_made_later(recipe, whole, tmp_path, monkeypatch):
    made, out = task.make_frame, tmp_path / "out"

    def breaks(scene, *, frame, **options):
        if frame == 5:
            raise RuntimeError("the compiler gave up")
        return made(scene, frame=frame, **options)

    variants.use()
    loaded, where = load_recipe(str(recipe))
    monkeypatch.setattr(task, "make_frame", breaks)
    dataset = generate(loaded, out, where=where, resume=False)
    assert dataset.manifest["failed"] == {"000005": {"seed": 4, "error": "RuntimeError: the compiler gave up"}}
    assert len(dataset) == check(out) == 7
    assert any("error" in record for record in logged(out))
    monkeypatch.setattr(task, "make_frame", made)
    healed = generate(loaded, out, where=where, resume=True)
    assert "failed" not in healed.manifest
    assert checksums(out) == whole


def test_frames_that_cannot_be_made_end_with_exit_code_1_and_one_line(recipe, tmp_path):
    out = tmp_path / "out"
    code = (
        "from uwsim.dataset import task; made = task.make_frame\n"
        "def breaks(scene, *, frame, **options):\n"
        "    if frame % 2: raise ValueError('too dark')\n"
        "    return made(scene, frame=frame, **options)\n"
        "task.make_frame = breaks\n"
        "from uwsim import cli; cli.main()"
    )
    run = subprocess.run(
        [sys.executable, "-c", code, "generate", recipe, "--out", out], capture_output=True, text=True
    )  # fmt: skip
    assert run.returncode == 1 and len(run.stderr.splitlines()) == 1
    assert "4 of 8 frames could not be made" in run.stderr and "000001 of seed 4: ValueError: too dark" in run.stderr


def free_port() -> int:
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return listener.getsockname()[1]


@pytest.fixture
def dask(tmp_path):
    """Give the address of a scheduler, and a function that starts a worker process; all are killed afterwards."""
    pytest.importorskip("distributed")
    address, begun = f"tcp://127.0.0.1:{free_port()}", []

    def begin(*arguments: str) -> subprocess.Popen:
        command = [sys.executable, "-m", "dask", *arguments, "--no-dashboard"]
        with (tmp_path / f"dask{len(begun)}.log").open("w") as log:
            begun.append(subprocess.Popen(command, stdout=log, stderr=log, cwd=tmp_path))
        return begun[-1]

    begin("scheduler", "--host", "127.0.0.1", "--port", address.rpartition(":")[2])
    yield address, lambda: begin("worker", address, "--nthreads", "1", "--no-nanny")
    for process in begun:
        process.kill()
        process.wait()


def wait_for_workers(address: str, count: int) -> None:
    from distributed import Client

    with Client(address, timeout=DASK_S, set_as_default=False) as client:
        client.wait_for_workers(count, timeout=DASK_S)


def logged(out: Path) -> list[dict]:
    log = out / "run.jsonl"
    return [json.loads(line) for line in log.read_text().splitlines()] if log.exists() else []


def test_a_cluster_gives_the_same_bytes_though_a_worker_is_killed(recipe, whole, tmp_path, dask):
    address, worker = dask
    out, workers = tmp_path / "out", [worker(), worker()]
    wait_for_workers(address, 2)
    run = start("generate", recipe, "--out", out, "--cluster", address)
    deadline = time.monotonic() + DASK_S
    while len({record["worker"] for record in logged(out)}) < 2:
        assert run.poll() is None and time.monotonic() < deadline, run.communicate()
        time.sleep(0.02)
    # each has made a frame and is at the next: that of the one that dies is given to the other
    workers[0].kill()
    finish(run)
    assert checksums(out) == whole
    records = logged(out)
    assert sorted(record["frame"] for record in records) == [f"{n:06d}" for n in range(8)]
    assert len({record["worker"] for record in records}) == 2


def test_a_worker_that_does_not_see_the_folder_and_no_scheduler_are_one_line(recipe, tmp_path, dask):
    pytest.importorskip("distributed")
    run = start("generate", recipe, "--out", tmp_path / "out", "--cluster", "tcp://127.0.0.1:1", "--workers", "2")
    assert "--workers: got 2 with --cluster" in run.communicate()[1] and run.returncode == 2
    run = start("generate", recipe, "--out", tmp_path / "out", "--cluster", "nonsense://here")
    problems = run.communicate()[1]
    assert run.returncode == 2 and len(problems.splitlines()) == 1 and "no scheduler at nonsense://here" in problems


@pytest.mark.slow
@pytest.mark.timeout(3600)
def test_a_thousand_frames_killed_and_resumed(tmp_path):
    """Nothing lost, nothing double, no partial file, over runs killed at seeded random moments."""
    recipe = written(tmp_path / "recipe", frames=1000, width=8, height=6, samples=2)
    out, rng, kills = tmp_path / "out", random.Random(11), 0
    arguments = ("generate", recipe, "--out", out, "--workers", "2", "--threads", "1", "--resume")
    while len(complete(out)) < 900:
        run = start(*arguments)
        wait_for(out, min(999, len(complete(out)) + rng.randrange(20, 200)), run)
        time.sleep(rng.uniform(0, 0.3))
        run.kill()
        run.communicate()
        kills += 1
    finish(start(*arguments))
    assert kills >= 5
    files = checksums(out)
    assert len(files) == 3000 and check(out) == 1000
    seen = [record["frame"] for record in logged(out) if "seconds" in record]
    assert len(seen) == len(set(seen)), "a frame was made twice"
    # a sample of them made again, in one process, has the same bytes
    again = tmp_path / "again"
    finish(start("generate", written(tmp_path / "few", frames=40, width=8, height=6, samples=2), "--out", again))
    assert checksums(again).items() <= files.items()
