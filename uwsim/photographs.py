"""What `uwsim restore` and `uwsim deblur` do with photographs, without printing.

Every input is read and done before anything is written.
"""

import math
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import numpy as np

from uwsim.commands import require_folder
from uwsim.progress import Report


def restore_photographs(method: str, images: list[Path], out: Path, *, report: Report) -> list[dict]:
    """Restore photographs into `out`/<name>.png.

    Returns one row per picture: `image`, `method`, `milliseconds`, and before and after of each no-reference metric.
    """
    from uwsim.bench import restoration as bench
    from uwsim.bench.restoration.scores import no_reference_scores
    from uwsim.bench.task import Case
    from uwsim.restoration import algorithms

    module, name = _method(algorithms, method, knows=())
    names, pictures = _read(images, out)
    rows, restored = [], []
    for done, (path, picture) in enumerate(zip(images, pictures, strict=True)):
        report(f"{name}: {path.name}", done, len(images))
        output, elapsed_ms = bench.restored(module, name, (), Case(str(path), picture, makers={}, truth=None))
        before, after = no_reference_scores(picture), no_reference_scores(output)
        scores = {key: {"before": before[key], "after": after[key]} for key in before}
        rows.append({"image": path.name, "method": name, "milliseconds": elapsed_ms} | scores)
        restored.append(output)
    _write(out, names, restored)
    return rows


def check_table(path: Path, images: list[Path], out: Path) -> None:
    """Raise ValueError where a file of numbers would take the place of a photograph, or of what is written of it."""
    taken = [*images, *(out / f"{image.stem}.png" for image in images)]
    if over := [one for one in taken if one.resolve() == path.resolve()]:
        raise ValueError(f"--json {path}: {over[0]} is a picture, allowed: another file")


def restoration_table(rows: list[dict]) -> str:
    """Return the rows of `restore_photographs` as a Markdown table."""
    metrics = [key for key, value in rows[0].items() if isinstance(value, dict)]
    lines = [f"| image | {' | '.join(f'{m} before | after' for m in metrics)} | time [ms] |"]
    lines.append("|---" * (2 * len(metrics) + 2) + "|")
    for row in rows:
        scores = " | ".join(f"{row[m]['before']:.3f} | {row[m]['after']:.3f}" for m in metrics)
        lines.append(f"| {row['image']} | {scores} | {row['milliseconds']:.1f} |")
    lines.append("\nNo-reference scores say little about truth: white noise has a UCIQE-O of 0.662.")
    return "\n".join(lines)


def deblur_photographs(
    method: str, images: list[Path], out: Path, *, estimator: str | None, length_px: float | None,
    angle_deg: float | None, report: Report,
) -> list[dict]:  # fmt: skip
    """Undo the motion blur of photographs into `out`/<name>.png.

    The blur is what an estimator says of each photograph, or the one given by length and angle (x right, y up). Where
    `whittle` says "not uniform", each tile is undone by its own blur; where the estimator says "no blur", or the length
    is 0, the picture is left alone. Returns one row per picture: `image`, `method`, `blur_from`, `length_px`,
    `angle_deg`, `verdict`, `how` ("uniform", "4 of 6 tiles", "left alone"), `milliseconds`.
    """
    from uwsim.bench import runner
    from uwsim.bench.undone import undone, way_of
    from uwsim.motion_blur import deconvolvers

    source, blur_of = _blur_source(estimator, length_px, angle_deg)
    module, name = _method(deconvolvers, method, knows=("blur",))
    given = runner.needs(module, name, ("blur",))
    runner.input_kind(module, name)
    runner.entry(module, name, "deblur")
    names, pictures = _read(images, out)
    rows, sharpened = [], []
    for done, (path, picture) in enumerate(zip(images, pictures, strict=True)):
        report(f"{name}: {path.name}", done, len(images))
        blur, where = blur_of(picture, str(path)), f"{path}: {name}"
        way = way_of(module, name, image=picture, blur=blur, blur_from=source)
        output, elapsed_ms = undone(module, name, given, image=picture, way=way, where=where)
        sharpened.append(output)
        rows.append({
            "image": path.name, "method": name, "blur_from": source, "length_px": float(blur.length_px),
            "angle_deg": float(blur.angle_deg), "verdict": getattr(blur, "verdict", "blur"),
            "how": way.how if given else "without the blur", "milliseconds": elapsed_ms,
        })  # fmt: skip
    _write(out, names, sharpened)
    return rows


