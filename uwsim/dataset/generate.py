"""Generate a dataset: each frame a task, complete or absent; interruptions and who makes it change no byte."""

import json
import shutil
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from uwsim import provenance
from uwsim.dataset import disk, runners, store
from uwsim.dataset.frame import FORMAT_VERSION
from uwsim.dataset.make_sequence import write_sequences
from uwsim.dataset.recipe import Drawn, Recipe, draw, resolved
from uwsim.dataset.task import Task
from uwsim.files import locked
from uwsim.render import memory, placement, shapes, smooth
from uwsim.render.checkpoint import fingerprint
from uwsim.scene import truth
from uwsim.scene.models import Scene

Runner = Callable[[Sequence[Task]], runners.Records]
Done = Callable[[int, int], None]


def generate(
    recipe: Recipe, out: Path, *, where: object, resume: bool, run: Runner = runners.here, side_by_side: int = 1,
    done: Done | None = None,
) -> store.Dataset:  # fmt: skip
    """Generate the frames of `recipe` into `out` and return the dataset.

    where: the recipe's path, for messages and relative scene paths. resume: go on in a folder where the same
    recipe was begun; without it the folder must be empty or absent.
    run: makes the frames, see `runners`; side_by_side: how many at the same time, on this machine and its disk.
    done: called with (frames that are there, frames) as they come.

    Every scene is drawn and checked before the first is rendered. A frame that cannot be made is recorded (run.jsonl,
    `failed` of dataset.json) and left out; `resume` tries it again. Raises ValueError in one line, also where no frame
    could be made and where the disk gets full.
    """
    if any(recipe.options_of(group).denoise for group in recipe.group):
        smooth.require_denoiser()
    drawn = [draw(recipe, frame, where=where) for frame in range(recipe.frames)]
    _require_separate_splits(recipe, drawn, where=where)
    scenes = [one.scene for one in drawn]
    for frame, scene in enumerate(scenes):
        truth.sensor_constants(scene)  # refuses lamps that leave a band dark
        shapes.check_files(scene)
        placement.check(scene)
        camera = scene.rig.camera
        memory.require_memory(
            width_px=camera.width_px, height_px=camera.height_px, workers=side_by_side,
            denoise=recipe.options_of(recipe.locate(frame)[0]).denoise,
        )  # fmt: skip
    out = Path(out)
    manifest = _begin(recipe, scenes, out, resume=resume)
    with locked(out):
        _remove_leftovers(out)
        store.write_manifest(out, manifest)
        write_sequences(recipe, out, where=where)
        tasks = [task_of(recipe, frame, one, frames=out / "frames") for frame, one in enumerate(drawn)]
        failed = _make(tasks, out, run=run, side_by_side=side_by_side, done=done)
        if len(failed) == recipe.frames:
            name, first = next(iter(failed.items()))
            raise ValueError(f"{where}: no frame could be made; {name}: {first['error']}")
        if failed:
            write_sequences(recipe, out, where=where, without=failed)
        _remove_leftovers(out)
        manifest |= {"complete": True, "files": store.checksums(out)} | ({"failed": failed} if failed else {})
        store.write_manifest(out, manifest)
    return store.open(out)


def task_of(recipe: Recipe, frame: int, drawn: Drawn, *, frames: Path) -> Task:
    """Return the task of making one frame of a recipe in a folder of its own in `frames`."""
    group = recipe.locate(frame)[0]
    return Task(
        folder=frames / f"{frame:06d}", group=group.name, seed=recipe.seed, frame=frame, scene=drawn.scene,
        moment=drawn.moment, until=recipe.until, options=recipe.options_of(group),
    )  # fmt: skip


def _make(tasks: list[Task], out: Path, *, run: Runner, side_by_side: int, done: Done | None) -> dict[str, dict]:
    """Have the frames made that are not there; return {name: seed and error} of those that could not be."""
    (out / "frames").mkdir(exist_ok=True)
    left = [task for task in tasks if not task.folder.is_dir()]
    disk.require_room(out, left)
    largest = max((disk.frame_bytes(task) for task in left), default=0)
    there, failed = len(tasks) - len(left), {}
    for record in run(left) if left else ():
        _log(out, **record)
        if "error" in record:
            failed[record["frame"]] = {key: record[key] for key in ("seed", "error")}
        there += 1
        if done is not None:
            done(there, len(tasks))
        if there < len(tasks):
            disk.require_spare(out, frames=side_by_side, bytes_each=largest)
    return dict(sorted(failed.items()))


def _require_separate_splits(recipe: Recipe, drawn: list[Drawn], *, where: object) -> None:
    """Refuse bodies that are seen in two splits: a method would be tested on what it was trained on."""
    seen: dict[str, tuple[str, str]] = {}
    for frame, one in enumerate(drawn):
        group = recipe.locate(frame)[0]
        if group.split is None:
            return
        name, split = seen.setdefault(fingerprint(one.still.bodies), (group.name, group.split))
        if split != group.split:
            raise ValueError(
                f"{where}: groups {name} ({split}) and {group.name} ({group.split}) show the same bodies in the same "
                "places, allowed: splits that share no scene; change a seed or a place"
            )


def _begin(recipe: Recipe, scenes: list[Scene], out: Path, *, resume: bool) -> dict:
    """Return the manifest of an unfinished dataset in the folder `out`, made if it is not there."""
    manifest = {
        "format": FORMAT_VERSION,
        "name": recipe.name,
        "complete": False,
        "seed": recipe.seed,
        "recipe": resolved(recipe),
        "scenes_sha256": fingerprint(scenes),
        "versions": _versions(),
        "commit": provenance.commit(),
        "machine": _machine(),
        "files": {},
    }
    if out.exists() and not out.is_dir():
        raise ValueError(f"--out {out}: is a file, allowed: an empty or new folder")
    if out.is_dir() and any(out.iterdir()):
        if not resume:
            raise ValueError(f"--out {out}: the folder is not empty; go on with --resume, or choose another folder")
        found = store.read_manifest(out)
        for key in ("format", "name", "seed", "recipe", "scenes_sha256", "versions", "machine"):
            if found[key] != manifest[key]:
                raise ValueError(f"--resume {out}: {key} differs from what was begun there; choose another folder")
        manifest["commit"] = found["commit"]
    out.mkdir(parents=True, exist_ok=True)
    return manifest


def _remove_leftovers(out: Path) -> None:
    """Delete what a killed run, or a worker that was given up for lost, left half-written."""
    for part in ("frames", "sequences"):
        for folder in (out / part).glob("*.partial"):
            shutil.rmtree(folder)
    for file in out.glob(".partial-*"):
        file.unlink()


def _versions() -> dict:
    return provenance.versions()


def _machine() -> dict:
    from uwsim.render import llvm, variants

    choice = llvm.choose()
    return provenance.machine(libllvm=choice.path, llvm_version=choice.version) | {"variant": variants.active()}


def _log(out: Path, **entry) -> None:
    entry = {"time": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime())} | entry
    with (out / "run.jsonl").open("a", encoding="utf-8") as stream:
        stream.write(json.dumps(entry) + "\n")
