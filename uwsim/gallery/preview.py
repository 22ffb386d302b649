"""The preview of one frame: pictures, drawings and facts in a folder of its own, complete or absent."""

import hashlib
import json
import shutil
from functools import cache
from pathlib import Path

import numpy as np

from uwsim.dataset.frame import Frame, check_buffers, read_frame
from uwsim.files import read_json, write_json
from uwsim.gallery import drawings, layers
from uwsim.gallery.facts import entry_of, facts_of
from uwsim.images import srgb_uint8_from_linear

LONGEST_SIDE_PX = 1280
THUMBNAIL_PX = 240
ENTRY = "entry.json"
_QUALITY = 88
_WITHOUT_LOSS_QUALITY = 101  # above 100: WebP without loss
_SMALL = 320 * 240


def keys_of(files: dict[str, str]) -> dict[str, str]:
    """Return what each preview depends on, {frame: 64 hexadecimal digits}: its checksums and the code that draws it.

    files: {path: SHA-256}, as in dataset.json.
    """
    mine: dict[str, list] = {}
    for file, checksum in sorted(files.items()):
        kind, name, _ = Path(file).parts
        if kind == "frames":
            mine.setdefault(name, [_code()]).append((file, checksum))
    return {name: hashlib.sha256(json.dumps(one).encode()).hexdigest() for name, one in mine.items()}


@cache
def _code() -> str:
    here = Path(__file__).parent
    files = [*sorted(here.glob("*.py")), here.parent / "look.py", here.parent / "images.py"]
    return hashlib.sha256(b"".join(path.read_bytes() for path in files)).hexdigest()


def kept_entry(folder: Path, key: str) -> dict | None:
    """Return the index entry of a preview that is there and up to date, else None."""
    path = Path(folder) / ENTRY
    if not path.is_file():
        return None
    found = read_json(path)
    return found["entry"] if found["key"] == key else None


def write_preview(frame_folder: Path, folder: Path, key: str) -> dict:
    """Write the preview of the frame in `frame_folder` to `folder`, in place of an older one; return its index entry.

    Raises ValueError in one line if the frame is broken.
    """
    frame = read_frame(Path(frame_folder))
    _check(frame)
    folder = Path(folder)
    partial = folder.with_name(folder.name + ".partial")
    shutil.rmtree(partial, ignore_errors=True)
    partial.mkdir()
    shown = []
    for layer in layers.layers_of(frame):
        _write_webp(partial / f"{layer.key}.webp", _fitting(layer.picture, LONGEST_SIDE_PX, layer.exact), layer.exact)
        words = {"key": layer.key, "title": layer.title, "group": layer.group, "caption": layer.caption}
        shown.append(words | {"gain": layer.gain, **layer.scale})
    water_free = srgb_uint8_from_linear(layers.linear_picture(frame, "water_free"))
    for name, picture in (("thumb", frame.image), ("thumb_water_free", water_free)):
        _write_webp(partial / f"{name}.webp", _fitting(picture, THUMBNAIL_PX, False), False)
    entry = entry_of(frame)
    content = {
        "name": frame.folder.name, "width": entry["width"], "height": entry["height"], "layers": shown,
        "facts": facts_of(frame), "blur": frame.info.blur and frame.info.blur.model_dump(),
    } | drawings.drawings_of(frame) | {"json": read_json(frame.folder / "frame.json")}  # fmt: skip
    (partial / "frame.js").write_text(script("gallery.receive", content), encoding="utf-8")
    write_json(partial / ENTRY, {"key": key, "entry": entry})
    if folder.exists():
        shutil.rmtree(folder)
    partial.rename(folder)
    return entry


def script(function: str, value: object) -> str:
    """Return JSON as a call of a function: a page that lies on disk may load scripts, but not JSON files.

    Raises ValueError on NaN and infinity.
    """
    return f"{function}({json.dumps(value, allow_nan=False, separators=(',', ':'))});\n"


def _check(frame: Frame) -> None:
    """Raise ValueError unless the frame's pictures fit its description."""
    camera, where = frame.info.camera, str(frame.folder)
    if frame.info.name != frame.folder.name:
        raise ValueError(f"{where}: frame.json calls itself {frame.info.name!r}")
    size = (camera.height_px, camera.width_px)
    if frame.image.shape[:2] != size:
        raise ValueError(f"{where}: image.png is {frame.image.shape[:2]}, allowed: {size} as in frame.json")
    buffers = {name: frame.buffer(name) for name in frame.buffer_names}
    check_buffers(buffers, height=size[0], width=size[1], where=where)
    known = {body.instance for body in frame.info.bodies}
    if unknown := set(np.unique(buffers["instance"]).tolist()) - known - {0}:
        raise ValueError(f"{where}: instance {sorted(unknown)} is not among the bodies of frame.json")


def _fitting(picture: np.ndarray, longest_px: int, exact: bool) -> np.ndarray:
    """Return a picture no larger than `longest_px`; where colours stand for numbers, by its nearest pixels."""
    import cv2

    factor = longest_px / max(picture.shape[:2])
    if factor >= 1:
        return picture
    height, width = (max(1, round(size * factor)) for size in picture.shape[:2])
    how = cv2.INTER_NEAREST if exact else cv2.INTER_AREA
    return cv2.resize(picture, (width, height), interpolation=how)


def _write_webp(path: Path, picture: np.ndarray, exact: bool) -> None:
    """Write a picture as WebP; small ones without loss, for they are shown enlarged."""
    import cv2

    lossless = exact or (picture.shape[0] * picture.shape[1] <= _SMALL and not path.stem.startswith("thumb"))
    quality = _WITHOUT_LOSS_QUALITY if lossless else _QUALITY
    ok, data = cv2.imencode(".webp", np.ascontiguousarray(picture[..., ::-1]), [cv2.IMWRITE_WEBP_QUALITY, quality])
    if not ok:
        raise ValueError(f"WebP {path}: could not be encoded, shape {picture.shape}")
    path.write_bytes(data.tobytes())
