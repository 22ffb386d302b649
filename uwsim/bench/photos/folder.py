"""What a folder of photographs and videos holds; everything is opened once before anything is scored."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from uwsim.bench.photos.layout import Layout, layout_of, read_layout, shipped_layouts
from uwsim.files import no_stderr
from uwsim.images import read_srgb

PICTURES, VIDEOS = (".jpg", ".jpeg", ".png"), (".mp4", ".avi")
_REFERENCE = "_ref"


@dataclass(frozen=True)
class Photograph:
    """A picture file and the file of its pseudo-reference, if there is one; `name` is its path in the folder."""

    name: str
    path: Path
    reference: Path | None


@dataclass(frozen=True)
class Video:
    """A video file, the layout that it shows, if any, and its number of frames: that can be read, and as stated."""

    name: str
    path: Path
    layout: str | None
    frames: int
    stated_frames: int


@dataclass(frozen=True)
class Content:
    """What is scored; `layouts` by name; `left_out`: videos that no layout describes."""

    photographs: tuple[Photograph, ...]
    videos: tuple[Video, ...]
    layouts: dict[str, Layout]
    layout_files: dict[str, Path]
    left_out: tuple[str, ...]


def read_folder(folder: Path) -> Content:
    """Return what a folder and the folders in it hold; hidden files are not looked at.

    Pictures are jpg and png files; NAME_ref.* is the pseudo-reference of NAME.*. Videos are mp4 and avi files; a TOML
    file in the folder is a layout, and goes before those that come with uwsim.
    Raises ValueError in one line: no such folder, nothing to score, a picture, video or layout that cannot be read, a
    pseudo-reference of another size or of no picture.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise ValueError(f"--photos {folder}: no such folder")
    files = [path for path in sorted(folder.rglob("*")) if path.is_file() and not _hidden(path.relative_to(folder))]
    photographs = _photographs(folder, [path for path in files if path.suffix.lower() in PICTURES])
    own = {path.stem: path for path in files if path.suffix.lower() == ".toml"}
    layouts = {name: read_layout(path) for name, path in own.items()}
    others = {path.stem: path for path in shipped_layouts() if path.stem not in own}
    layouts |= (other := {name: read_layout(path) for name, path in others.items()})
    named = [path for path in files if path.suffix.lower() in VIDEOS]
    mine = {name: layouts[name] for name in own}
    opened = [_video(folder, path, layout_of(path, mine, other)) for path in named]
    videos = tuple(video for video in opened if video.layout is not None)
    if not photographs and not videos:
        allowed = f"at least one picture ({', '.join(PICTURES)}) or video ({', '.join(VIDEOS)}) that a layout describes"
        raise ValueError(f"--photos {folder}: nothing to score, allowed: {allowed}")
    used = dict.fromkeys(video.layout for video in videos)
    return Content(
        photographs=photographs, videos=videos, layouts={name: layouts[name] for name in used},
        layout_files={name: (own | others)[name] for name in used},
        left_out=tuple(video.name for video in opened if video.layout is None),
    )  # fmt: skip


def frames_of(video: Video, every: int) -> Iterator[tuple[int, np.ndarray]]:
    """Yield (number, frame (H, W, 3) uint8 R, G, B) of every n-th frame, the first one first."""
    import cv2

    with no_stderr():
        capture = cv2.VideoCapture(str(video.path))
    try:
        for number in range(video.frames):
            if not capture.grab():
                raise ValueError(f"{video.path}: frame {number} could not be read again")
            if number % every == 0:
                yield number, np.ascontiguousarray(capture.retrieve()[1][..., ::-1])
    finally:
        capture.release()


def _hidden(path: Path) -> bool:
    return any(part.startswith(".") for part in path.parts)


def _name(folder: Path, path: Path) -> str:
    return path.relative_to(folder).as_posix()


def _photographs(folder: Path, files: list[Path]) -> tuple[Photograph, ...]:
    references: dict[Path, Path] = {}
    pictures = [path for path in files if not path.stem.endswith(_REFERENCE)]
    for path in files:
        if path in pictures:
            continue
        of = path.with_name(path.stem.removesuffix(_REFERENCE))
        if of in references:
            raise ValueError(f"{path}: {references[of].name} is a pseudo-reference of the same picture, allowed: one")
        if of not in {picture.with_suffix("") for picture in pictures}:
            raise ValueError(f"{path}: pseudo-reference of no picture, allowed: beside a picture {of.name}.*")
        references[of] = path
    found = [Photograph(_name(folder, path), path, references.get(path.with_suffix(""))) for path in pictures]
    for photograph in found:
        _check(photograph)
    return tuple(found)


def _check(photograph: Photograph) -> None:
    shape = read_srgb(photograph.path).shape
    if min(shape[:2]) < 10:
        raise ValueError(f"{photograph.path}: got {shape[1]} x {shape[0]} px, allowed: at least 10 px on each side")
    if photograph.reference is not None and (other := read_srgb(photograph.reference).shape) != shape:
        size, wanted = (f"{one[1]} x {one[0]} px" for one in (other, shape))
        raise ValueError(f"{photograph.reference}: got {size}, allowed: {wanted} as {photograph.path.name}")


def _video(folder: Path, path: Path, layout: str | None) -> Video:
    import cv2

    with no_stderr():
        capture, count = cv2.VideoCapture(str(path)), 0
        stated = round(capture.get(cv2.CAP_PROP_FRAME_COUNT)) if capture.isOpened() else 0
        while capture.grab():
            count += 1
        capture.release()
    if count == 0:
        raise ValueError(f"{path}: not a video that can be read")
    return Video(_name(folder, path), path, layout, count, stated)
