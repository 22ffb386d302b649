"""Worker processes: results in any order, what happens when one is killed, and frames as tasks of a dataset."""

import os
import signal
from dataclasses import replace
from pathlib import Path

import pytest

from uwsim import workers
from uwsim.dataset import disk, runners, task
from uwsim.dataset.generate import task_of
from uwsim.dataset.recipe import Recipe, draw
from uwsim.dataset.task import Task
from uwsim.files import locked
from uwsim.validation import validated


def double(number: int) -> int:
    return 2 * number


def fatal(number: int) -> int:
    if number == 3:
        os.kill(os.getpid(), signal.SIGKILL)
    return number


def tasks(folder: Path, count: int, **scene) -> list[Task]:
    group = {"name": "one", "scene": "tank_markers", "frames": count, "set": scene}
    values = {"name": "test", "description": "", "seed": 3, "samples_per_pixel": 4, "batches": 2, "group": [group]}
    recipe = validated(Recipe, values, where="test")
    return [task_of(recipe, frame, draw(recipe, frame, where="test"), frames=folder) for frame in range(count)]


def dies_once(made: Task) -> dict:
    """Kill the process at the second frame, the first time it is tried."""
    mark = made.folder.parent / "tried"
    if made.frame == 1 and not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return {"frame": made.folder.name, "seconds": 0.0}


def dies(made: Task) -> dict:
    if made.frame == 1:
        os.kill(os.getpid(), signal.SIGKILL)
    return {"frame": made.folder.name, "seconds": 0.0}


def by_two(given: list[Task], make) -> dict[str, dict]:
    records = list(runners.by_processes(given, processes=2, threads=1, make=make))
    assert len(records) == len(given)
    return {record["frame"]: record for record in records}


def test_every_task_has_its_result():
    found = dict(workers.results(double, [(n,) for n in range(7)], processes=2, option="--workers"))
    assert found == {n: 2 * n for n in range(7)}


def test_a_killed_process_names_what_it_leaves_undone():
    done = {}
    with pytest.raises(workers.Killed, match="--workers 2: a process was killed") as killed:
        for number, result in workers.results(fatal, [(n,) for n in range(9)], processes=2, option="--workers"):
            done[number] = result
    assert 3 in killed.value.unfinished and not set(done) & set(killed.value.unfinished)


@pytest.fixture
def no_renderer(monkeypatch):
    # the processes of these tests render nothing
    monkeypatch.setattr(runners, "prepare", double)
    monkeypatch.setattr(runners.workers, "results", lambda make, given, **options: _plain(make, given, options))


_RESULTS = workers.results


def _plain(make, given, options):
    return _RESULTS(make, given, **options | {"prepare": ()})


def test_frames_of_a_killed_process_are_made_again(tmp_path, no_renderer):
    records = by_two(tasks(tmp_path, 5), dies_once)
    assert (tmp_path / "tried").exists()
    assert not any("error" in record for record in records.values())


def test_a_frame_that_kills_its_process_twice_is_a_failure_and_the_others_are_made(tmp_path, no_renderer):
    records = by_two(tasks(tmp_path, 5), dies)
    assert [name for name, record in records.items() if "error" in record] == ["000001"]
    assert records["000001"]["seed"] == 3 and "killed" in records["000001"]["error"]


def test_a_frame_that_raises_is_a_record_with_its_seed(tmp_path, monkeypatch):
    def broken(scene, **options):
        raise RuntimeError("the\nscene is too dark")

    monkeypatch.setattr(task, "make_frame", broken)
    assert task.finish(tasks(tmp_path, 1)[0]) == {
        "frame": "000000", "seed": 3, "error": "RuntimeError: the scene is too dark"
    }  # fmt: skip
    assert not list(tmp_path.iterdir())


def test_a_full_disk_is_no_fault_of_the_frame(tmp_path, monkeypatch):
    def full(scene, **options):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(task, "make_frame", full)
    with pytest.raises(OSError, match="No space left"):
        task.finish(tasks(tmp_path, 1)[0])


def test_a_frame_that_is_there_is_not_made_again(tmp_path, monkeypatch):
    monkeypatch.setattr(task, "make_frame", None)
    (tmp_path / "000000").mkdir()
    assert task.finish(tasks(tmp_path, 1)[0]) == {"frame": "000000", "found": True}


def test_room_on_the_disk_is_seen_to(tmp_path, monkeypatch):
    given = tasks(tmp_path, 2, **{"rig.camera.width_px": 640, "rig.camera.height_px": 480})
    each = disk.frame_bytes(given[0])
    assert 100 < each / (640 * 480) < 130  # 104 bytes of float pictures, a PNG of noise, a description
    assert disk.frame_bytes(replace(given[0], options=type(given[0].options)(orders=True))) == each + 24 * 640 * 480
    free = disk._SPARE_BYTES + 2 * each
    monkeypatch.setattr(disk.shutil, "disk_usage", lambda path: type("usage", (), {"free": free}))
    disk.require_room(tmp_path, given)
    disk.require_spare(tmp_path, frames=2, bytes_each=each)
    with pytest.raises(ValueError, match=r"3 frames need up to 0\.3 GB, allowed: the 0\.3 GB"):
        disk.require_room(tmp_path, [*given, given[0]])
    with pytest.raises(ValueError, match="stopped with 0.3 GB free on the disk; make room, and go on with --resume"):
        disk.require_spare(tmp_path, frames=3, bytes_each=each)


def test_one_run_at_a_time_writes_into_a_folder(tmp_path):
    with locked(tmp_path), pytest.raises(ValueError, match="another run is writing there"), locked(tmp_path):
        pass
    with locked(tmp_path):
        pass
