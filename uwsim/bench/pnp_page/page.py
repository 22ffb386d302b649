"""The page of the pose benchmark: README.md, figures and JSON in one folder; its numbers are the records'."""

from pathlib import Path

from uwsim.bench.judged import goal_table
from uwsim.bench.pnp_page import dissertation, figures, goals, loop, tables
from uwsim.bench.pnp_page.printed import printed
from uwsim.bench.pnp_page.study import BEST, PRINTED, PoseStudy
from uwsim.bench.records import Result
from uwsim.files import write_text

TASKS = ("pnp",)
JSON = "pnp.json.gz"
_SHOWN = (BEST, "parallel_covariance", PRINTED, "opnp")
_SETTINGS_SHOWN = ("k_noise_", "k_depth_", "hold_out_")


def write(folder: Path, *, result: Result, dataset: object) -> Path:
    """Write figures, JSON and the page of a result; return the page."""
    folder, study = Path(folder), PoseStudy(result)
    folder.mkdir(exist_ok=True)
    figures.draw(study, folder)
    result.write(folder / JSON)
    page = folder / "README.md"
    write_text(page, text(study, loop.times_by_loop(folder)))
    return page


def text(study: PoseStudy, by_loop: dict[str, float] | None = None) -> str:
    """Return the page; `by_loop`: `loop.times_by_loop`."""
    origin = study.result.provenance
    parts = [
        "# Pose from points", _INTRODUCTION,
        f"{len(study.cases())} settings; seed {origin['dataset']['seed']}. {_trials(study)}"
        + (" **A quick run**: goals and claims are judged on few problems." if origin["quick"] else ""),
        _absent(study),
        "## Goals", goal_table(goals.of_solvers(study, by_loop)),
        goals.exact_note(study), loop.note(by_loop or {}),
        "## Geometric means of ratios of medians",
        "Rotation above translation, with 95 % intervals; settings of the dissertation's protocol in the groups that "
        "their heads say, and layouts that no method was set on (hold-out). All of them with noise.",
        tables.means(study), tables.fails(study),
        "## Failures, missed minima, no pose", tables.shares(study),
        "## Without noise", tables.exact(study),
        "## Time", "CPU time by problem [us], one thread if the libraries were told so; the wrapped ones are loops.",
        tables.speeds(study),
        "## Setting by setting", "Median errors over those of ML*, with paired bootstrap intervals of 95 %.",
        tables.to_ml(study, _settings(study), [name for name in _SHOWN if name in study.methods]),
        "## The dissertation's figures", _figures(study),
        "## The dissertation's numbers and claims", *dissertation.parts(printed(), study),
        "## How it is measured", _METHOD,
    ]  # fmt: skip
    return "\n\n".join(part for part in parts if part) + "\n"


def _trials(study: PoseStudy) -> str:
    counts = sorted({one["trials"] for one in study.conditions.values()})
    return f"Problems by setting: {', '.join(f'{count:,}' for count in counts)}."


def _absent(study: PoseStudy) -> str:
    lines = {}
    for record in study.result.records:
        if record.note.startswith("not installed"):
            lines[record.algorithm] = f"- `{record.algorithm}`: {record.note}."
    return "\n".join(lines.values())


def _settings(study: PoseStudy) -> list[str]:
    cases = [*study.scored(), *study.scored(use="hold_out")]
    return [case for case in cases if case.startswith(_SETTINGS_SHOWN)]


def _figures(study: PoseStudy) -> str:
    found = []
    for figure, name in figures.names(study).items():
        one = study.conditions[study.cases(figure=figure)[0]]
        found.append(f"![Figure {figure}: {one['layout']}, {one['sweep'].rpartition('_')[0] or one['sweep']}]({name})")
    return "\n\n".join(found)


_INTRODUCTION = """Every solver on the same problems: layouts of points, poses before a camera, noisy image points; no
picture. Made by `uwsim bench pnp --out DIR`; all numbers are in `pnp.json.gz` (one record per setting, solver and
metric), the printed ones in `benchmarks/printed/pose.toml`, the settings in `benchmarks/pnp.toml`."""

_METHOD = """- ML*: the least reprojection error reached from the true pose; an oracle. Where noise makes many minima
  (2 to 10 px at a focal length of 80 px, small targets or few points) it stays in the one next to the truth, often not
  the least: no solver reaches that without the truth, and those are the settings surely above a goal.
- Bound: Cramer-Rao's at the true pose; where it stands beside medians, the median of normal errors at it.
- Rotation error: the angle of the rotation between estimate and truth. Translation error: by the true distance, in
  percent. Problems without a pose count as infinite errors in medians and as failures; means are over the poses.
- Failed: a rotation error above five times the 95 % quantile of ML* in that setting.
- Missed: what least-squares refinement makes of the pose is above the best known minimum, the least that is reached
  from the truth and from 24 rotations over all. In flat targets the second minimum may be the lower one: a pose there
  is a flip, whatever the solver.
- Intervals: percentiles of a paired bootstrap in each setting, the same draws for every solver. Of geometric means: as
  of independent settings; between two solvers as if they were independent as well, which is too wide.
- Noise is a standard deviation in pixels of each coordinate. `k_`: with the focal length of 5.32.
- No solver is given noise or truth; of several poses it picks by its own cost."""
