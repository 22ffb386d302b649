"""Export a dataset: choose the format by its name, write beside the target, rename when complete."""

import shutil
from collections.abc import Callable
from pathlib import Path

from uwsim import discovery
from uwsim.dataset import store
from uwsim.export import formats
from uwsim.export.splits import frame_splits

Progress = Callable[[str, int, int], None]


def export(
    folder: Path, out: Path, *, format: str, shares: dict[str, float] | None, progress: Progress, silhouettes=None
) -> str:
    """Write the dataset in `folder` to the new folder `out` and return one line on what is there.

    format: name of a file in `uwsim/export/formats`, or the path of a .py file. shares: {split: share of the scenes},
    None: as the dataset states, see `splits.frame_splits`. silhouettes: makes of the dataset what
    `formats.bop` takes, and that alone. `out` is complete or absent.
    Raises ValueError in one line.
    """
    module = discovery.find(formats, format)
    dataset, out = store.open(folder), Path(out)
    if out.exists():
        raise ValueError(f"--out {out}: exists already, allowed: a new folder")
    if not out.resolve().parent.is_dir():
        raise ValueError(f"--out {out}: the folder {out.parent} does not exist")
    if out.resolve().is_relative_to(dataset.folder.resolve()):
        raise ValueError(f"--out {out}: lies inside the dataset {folder}, allowed: a folder outside")
    if shares is not None and not getattr(module, "SPLITS", True):
        raise ValueError(f"--split: got shares for {format}, which has no splits; allowed: none")
    if silhouettes is not None and not getattr(module, "SILHOUETTES", False):
        raise ValueError(f"--silhouettes: got format {format}, which has none; allowed: with bop")
    options = {} if silhouettes is None else {"silhouettes": silhouettes(dataset)}
    splits = frame_splits(dataset, shares)
    partial = out.with_name(out.name + ".partial")
    shutil.rmtree(partial, ignore_errors=True)
    partial.mkdir()
    try:
        summary = module.export(dataset, partial, splits=splits, progress=progress, **options)
        partial.rename(out)
    finally:
        shutil.rmtree(partial, ignore_errors=True)
    return summary
