"""Contact sheets of the restoration page: one scene in all waters, as seen, as it is without water, and restored."""

from io import BytesIO
from pathlib import Path
from textwrap import fill

import numpy as np

from uwsim.bench import restoration
from uwsim.bench.canvas import new_figure
from uwsim.bench.definition import Definition
from uwsim.bench.restoration_page.study import Study
from uwsim.bench.run import Algorithm, load
from uwsim.bench.runner import NotInFrame
from uwsim.bench.study import title
from uwsim.bench.task import Case, spread
from uwsim.dataset.store import Dataset
from uwsim.files import write_atomically

SHOWN = ("dual_transmission", "lamp_model", "clahe", "msrcr", "wgif_detail", "udcp", "sea_thru")
SHEETS = 4
LARGEST_BYTES = 400_000
_QUALITIES = (88, 80, 72, 64, 56, 48)


def chosen(study: Study) -> list[str]:
    """Return a few scenes, spread over those that were scored in the most waters."""
    counts = {scene: sum(shot.scene == scene for shot in study.cases) for scene in study.scenes}
    most = max(counts.values())
    return spread([scene for scene, count in counts.items() if count == most], SHEETS)


def shown_methods(study: Study, definition: Definition) -> list[Algorithm]:
    """Return what the sheets show of the methods that took part and are installed; the oracle last."""
    names = [name for name in (*SHOWN, study.oracle) if name in study.methods]
    found = [load(restoration.TASK, name, definition.variants) for name in names]
    return [algorithm for algorithm in found if not algorithm.missing]


def write(study: Study, dataset: Dataset, path: Path, *, scene: str, methods: list[Algorithm]) -> None:
    """Write the sheet of a scene as JPEG: a row per water; with each name the PSNR, or why there is no picture."""
    rows = [(water, case) for water in study.waters if (case := study.case_of(scene, water)) is not None]
    width, height = dataset.frame(rows[0][1]).image.shape[1::-1]
    figure, panels = new_figure(len(rows), len(methods) + 2, width=1.75, height=1.75 * height / width + 0.28)
    for row, (water, name) in zip(panels, rows, strict=True):
        frame = dataset.frame(name)
        case = Case(name, frame.image, makers=restoration.makers(frame), truth=restoration.reference(frame))
        _show(row[0], case.image, f"{title(water)}, {_psnr(study, name, study.raw)}")
        _show(row[1], case.truth, "truth, without water")
        for panel, method in zip(row[2:], methods, strict=True):
            try:
                picture, _ = restoration.restored(method.module, method.name, method.given, case)
            except NotInFrame as reason:
                _leave_blank(panel, title(method.name), str(reason))
                continue
            _show(panel, picture, f"{title(method.name)}, {_psnr(study, name, method.name)}")
    write_atomically(path, lambda temporary: temporary.write_bytes(_jpeg(figure)))


def _jpeg(figure) -> bytes:
    """Return a figure as JPEG of the best quality with which it is not too large."""
    for quality in _QUALITIES:
        stream = BytesIO()
        figure.savefig(stream, format="jpeg", dpi=110, pil_kwargs={"quality": quality})
        if stream.tell() < LARGEST_BYTES:
            break
    return stream.getvalue()


def _psnr(study: Study, case: str, method: str) -> str:
    record = study.record(case, method, "psnr")
    if record is None or record.value is None:
        return "no PSNR" if record is None else record.note
    return f"{record.value:.1f} dB"


def _show(panel, picture: np.ndarray, text: str) -> None:
    panel.imshow(picture, interpolation="antialiased")
    panel.set_title(text, fontsize=7)
    panel.axis("off")


def _leave_blank(panel, name: str, reason: str) -> None:
    panel.text(0.5, 0.5, fill(reason, 28), ha="center", va="center", fontsize=7, transform=panel.transAxes)
    panel.set_title(name, fontsize=7)
    panel.axis("off")
