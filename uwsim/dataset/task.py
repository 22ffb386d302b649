"""One frame to make, as a task of its own: any process can do it, twice does no harm, and a crash is a record."""

import errno
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from uwsim.dataset.frame import write_frame
from uwsim.dataset.make import make_frame
from uwsim.render import smooth, stopping
from uwsim.scene.models import Scene

_NO_ROOM = (errno.ENOSPC, errno.EDQUOT)


@dataclass(frozen=True)
class Task:
    """A frame of a dataset; can be pickled. `folder`: where it goes; (seed, frame) name its random streams."""

    folder: Path
    group: str
    seed: int
    frame: int
    scene: Scene
    moment: dict
    until: stopping.Until
    options: smooth.Options


def finish(task: Task, *, progress: Callable[[str, int, int], None] | None = None) -> dict:
    """Make a frame and write it, unless it is there; return its record for run.jsonl.

    `seconds` in the record of a frame that was made; of one that could not be made `error`, see `failed`. A full disk
    is an OSError: it is no fault of the frame.
    """
    if task.folder.is_dir():
        return {"frame": task.folder.name, "found": True}
    started = time.monotonic()
    try:
        made = make_frame(
            task.scene, name=task.folder.name, group=task.group, seed=task.seed, frame=task.frame, until=task.until,
            progress=progress, options=task.options, moment=task.moment,
        )  # fmt: skip
        write_frame(task.folder, **made)
    except Exception as error:
        if task.folder.is_dir():  # a worker given up for lost had gone on, and was first: same task, same bytes
            return {"frame": task.folder.name, "found": True}
        if isinstance(error, OSError) and error.errno in _NO_ROOM:
            raise
        return failed(task, f"{type(error).__name__}: {error}")
    return {"frame": task.folder.name, "seconds": round(time.monotonic() - started, 3)}


def failed(task: Task, why: str) -> dict:
    """Return the record of a frame that could not be made, with what it takes to make it again."""
    return {"frame": task.folder.name, "seed": task.seed, "error": " ".join(why.split())}
