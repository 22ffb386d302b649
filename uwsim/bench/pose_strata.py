"""What each case of the benchmark of poses was like, and tables of scores by such strata."""

from collections.abc import Callable

import numpy as np

from uwsim.bench.blur.strata import by_group
from uwsim.bench.kept import Scores
from uwsim.bench.markers import camera_from_body
from uwsim.bench.task import frame_of_case
from uwsim.dataset.frame import Frame
from uwsim.dataset.store import Dataset

SHOWN = {
    "detected_percent": "cases with a pose [%]", "rotation_error_deg": "rotation error [deg], median",
    "translation_error_percent": "translation error [%], median",
}  # fmt: skip


def conditions(dataset: Dataset, cases: list[str]) -> dict[str, dict]:
    """Return what each case was like: group, kind of marks, water, place [mm], tilt [deg], port, blur [px].

    Blur: of the body, which is not that of what lies behind it. Place: of the body's origin in the camera's frame,
    along the axis and from it. Tilt: between the body's z and the direction against the camera's.
    """
    return {name: _conditions(dataset, name) for name in cases}


def _conditions(dataset: Dataset, name: str) -> dict:
    frame = dataset.frame(frame_of_case(name))
    info = frame.info
    shown = {point.body for point in info.points if point.kind == "sphere"} | {marker.body for marker in info.markers}
    body = name.partition("/")[2] or next(iter(sorted(shown)))
    spheres = [point for point in info.points if point.body == body and point.kind == "sphere"]
    pose = camera_from_body(frame, body)
    port = info.camera.port
    return {
        "group": info.group, "marks": f"{len(spheres)} spheres" if spheres else "markers", "water": info.water.name,
        "distance_mm": round(1e3 * float(pose[2, 3])), "off_axis_mm": round(1e3 * float(np.hypot(*pose[:2, 3]))),
        "tilt_deg": round(float(np.degrees(np.arccos(np.clip(-pose[2, 2], -1, 1)))), 1),
        "port": "none" if port is None else _port_text(port),
        "blur_px": 0.0 if info.blur is None else round(_blur_px(frame, body), 1),
    }  # fmt: skip


def _blur_px(frame: Frame, body: str) -> float:
    """Return the median length of the motion of what is seen of a body during the exposure; NaN where nothing is."""
    instance = next(one.instance for one in frame.info.bodies if one.name == body)
    seen = frame.buffer("instance").squeeze() == instance
    moved = (frame.buffer("flow_end") - frame.buffer("flow_start"))[seen]
    return float(np.median(np.linalg.norm(moved.astype(float), axis=-1))) if len(moved) else np.nan


def _port_text(port) -> str:
    if port.kind != "flat":
        return port.kind
    return f"flat, {1e3 * port.gap_m:g} + {1e3 * port.thickness_m:g} mm"


def strata(found: dict[str, dict]) -> dict[str, list[str]]:
    """Return {stratum: cases} of conditions: by group, water, distance, distance from the axis, port and blur."""
    ways: dict[str, Callable[[dict], object]] = {
        "group": lambda one: one["group"],
        "water": lambda one: one["water"],
        "distance [mm]": lambda one: one["distance_mm"],
        "from the axis [mm]": lambda one: one["off_axis_mm"],
        "port": lambda one: one["port"],
        "blur [px]": lambda one: one["blur_px"],
    }
    groups: dict[str, list[str]] = {}
    for way, of in ways.items():
        values = {name: of(one) for name, one in found.items()}
        several = list(dict.fromkeys(values.values()))
        if len(several) < 2:
            continue
        for value in sorted(several) if way[-1] == "]" else several:
            groups[f"{way}: {value}"] = [name for name, other in values.items() if other == value]
    return groups


def findings(dataset: Dataset, scores: dict[str, Scores]) -> dict[str, dict]:
    """Return a table of each of SHOWN by stratum, where the cases differ: how many, and each solver's summary."""
    groups = strata(conditions(dataset, list(scores)))
    if not groups:
        return {}
    return {f"{metric}_by_stratum": by_group(groups, scores, metric, words) for metric, words in SHOWN.items()}
