"""Keep the disk from running full: what frames take at most, before they are made and while they are."""

import shutil
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from uwsim.dataset.frame import BUFFERS, MOTION, ORDERS
from uwsim.dataset.task import Task

_SAMPLE_BYTES = {"float": 4, "uint": 4, "half": 2}
_PICTURE_BYTES_PER_PIXEL = 3 + 6  # image.png and raw16.png, as if they could not be compressed
_DESCRIPTION_BYTES = 200_000  # frame.json: one with hundreds of marker points
_SPARE_BYTES = 200_000_000


def frame_bytes(task: Task) -> int:
    """Return what a frame takes on the disk at most [byte]: pictures of noise hardly compress."""
    scene = task.scene
    absent = (() if task.options.orders else ORDERS) + (() if scene.moves else MOTION)
    held = (kind for name, kind in BUFFERS.items() if name not in absent)
    per_pixel = sum(channels * _SAMPLE_BYTES[sample] for channels, sample in held) + _PICTURE_BYTES_PER_PIXEL
    return scene.rig.camera.width_px * scene.rig.camera.height_px * per_pixel + _DESCRIPTION_BYTES


def require_room(out: Path, tasks: Sequence[Task]) -> None:
    """Raise ValueError with the estimate unless these frames fit on the disk of `out`, with some room to spare."""
    needed, free = int(np.sum([frame_bytes(task) for task in tasks])) + _SPARE_BYTES, shutil.disk_usage(out).free
    if needed > free:
        raise ValueError(
            f"--out {out}: {len(tasks)} frames need up to {needed / 1e9:.1f} GB, allowed: the {free / 1e9:.1f} GB "
            "that are free there"
        )


def require_spare(out: Path, *, frames: int, bytes_each: int) -> None:
    """Raise ValueError when the disk of `out` has no room for the frames in the making and some to spare."""
    free = shutil.disk_usage(out).free
    if free < frames * bytes_each + _SPARE_BYTES:
        raise ValueError(
            f"--out {out}: stopped with {free / 1e9:.1f} GB free on the disk; make room, and go on with --resume"
        )
