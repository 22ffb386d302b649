"""COCO instances: masks of the visible parts of the bodies, categories by kind of body.

```
<split>/000000.png
annotations/instances_<split>.json
```

Source: "Data format, object detection", cocodataset.org; masks as uncompressed run lengths, column by column, the
first run background. Boxes are x, y, width, height of the pixels' areas (one pixel has width 1).
"""

import json
import shutil
from pathlib import Path

import numpy as np

from uwsim.dataset.frame import Frame
from uwsim.dataset.store import Dataset
from uwsim.export.about import write_about
from uwsim.export.pictures import visible
from uwsim.files import write_text


def export(dataset: Dataset, folder: Path, *, splits: dict[str, str], progress) -> str:
    """Write pictures and annotations; see the module."""
    kinds = sorted({body.kind for frame in dataset.frames for body in frame.info.bodies})
    category = {kind: number for number, kind in enumerate(kinds, start=1)}
    (folder / "annotations").mkdir()
    images, instances = 0, 0
    for split in sorted(set(splits.values())):
        (folder / split).mkdir()
        content = {
            "info": {"description": f"{dataset.name}, {split}", "version": "1.0"},
            "licenses": [],
            "categories": [{"id": number, "name": kind, "supercategory": "body"} for kind, number in category.items()],
            "images": [],
            "annotations": [],
        }
        for name in (name for name in dataset.frame_names if splits[name] == split):
            frame = dataset.frame(name)
            progress(f"coco: {name}", images, len(dataset))
            shutil.copyfile(frame.folder / "image.png", folder / split / f"{name}.png")
            content["images"].append(_image(frame))
            for body, mask in visible(frame):
                instances += 1
                content["annotations"].append(_annotation(instances, frame, body, mask, category[body.kind]))
            images += 1
        write_text(folder / "annotations" / f"instances_{split}.json", json.dumps(content, allow_nan=False) + "\n")
    paragraphs = [
        "Masks are those of the visible part of each body, as uncompressed run lengths (`pycocotools` reads them); "
        "categories are kinds of bodies, `body` of an annotation is its name in the scene. Particles have no masks.",
    ]
    write_about(folder, dataset, title="COCO instances", paragraphs=paragraphs)
    return f"{images} images, {instances} instances of {len(kinds)} categories"


def run_lengths(mask: np.ndarray) -> list[int]:
    """Return lengths of runs of a mask (H, W) down its columns, 0 and 1 in turn from 0 (the first may be 0 long)."""
    values = np.asarray(mask, bool).ravel(order="F")
    changes = np.flatnonzero(np.diff(values)) + 1
    edges = np.concatenate([[0], changes, [values.size]])
    lengths = np.diff(edges).tolist()
    return [0, *lengths] if values[0] else lengths


def _image(frame: Frame) -> dict:
    info = frame.info
    size = {"width": info.camera.width_px, "height": info.camera.height_px}
    return {"id": info.frame, "file_name": f"{info.name}.png", **size, "scene": info.scene, "group": info.group}


def _annotation(number: int, frame: Frame, body, mask: np.ndarray, category: int) -> dict:
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    left, top = int(columns[0]), int(rows[0])
    return {
        "id": number, "image_id": frame.info.frame, "category_id": category, "iscrowd": 0, "area": int(mask.sum()),
        "bbox": [left, top, int(columns[-1]) - left + 1, int(rows[-1]) - top + 1],
        "segmentation": {"size": list(mask.shape), "counts": run_lengths(mask)}, "body": body.name,
    }  # fmt: skip