def deblurring_table(rows: list[dict]) -> str:
    """Return the rows of `deblur_photographs` as a Markdown table."""
    lines = ["| image | blur length [px] | angle [deg] | verdict | how | time [ms] |", "|---" * 6 + "|"]
    for row in rows:
        blur = f"{row['length_px']:.2f} | {row['angle_deg']:.1f} | {row['verdict']} | {row['how']}"
        lines.append(f"| {row['image']} | {blur} | {row['milliseconds']:.1f} |")
    words = [f"Blur: {rows[0]['blur_from']}. Angles: x right, y up."]
    if any("tiles" in row["how"] for row in rows):
        words.append("Not uniform: length and angle are the best single ones; every tile has its own.")
    if any(row["how"] == "left alone" for row in rows):
        words.append("Left alone: no blur to undo; the picture is as it was.")
    lines.append("\n" + " ".join(words))
    return "\n".join(lines)


def _blur_source(
    estimator: str | None, length_px: float | None, angle_deg: float | None
) -> tuple[str, Callable[[np.ndarray, str], object]]:
    """Return where the blur comes from, and a function (picture, its name) -> Estimate."""
    from uwsim.bench import blur as bench
    from uwsim.bench.blur.estimates import Refusal
    from uwsim.bench.task import Case
    from uwsim.bench.undone import ESTIMATOR
    from uwsim.motion_blur import estimators
    from uwsim.motion_blur.estimate import Estimate

    if estimator is not None or (length_px is None and angle_deg is None):
        if length_px is not None or angle_deg is not None:
            raise ValueError("--length-px, --angle-deg: got with --estimator, allowed: one or the other")
        module, name = _method(estimators, estimator or ESTIMATOR, knows=())

        def estimated(picture: np.ndarray, path: str) -> Estimate:
            found, _ = bench.estimated(module, name, (), Case(path, picture, {}, None))
            if isinstance(found, Refusal):
                raise ValueError(f"{path}: {found.reason}")
            return found

        return name, estimated
    if length_px is None or angle_deg is None:
        raise ValueError("--length-px, --angle-deg: got one of them, allowed: both, or neither")
    if not (math.isfinite(length_px) and length_px >= 0):
        raise ValueError(f"--length-px: got {length_px}, allowed: 0 and more")
    if not math.isfinite(angle_deg):
        raise ValueError(f"--angle-deg: got {angle_deg}, allowed: a finite angle")
    known = Estimate(length_px, angle_deg % 180)
    return "given", lambda picture, path: known


def _method(package: ModuleType, method: str, *, knows: tuple[str, ...]) -> tuple[ModuleType, str]:
    """Return (module, name) of a method that needs nothing but what is known of a photograph; ValueError if it does."""
    from uwsim import discovery
    from uwsim.bench import runner

    module = discovery.find(package, method)
    name = module.__name__.rpartition(".")[2]
    if missing := discovery.missing_packages(module):
        raise ValueError(f"{name}: needs {', '.join(missing)}, not installed")
    if needs := [need for need in getattr(module, "NEEDS", ()) if need not in knows]:
        raise ValueError(f"{name}: needs {', '.join(needs)}, which a photograph does not come with")
    runner.prepare(module)
    return module, name


def _read(images: list[Path], out: Path) -> tuple[list[str], list[np.ndarray]]:
    """Return names of the files to write and the photographs; ValueError where `out` would not do for them."""
    from uwsim.images import read_srgb

    require_folder(out)
    pictures = [read_srgb(path) for path in images]
    names = [f"{path.stem}.png" for path in images]
    if repeated := sorted({n for n in names if names.count(n) > 1}):
        raise ValueError(f"images: two would be written to {out / repeated[0]}, allowed: different names")
    if over := [path for path, n in zip(images, names, strict=True) if (out / n).resolve() == path.resolve()]:
        raise ValueError(f"--out {out}: {over[0]} would be overwritten, allowed: another folder")
    if folders := [out / name for name in names if (out / name).is_dir()]:
        raise ValueError(f"--out {out}: {folders[0]} is a folder, allowed: one without it")
    return names, pictures


def _write(out: Path, names: list[str], pictures: list[np.ndarray]) -> None:
    from uwsim.images import write_png

    out.mkdir(exist_ok=True)
    for file, picture in zip(names, pictures, strict=True):
        write_png(out / file, picture)
