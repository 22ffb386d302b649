"""BOP scenes: one scene per recipe group, one image per frame, poses and masks of the bodies that are seen.

```
<split>/000001/scene_camera.json   cam_K, depth_scale, cam_R_w2c, cam_t_w2c; uwsim_pinhole_rms_px, _max_px: how far off
                                   the projection with K is, 0 for a pinhole in the water
               scene_gt.json       obj_id, cam_R_m2c, cam_t_m2c; uwsim_body
               scene_gt_info.json  bbox_visib, px_count_visib, px_count_valid, and bbox_obj, px_count_all, visib_fract
               rgb/ depth/ mask_visib/ mask/
models/models_info.json            box and diameter of the surface that the frames see; uwsim_name, uwsim_kind
```

Millimetres; camera as in OpenCV, pixel centres at integers; boxes as the BOP toolkit counts them (width = last column -
first). Poses are those at mid-exposure. An object is a body of a group: the same name in another group is another one.
The dataset alone knows what is seen of a body; mask, bbox_obj, px_count_all and visib_fract are written only with
`silhouettes`, which returns {instance: mask (3 H, 3 W) bool} of a frame: each body as if it were alone, on a canvas
three times as wide and high with the picture in its middle.
Source: BOP toolkit, docs/bop_datasets_format.md, and its scripts calc_gt_info, calc_gt_masks.
"""

import json
import shutil
from pathlib import Path

import numpy as np

from uwsim.dataset.frame import Frame
from uwsim.dataset.store import Dataset
from uwsim.export.about import write_about
from uwsim.export.cameras import Pinhole, camera_points_m, camera_text, pinhole_of
from uwsim.export.models import Extents
from uwsim.export.pictures import depth_step_m, depth_steps, visible
from uwsim.files import write_text
from uwsim.images import write_png

SILHOUETTES = True
FINEST_M = 1e-4  # of depth: 0.1 mm reaches 6.5 m
_FOLDERS = ("rgb", "depth", "mask_visib")


def export(dataset: Dataset, folder: Path, *, splits: dict[str, str], progress, silhouettes=None) -> str:
    """Write scenes and models_info; see the module."""
    objects = _objects(dataset)
    groups = list(dict.fromkeys(group for group, _ in objects))
    extents = {key: Extents() for key in objects}
    tables: dict[Path, dict[str, dict]] = {}
    pinholes, instances = [], 0
    for done, name in enumerate(dataset.frame_names):
        progress(f"bop: {name}", done, len(dataset))
        frame = dataset.frame(name)
        scene = folder / splits[name] / f"{groups.index(frame.info.group) + 1:06d}"
        pinholes.append(pinhole_of([frame]))
        camera, poses, info = _write_frame(frame, scene, objects, pinholes[-1])
        if silhouettes is not None:
            _write_masks(frame, scene, info, silhouettes(frame))
        rows = tables.setdefault(scene, {"scene_camera": {}, "scene_gt": {}, "scene_gt_info": {}})
        for table, value in zip(rows.values(), (camera, poses, info), strict=True):
            table[frame.info.frame] = value
        instances += len(poses)
        _see(frame, extents)
    for scene, rows in tables.items():
        for table, entries in rows.items():
            write_text(scene / f"{table}.json", _lines(entries))
    _write_models(folder / "models", objects, extents)
    _about(dataset, folder, groups, pinholes, with_masks=silhouettes is not None)
    return f"{len(dataset)} images in {len(tables)} scenes, {instances} poses of {len(objects)} objects"


def _objects(dataset: Dataset) -> dict[tuple[str, str], tuple[int, str]]:
    """Return {(group, body): (obj_id from 1, kind)} in the order of the frames."""
    found: dict[tuple[str, str], tuple[int, str]] = {}
    for frame in dataset.frames:
        for body in frame.info.bodies:
            found.setdefault((frame.info.group, body.name), (len(found) + 1, body.kind))
    return found


def _write_frame(frame: Frame, scene: Path, objects: dict, pinhole: Pinhole) -> tuple[dict, list, list]:
    """Write the pictures of a frame and return its entries in the three tables."""
    for name in _FOLDERS:
        (scene / name).mkdir(parents=True, exist_ok=True)
    name, step_m = f"{frame.info.frame:06d}", depth_step_m(frame, FINEST_M)
    shutil.copyfile(frame.folder / "image.png", scene / "rgb" / f"{name}.png")
    write_png(scene / "depth" / f"{name}.png", depth_steps(frame, step_m))
    camera_from_world, poses, info = np.linalg.inv(frame.world_from_camera), [], []
    for number, (body, mask) in enumerate(visible(frame)):
        write_png(scene / "mask_visib" / f"{name}_{number:06d}.png", 255 * mask.astype(np.uint8))
        camera_from_body = camera_from_world @ np.array(body.world_from_body)
        identity = {"obj_id": objects[frame.info.group, body.name][0], "uwsim_body": body.name}
        poses.append(_pose(camera_from_body, "m2c") | identity)
        count = int(mask.sum())  # every pixel that sees a body has a depth
        info.append({"bbox_visib": _box(mask), "px_count_visib": count, "px_count_valid": count})
    camera = {"cam_K": pinhole.K.ravel().tolist(), "depth_scale": round(1e3 * step_m, 9)}
    camera |= _pose(camera_from_world, "w2c")
    return camera | {"uwsim_pinhole_rms_px": pinhole.rms_px, "uwsim_pinhole_max_px": pinhole.max_px}, poses, info


