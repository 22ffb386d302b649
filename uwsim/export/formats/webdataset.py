"""WebDataset shards: tar files whose bytes depend on the dataset alone.

```
<split>-000000.tar    per frame: 000000.image.png, 000000.water_free.png, 000000.frame.json, 000000.truth.npz
                      and 000000.raw16.png where the frame has it
```

`image.png`, `frame.json`, `raw16.png` are the files of the frame, byte for byte; `truth.npz` holds every truth image of
its frame.exr by its name, with its values and sample type; `water_free.png` is the twin through the frame's camera
without noise. A shard ends before it grows beyond 1 GB.
Source: WebDataset: files of a sample lie side by side and share the name up to the first dot.
"""

import io
import tarfile
import zipfile
from pathlib import Path

import numpy as np

from uwsim.dataset.frame import BUFFERS, RAW, Frame
from uwsim.dataset.store import Dataset
from uwsim.export.about import write_about
from uwsim.export.pictures import twin

MOST_BYTES = 1_000_000_000
_TYPES = {"half": np.float16, "float": np.float32, "uint": np.uint32}


def export(dataset: Dataset, folder: Path, *, splits: dict[str, str], progress) -> str:
    """Write the shards; see the module."""
    done, shards = 0, 0
    for split in sorted(set(splits.values())):
        with _Shards(folder, split) as shard:
            for name in (name for name in dataset.frame_names if splits[name] == split):
                progress(f"webdataset: {name}", done, len(dataset))
                shard.add(name, sample(dataset.frame(name)))
                done += 1
        shards += shard.count
    paragraphs = [
        "One sample per frame: `image.png` (8-bit sRGB), `water_free.png` (the same view without water and noise), "
        "`frame.json` and `truth.npz` (every truth image by its name; metres, linear radiance).",
    ]
    write_about(folder, dataset, title="WebDataset shards", paragraphs=paragraphs)
    return f"{done} samples in {shards} shards"


def sample(frame: Frame) -> dict[str, bytes]:
    """Return {name after the first dot: content} of one frame."""
    files = {file: (frame.folder / file).read_bytes() for file in ("image.png", "frame.json")}
    if frame.info.sensor.raw:
        files[RAW] = (frame.folder / RAW).read_bytes()
    content = files | {"truth.npz": _truth(frame), "water_free.png": _png(twin(frame))}
    return dict(sorted(content.items()))


def _truth(frame: Frame) -> bytes:
    """Return the truth images as an .npz archive; its entries have no date, so that bytes follow from values."""
    archive = io.BytesIO()
    with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as entries:
        for name in (name for name in BUFFERS if name in frame.buffer_names):
            with entries.open(zipfile.ZipInfo(f"{name}.npy"), "w") as stream:
                np.lib.format.write_array(stream, frame.buffer(name).astype(_TYPES[BUFFERS[name][1]]))
    return archive.getvalue()


def _png(image: np.ndarray) -> bytes:
    import cv2

    return cv2.imencode(".png", image[..., ::-1])[1].tobytes()


class _Shards:
    """Tar files of one split; each ends before it grows beyond MOST_BYTES."""

    def __init__(self, folder: Path, split: str):
        self.folder, self.split, self.count, self.tar, self.size = folder, split, 0, None, 0

    def __enter__(self):
        return self

    def __exit__(self, *error):
        if self.tar is not None:
            self.tar.close()

    def add(self, name: str, files: dict[str, bytes]) -> None:
        wanted = sum(len(content) for content in files.values())
        if self.tar is None or self.size + wanted > MOST_BYTES:
            self._next()
        for extension, content in files.items():
            # owner, date and mode are those of no machine and no hour
            entry = tarfile.TarInfo(f"{name}.{extension}")
            entry.size, entry.mode, entry.mtime = len(content), 0o644, 0
            self.tar.addfile(entry, io.BytesIO(content))
        self.size += wanted

    def _next(self) -> None:
        self.__exit__()
        path = self.folder / f"{self.split}-{self.count:06d}.tar"
        self.tar, self.size = tarfile.TarFile(path, "w", format=tarfile.USTAR_FORMAT), 0
        self.count += 1
