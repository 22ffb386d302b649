"""Generate a dataset: one frame after the other, each complete or absent; interruptions change nothing."""

import json
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

from uwsim import provenance
from uwsim.dataset import store
from uwsim.dataset.frame import FORMAT_VERSION, write_frame
from uwsim.dataset.make import make_frame
from uwsim.dataset.make_sequence import write_sequences
from uwsim.dataset.recipe import Recipe, draw, resolved
from uwsim.render import memory, placement, shapes, smooth
from uwsim.render.checkpoint import fingerprint
from uwsim.scene import truth
from uwsim.scene.models import Scene

Progress = Callable[[int, int, str, int, int], None]


def generate(
    recipe: Recipe, out: Path, *, where: object, resume: bool, progress: Progress | None = None
) -> store.Dataset:
    """Generate the frames of `recipe` into `out` and return the dataset.

    where: the recipe's path, for messages and relative scene paths. resume: go on in a folder where the same
    recipe was begun; without it the folder must be empty or absent.
    progress: called with (frame, frames, picture, done, total).

    Every scene is drawn and checked before the first is rendered. Raises ValueError in one line.
    """
    if recipe.denoise:
        smooth.require_denoiser()
    drawn = [draw(recipe, frame, where=where) for frame in range(recipe.frames)]
    scenes = [one.scene for one in drawn]
    for scene in scenes:
        truth.sensor_constants(scene)  # refuses lamps that leave a band dark
        shapes.check_files(scene)
        placement.check(scene)
        memory.require_memory(width_px=scene.rig.camera.width_px, height_px=scene.rig.camera.height_px)
    manifest = _begin(recipe, scenes, Path(out), resume=resume)
    write_sequences(recipe, Path(out), where=where)
    frames = Path(out) / "frames"
    frames.mkdir(exist_ok=True)
    for frame, scene in enumerate(scenes):
        folder = frames / f"{frame:06d}"
        if folder.is_dir():
            continue
        started = time.monotonic()
        report = None if progress is None else partial(progress, frame, recipe.frames)
        made = make_frame(
            scene, name=folder.name, group=recipe.locate(frame)[0].name, seed=recipe.seed, frame=frame,
            until=recipe.until, progress=report, options=recipe.options, moment=drawn[frame].moment,
        )  # fmt: skip
        write_frame(folder, **made)
        _log(Path(out), frame=folder.name, seconds=round(time.monotonic() - started, 3))
    manifest |= {"complete": True, "files": store.checksums(Path(out))}
    store.write_manifest(Path(out), manifest)
    return store.open(Path(out))


def _begin(recipe: Recipe, scenes: list[Scene], out: Path, *, resume: bool) -> dict:
    """Return the manifest of an unfinished dataset in `out`, new or the one found there."""
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
        _remove_leftovers(out)
        manifest["commit"] = found["commit"]
    out.mkdir(parents=True, exist_ok=True)
    store.write_manifest(out, manifest)
    return manifest


def _remove_leftovers(out: Path) -> None:
    """Delete what a killed run left half-written."""
    import shutil

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
