"""Paired folders in the habit of UIEB and EUVP: the picture in the water and its water-free twin, by the same name.

```
<split>/raw-<n>/000000.png          what the camera stores
<split>/reference-<n>/000000.png    the twin without water, through the same camera and exposure, without sensor noise
<split>/pairs.csv                   name, scene, group, attenuation of the bands, whether the frame is in motion
```

Source: folder names of UIEB (Li et al. 2020, raw-890, reference-890); `<n>` is the number of pairs.
"""

import csv
import io
import shutil
from pathlib import Path

from uwsim.dataset.frame import Frame
from uwsim.dataset.store import Dataset
from uwsim.export.about import write_about
from uwsim.export.pictures import twin
from uwsim.files import write_text
from uwsim.images import write_png

COLUMNS = (
    "name", "scene", "group", "attenuation_r_per_m", "attenuation_g_per_m", "attenuation_b_per_m", "in_motion"
)  # fmt: skip


def export(dataset: Dataset, folder: Path, *, splits: dict[str, str], progress) -> str:
    """Write the pairs; see the module."""
    done = 0
    for split in sorted(set(splits.values())):
        names = [name for name in dataset.frame_names if splits[name] == split]
        raw, reference = (folder / split / f"{what}-{len(names)}" for what in ("raw", "reference"))
        for path in (raw, reference):
            path.mkdir(parents=True)
        rows = []
        for name in names:
            frame = dataset.frame(name)
            progress(f"pairs: {name}", done, len(dataset))
            shutil.copyfile(frame.folder / "image.png", raw / f"{name}.png")
            write_png(reference / f"{name}.png", twin(frame))
            rows.append(_row(frame))
            done += 1
        write_text(folder / split / "pairs.csv", _table(rows))
    paragraphs = [
        "`raw-*` is what the camera stores; `reference-*` is the same view without water: same rays, lamps, exposure, "
        "gain and motion, without sensor noise. Both are 8-bit sRGB.",
        "In `pairs.csv`, `in_motion` marks pairs that are both blurred by motion.",
    ]
    write_about(folder, dataset, title="pairs of pictures in water and without", paragraphs=paragraphs)
    return f"{done} pairs"


def _row(frame: Frame) -> list:
    info = frame.info
    attenuation = (f"{value:.6g}" for value in info.water.bands.attenuation_per_m)
    return [info.name, info.scene, info.group, *attenuation, int(info.blur is not None)]


def _table(rows: list[list]) -> str:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows([COLUMNS, *rows])
    return text.getvalue()