def _write_masks(frame: Frame, scene: Path, info: list[dict], silhouettes: dict[int, np.ndarray]) -> None:
    """Write mask/ and complete the entries of scene_gt_info; ValueError where a silhouette misses what is seen."""
    (scene / "mask").mkdir(exist_ok=True)
    height, width = frame.info.camera.height_px, frame.info.camera.width_px
    for number, ((body, seen), entry) in enumerate(zip(visible(frame), info, strict=True)):
        canvas = silhouettes[body.instance]
        inside = canvas[height : 2 * height, width : 2 * width]
        if np.any(seen & ~inside):
            raise ValueError(f"{frame.folder}: body {body.name!r} is seen outside its silhouette; were scenes changed?")
        write_png(scene / "mask" / f"{frame.info.frame:06d}_{number:06d}.png", 255 * inside.astype(np.uint8))
        left, top, wide, high = _box(canvas)
        count = int(canvas.sum())
        entry |= {
            "bbox_obj": [left - width, top - height, wide, high], "px_count_all": count,
            "px_count_valid": int(np.sum(inside & (frame.buffer("instance") > 0))),
            "visib_fract": entry["px_count_visib"] / count,
        }  # fmt: skip


def _pose(camera_from_source: np.ndarray, name: str) -> dict:
    return {
        f"cam_R_{name}": camera_from_source[:3, :3].ravel().tolist(),
        f"cam_t_{name}": (1e3 * camera_from_source[:3, 3]).tolist(),
    }


def _box(mask: np.ndarray) -> list[int]:
    """Return x, y, width, height as the BOP toolkit has them: differences of the first and the last pixel."""
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    return [int(value) for value in (columns[0], rows[0], columns[-1] - columns[0], rows[-1] - rows[0])]


def _lines(entries: dict | list) -> str:
    """Return JSON with a line per entry, as the toolkit writes it."""
    rows = [f'  "{key}": {json.dumps(value, allow_nan=False)}' for key, value in entries.items()]
    return "{\n" + ",\n".join(rows) + "\n}\n"


def _see(frame: Frame, extents: dict[tuple[str, str], Extents]) -> None:
    """Add what a frame sees of its bodies; not with a rolling shutter, whose rows see them from different places."""
    if frame.info.camera.readout_s > 0:
        return
    points_m = camera_points_m(frame)
    for body, mask in visible(frame):
        body_from_camera = np.linalg.inv(np.array(body.world_from_body)) @ frame.world_from_camera
        seen_m = points_m[mask] @ body_from_camera[:3, :3].T + body_from_camera[:3, 3]
        extents[frame.info.group, body.name].add(seen_m)


def _write_models(folder: Path, objects: dict, extents: dict[tuple[str, str], Extents]) -> None:
    folder.mkdir()
    entries = {
        number: extents[group, name].entry_mm() | {"uwsim_name": f"{group}/{name}", "uwsim_kind": kind}
        for (group, name), (number, kind) in objects.items()
        if not extents[group, name].is_empty
    }
    write_text(folder / "models_info.json", _lines(entries))


def _about(dataset: Dataset, folder: Path, groups: list[str], pinholes: list[Pinhole], *, with_masks: bool) -> None:
    masks = (
        "`mask`, `bbox_obj`, `px_count_all` and `visib_fract` are of the body alone, also where it leaves the picture."
        if with_masks
        else "`mask`, `bbox_obj`, `px_count_all` and `visib_fract` are missing: the dataset knows what is seen, not "
        "what is hidden (`uwsim export --silhouettes` casts the rays that it takes)."
    )
    paragraphs = [
        camera_text(pinholes),
        "Poses are those at mid-exposure, in millimetres. `mask_visib` belongs to the rays through pixel centres. "
        f"{masks}",
        "`models/models_info.json` has the box and the diameter of what the frames see of each object, in the frame "
        "of the body: less than the whole object where no frame sees all of it. There are no meshes.",
        "Scenes: " + ", ".join(f"{number:06d} {group}" for number, group in enumerate(groups, start=1)) + ".",
    ]
    write_about(folder, dataset, title="BOP scenes", paragraphs=paragraphs)
