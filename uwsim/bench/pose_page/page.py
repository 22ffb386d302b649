"""The page of the pose benchmark on pictures: README.md, a figure and JSON; its numbers are the records'."""

from pathlib import Path

from uwsim.bench.judged import goal_table
from uwsim.bench.pnp_page.printed import Printed, printed
from uwsim.bench.pose_page import figures, goals, tables
from uwsim.bench.pose_page.study import TABLES, PictureStudy
from uwsim.bench.records import Result, markdown_table
from uwsim.files import write_text

TASKS = ("pose",)
JSON = "pose.json.gz"


def write(folder: Path, *, result: Result, dataset: object) -> Path:
    """Write the figure, the JSON and the page of a result; return the page."""
    folder, study = Path(folder), PictureStudy(result)
    folder.mkdir(exist_ok=True)
    drawn = figures.draw(study, folder)
    result.write(folder / JSON)
    page = folder / "README.md"
    write_text(page, text(study, drawn=drawn))
    return page


def text(study: PictureStudy, *, drawn: bool) -> str:
    """Return the page."""
    origin, known = study.result.provenance, printed()
    parts = [
        "# Poses from pictures", _INTRODUCTION.format(benchmark=study.result.benchmark),
        f"{origin['cases']} cases of the dataset {origin['dataset']['name']}, seed {origin['dataset']['seed']}."
        + (" **A quick run**: goals are judged on few cases." if origin["quick"] else ""),
        "## Goals", goal_table(goals.of_pictures(known, study)),
        *_section("In short", _STATISTICS, tables.in_short(study)),
        *_section("Tables 5.1 to 5.5", _TABLES, *_beside(known, study)),
        f"![Errors over the distance]({figures.NAME})" if drawn else "",
        "## Claims on real pictures", _claims(known, study),
        *_section("Turbidity and restoration", _STATISTICS, tables.turbidity(study), tables.turbid_distances(study)),
        *_section("Ports", _PORTS, tables.ports(study)),
        *_section("Motion", _MOTION, tables.motion(study)),
        *_section("Which sphere is which", _NAMES, tables.names(study)),
        "## How it is measured", _METHOD, *[f"- {note}." for note in origin["cameras"]],
    ]  # fmt: skip
    return "\n\n".join(part for part in parts if part) + "\n"


def _section(heading: str, words: str, *tables_: str) -> list[str]:
    """Return the parts of a section; none where the result has no cases for its tables."""
    return [f"## {heading}", words, *tables_] if any(tables_) else []


def _beside(known: Printed, study: PictureStudy) -> list[str]:
    if not study.cases(group=TABLES):
        return []
    parts = [tables.poses(study)]
    for table in known.table:
        for quantity, words in (("rotation_deg", "rotation [deg]"), ("translation_percent", "translation [%]")):
            parts.append(f"Table {table.number}, {table.depth_mm} mm: mean error of {words}.")
            parts.append(tables.beside_printed(table, study, quantity))
    return parts


def _claims(known: Printed, study: PictureStudy) -> str:
    rows = [[f"\"{known.claims[name].text}\" ({known.claims[name].place})", verdict.word, verdict.numbers]
            for name, verdict in goals.claims(known, study).items()]  # fmt: skip
    return markdown_table(["claim", "verdict", "numbers"], rows, texts=3)


_INTRODUCTION = """Where a body stands, from rendered underwater pictures of its spheres and markers: detection, names
and pose together. Made by `uwsim bench {benchmark} --out DIR`; all numbers are in `pose.json.gz` (one record per
case, method and metric), the printed ones in `benchmarks/printed/pose.toml`."""

_STATISTICS = "Medians of errors, means of shares."

_MOTION = "The blur is estimated from the picture (`whittle`) and taken out by `wiener` before detection."

_TABLES = """Printed: means of 90 real pictures each, of a layout, a camera and a light that the dissertation does not
state. Here: rendered pictures of six spheres on a square bipyramid of 80 mm edges behind a flat port, in weak light,
with so many orientations about x as stand in the row. So the rows share places and solvers, not pictures. The solvers
of the printed columns see points of the paraxial pinhole in water, as after a calibration in the water near the axis
would be; `port refined` knows the port, `pinhole ignoring port` is calibrated in air."""

_PORTS = """The two flat ports: their air gap and glass. The pinhole in air is what a calibration on deck gives; `best`
has the focal length that the port and the water make of it on the axis; `port refined` goes through the port."""

_NAMES = """Spheres have no names. **By true places**: each detection belongs to the sphere whose true image is nearest,
within its own radius; the dissertation's markers were told apart by hand. This is what all the other tables use. **By a
search**: poses from triples of points, nothing of the truth; but a bipyramid turns into itself in 24 ways, a square in
8, a pyramid in 4, the stereo layout in 2, and no picture tells these apart: there the one nearest to the truth is
taken. Ten random points have no such turn, and nothing is taken from the truth."""

_METHOD = """- Spheres: blobs in scale space, then a lit ball fitted to pixels in linear light
  (`uwsim/pose/spheres.py`); the image of its centre, not the middle of its outline. Markers: ArUco and AprilTag,
  corners where lines fitted to the four edges meet.
- Covariances: of centres from the fit's residuals and 1 % of the radius for what the model leaves out, of corners from
  the scatter of the edges' places, both larger where the residuals are correlated; then times one factor for spheres
  and one for corners, found on pictures of the set `pose_tuning` (`benchmarks/fits/marker_errors.py`). `port refined`
  weights by them.
- Errors: angle of the rotation between pose and truth; distance of the translations over the true one.
- Errors are of the cases with a pose, whose share stands beside them: compare methods where that is alike."""
