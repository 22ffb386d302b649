"""Milliseconds of every restoration method at 640x480, beside OpenCV's CLAHE, in one run on one thread.

    python benchmarks/speed/restoration.py [--quick] [--only METHOD ...] [--dataset DIR] [--json -]

CLAHE is `uwsim/restoration/algorithms/clahe.py`: OpenCV's, on the L of a colour picture, both conversions included.
The picture is the first still frame of that size in a dataset, else of `tank_usaf` rendered with few samples into a
temporary one: methods that need ranges, lamps or true layers get them from it, made before the clock starts. Times are
CPU milliseconds of the process, which a busy machine changes little, medians of rounds that alternate between all
methods; `times_clahe` is the median of the ratios within a round. `wall_milliseconds` are those on the wall.
"""

import argparse
import sys
import tempfile
from pathlib import Path

import command
import document
import side_by_side

FULL, QUICK = (640, 480), (160, 120)
RECIPE = """
name = "restoration_speed"
description = "A frame to be restored"
seed = 8
samples_per_pixel = 8
batches = 2
set = {{ "rig.camera.width_px" = {width}, "rig.camera.height_px" = {height} }}
[[group]]
name = "chart"
scene = "tank_usaf"
frames = 1
"""
REFERENCE = "clahe"


def frame_of(dataset: Path, size: tuple[int, int]):
    """Return the first still frame of a size; ValueError if there is none."""
    from uwsim.dataset import store

    for frame in store.open(dataset).frames:
        if frame.info.blur is None and frame.image.shape[1::-1] == size:
            return frame
    raise ValueError(f"{dataset}: no still frame of {size[0]}x{size[1]} pixels, allowed: a dataset with one")


def rendered(folder: Path, size: tuple[int, int]) -> Path:
    """Render one frame of tank_usaf by the command line; return the dataset's folder."""
    recipe, out = folder / "restoration_speed.toml", folder / "dataset"
    recipe.write_text(RECIPE.format(width=size[0], height=size[1]), encoding="utf-8")
    command.generate(recipe, out)
    return out


def calls_of(frame, only: list[str] | None) -> dict:
    """Return {method: call without arguments} of all that are installed, the reference first."""
    from functools import partial

    from uwsim.bench import restoration, runner
    from uwsim.discovery import discover
    from uwsim.images import linear_from_srgb_uint8
    from uwsim.restoration import algorithms

    found, makers = discover(algorithms), restoration.makers(frame)
    if unknown := set(only or found) - set(found):
        raise ValueError(f"--only: got {', '.join(sorted(unknown))}, allowed: {', '.join(found)}")
    pictures = {"srgb_uint8": frame.image, "linear_float32": linear_from_srgb_uint8(frame.image)}
    calls = {}
    for name in (REFERENCE, *(name for name in only or found if name != REFERENCE)):
        module = found[name]
        if missing := runner.prepare(module):
            print(f"{name:28s} not installed: {', '.join(missing)}", file=sys.stderr)
            continue
        inputs = runner.permitted(runner.needs(module, name, tuple(makers)), makers)
        calls[name] = partial(module.restore, pictures[runner.input_kind(module, name)].copy(), **inputs)
    return calls


def main() -> int:
    """Measure, print a table, write tidy records."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="a small picture, two rounds: shows that it runs")
    parser.add_argument("--only", nargs="+", metavar="METHOD", help="these methods, and clahe")
    parser.add_argument("--dataset", type=Path, help="a dataset with a still frame of 640x480 pixels")
    parser.add_argument("--json", help="where to write the records; - for standard output")
    arguments = parser.parse_args()
    import cv2

    cv2.setNumThreads(1)
    size = QUICK if arguments.quick else FULL
    with tempfile.TemporaryDirectory() as folder:
        try:
            dataset = arguments.dataset or rendered(Path(folder), size)
            calls = calls_of(frame_of(dataset, size), arguments.only)
        except ValueError as error:
            parser.error(str(error))
    taken = side_by_side.timed(
        {name: (call, 1) for name, call in calls.items()}, reference=REFERENCE, turns=3 if arguments.quick else 12
    )  # fmt: skip
    records = []
    for name, times in taken.items():
        values = {
            "cpu_milliseconds": 1e3 * times.cpu_s, "wall_milliseconds": 1e3 * times.wall_s,
            "times_clahe": times.times_reference,
        }  # fmt: skip
        print(
            f"{name:28s} {values['cpu_milliseconds']:9.2f} ms = {values['times_clahe']:7.2f} x CLAHE "
            f"(wall {values['wall_milliseconds']:.2f} ms)",
            file=sys.stderr, flush=True,
        )  # fmt: skip
        records += [
            {
                "benchmark": "speed/restoration", "metric": metric, "algorithm": name, "width_px": size[0],
                "height_px": size[1], "value": value,
            }
            for metric, value in values.items()
        ]  # fmt: skip
    document.write(records, quick=arguments.quick, where=arguments.json)
    return 0


if __name__ == "__main__":
    sys.exit(main())
