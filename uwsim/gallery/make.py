"""Write the gallery of a dataset: previews one after the other or in several processes, then index and page."""

import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from uwsim import look, workers
from uwsim.dataset import store
from uwsim.files import read_json, write_json, write_text
from uwsim.gallery import preview
from uwsim.gallery.facts import turbidity_classes
from uwsim.gallery.markup import page

MARK = "gallery.json"
_PAGE = Path(__file__).with_name("page")
_SCRIPTS = ("draw.js", "frame.js", "sheet.js")
_LEFT_BEHIND = ".partial-"


@dataclass(frozen=True)
class Written:
    """The page to open, the number of frames, and of how many of them the preview was made now."""

    page: Path
    frames: int
    made: int


def write(
    folder: Path, out: Path | None = None, *, processes: int = 1, progress: Callable[[int, int], None] | None = None
) -> Written:
    """Write the gallery of the dataset in `folder` into `out` (default: `folder`/gallery), or bring it up to date.

    Previews that are there are kept, so that a killed run goes on where it was; the page is written last. Memory is
    that of one frame per process. Raises ValueError in one line if the dataset is broken, if `out` holds anything but a
    gallery of this dataset, or if processes < 1.
    """
    if processes < 1:
        raise ValueError(f"--workers: got {processes}, allowed: 1 or more")
    dataset = store.open(Path(folder))
    _check_files(dataset)
    out = dataset.folder / "gallery" if out is None else Path(out)
    _check_out(out, dataset)
    out.mkdir(exist_ok=True)
    write_json(out / MARK, {"format": 1, "dataset": dataset.name})
    _remove_leftovers(out, dataset)
    entries, made = _previews(dataset, out / "frames", processes, progress or (lambda done, total: None))
    _write_page(out, dataset, [entries[name] for name in dataset.frame_names])
    return Written(page=out / "index.html", frames=len(dataset), made=made)


def _check_files(dataset: store.Dataset) -> None:
    """Raise ValueError for the first file that is missing, before anything is written."""
    for file in dataset.manifest["files"]:
        if not (dataset.folder / file).is_file():
            raise ValueError(f"{dataset.folder}: file {file} is missing")


def _check_out(out: Path, dataset: store.Dataset) -> None:
    if not out.resolve().parent.is_dir():
        raise ValueError(f"--out {out}: the folder {out.parent} does not exist")
    if out.exists() and not out.is_dir():
        raise ValueError(f"--out {out}: is a file, allowed: a folder")
    if (dataset.folder / "frames").resolve() in (out.resolve(), *out.resolve().parents):
        raise ValueError(f"--out {out}: lies among the frames of the dataset, allowed: a folder elsewhere")
    if not out.exists() or all(path.name.startswith(_LEFT_BEHIND) for path in out.iterdir()):
        return
    if not (out / MARK).is_file():
        raise ValueError(f"--out {out}: holds something else, allowed: a new or empty folder, or a gallery")
    found = read_json(out / MARK)
    if not isinstance(found, dict) or found.get("dataset") != dataset.name:
        name = found.get("dataset") if isinstance(found, dict) else None
        raise ValueError(f"--out {out}: the gallery of dataset {name!r}, allowed: one of {dataset.name!r}")


def _remove_leftovers(out: Path, dataset: store.Dataset) -> None:
    """Delete what a killed run left half-written, and previews of frames that the dataset no longer has."""
    for file in out.glob(f"{_LEFT_BEHIND}*"):
        file.unlink()
    (out / "frames").mkdir(exist_ok=True)
    names = set(dataset.frame_names)
    for folder in (out / "frames").iterdir():
        if folder.name not in names:
            shutil.rmtree(folder)


def _previews(
    dataset: store.Dataset, frames: Path, processes: int, progress: Callable[[int, int], None]
) -> tuple[dict[str, dict], int]:
    """Return {frame: index entry} and the number of previews made."""
    keys = preview.keys_of(dataset.manifest["files"])
    entries = {name: preview.kept_entry(frames / name, keys[name]) for name in dataset.frame_names}
    missing = [name for name, entry in entries.items() if entry is None]
    tasks = [(dataset.folder / "frames" / name, frames / name, keys[name]) for name in missing]
    done = len(entries) - len(missing)
    progress(done, len(entries))
    for name, entry in _results(tasks, processes):
        entries[name] = entry
        done += 1
        progress(done, len(entries))
    return entries, len(missing)


def _results(tasks: list[tuple[Path, Path, str]], processes: int) -> Iterator[tuple[str, dict]]:
    """Yield (frame, index entry) as the previews are done."""
    if processes == 1 or len(tasks) < 2:
        for task in tasks:
            yield task[1].name, preview.write_preview(*task)
        return
    for number, entry in workers.results(preview.write_preview, tasks, processes=processes, option="--workers"):
        yield tasks[number][1].name, entry


def _write_page(out: Path, dataset: store.Dataset, entries: list[dict]) -> None:
    names, classes = turbidity_classes([entry["attenuation"] for entry in entries])
    index = {
        "name": dataset.name,
        "facts": _facts(dataset, entries),
        "turbidities": names,
        "frames": [entry | {"turbidity": one} for entry, one in zip(entries, classes, strict=True)],
    }
    (out / "page").mkdir(exist_ok=True)
    for file in _SCRIPTS:
        write_text(out / "page" / file, (_PAGE / file).read_text(encoding="utf-8"))
    write_text(out / "page" / "style.css", _style())
    write_text(out / "index.js", preview.script("gallery.start", index))
    write_text(out / "index.html", page(dataset.name))


def _style() -> str:
    own = (_PAGE / "gallery.css").read_text(encoding="utf-8")
    ramp = ", ".join(f"rgb({r} {g} {b})" for r, g, b in look.colour_map(np.linspace(0, 1, 9)).tolist())
    return look.style() + own.replace("RAMP", ramp)


def _facts(dataset: store.Dataset, entries: list[dict]) -> list[list[str]]:
    """Return the dataset in a few pairs of words and numbers."""
    sizes = sorted({f"{entry['width']} × {entry['height']} px" for entry in entries})
    stated = [entry["noise"] for entry in entries if entry["noise"] is not None]
    attenuations = [entry["attenuation"] for entry in entries]
    low, high = min(attenuations), max(attenuations)
    return [
        ["frames", f"{len(entries)} ({sum(entry['moves'] for entry in entries)} in motion)"],
        ["size", ", ".join(sizes)],
        ["attenuation, green", f"{low:.3g} /m" if low == high else f"{low:.3g} to {high:.3g} /m"],
        ["Monte-Carlo noise", f"low enough in {sum(stated)} of {len(stated)}" if stated else "not stated"],
        ["seed", str(dataset.manifest["seed"])],
    ]
