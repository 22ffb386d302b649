"""`uwsim demo`: dataset, benchmarks, report and gallery in one go."""

import os
import sys
import webbrowser
from pathlib import Path

from uwsim.commands import generate_dataset, require_folder, run_benchmark, write_page
from uwsim.progress import Report


def demonstrate(out: Path, *, report: Report) -> tuple[Path, Path]:
    """Render the demo dataset (or finish it), run the benchmarks, write report and gallery; return both pages."""
    from uwsim.gallery.make import write

    require_folder(out)
    out.mkdir(exist_ok=True)
    generate_dataset("demo", out / "dataset", resume=True, report=report)
    results = []
    for name in ("restoration", "blur", "pose"):
        result = run_benchmark(name, out / "dataset", algorithms=None, quick=False, report=report)
        result.write(out / f"{name}.json")
        results.append(result.to_dict())
    gallery = write(out / "dataset", out / "gallery", progress=lambda done, total: report("gallery", done, total)).page
    page = out / "report.html"
    report("report", 0, 1)
    write_page(out / "dataset", page, results, gallery=gallery.relative_to(out).as_posix())
    return page, gallery


def show(page: Path) -> bool:
    """Open a page in the user's browser; False, and nothing done, where there is no display to show it on."""
    if sys.platform.startswith("linux") and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        return False
    return webbrowser.open(page.resolve().as_uri())
