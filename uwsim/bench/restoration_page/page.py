"""The page of the restoration benchmark: README.md, figures, contact sheets and JSON; its numbers are the records'."""

from pathlib import Path

from uwsim.bench.definition import definition_from
from uwsim.bench.records import Result, finding_table
from uwsim.bench.restoration_page import conclusions, dissertation, figures, no_reference, sheets, tables
from uwsim.bench.restoration_page.printed import printed
from uwsim.bench.restoration_page.study import Study, joined, study_of
from uwsim.bench.study import title
from uwsim.dataset.store import Dataset
from uwsim.files import write_text

GAIN, SHARE, NO_REFERENCE = "gain_over_raw.png", "oracle_share.png", "no_reference.png"


def write(folder: Path, *, result: Result, dataset: Dataset) -> Path:
    """Write figures, contact sheets and JSON of a result into a folder, then the page; return it."""
    folder, study = Path(folder), study_of(result, dataset)
    folder.mkdir(exist_ok=True)
    noise = no_reference.noise_scores(study, dataset)
    figures.gain_over_raw(study, folder / GAIN)
    if "oracle_share" in study.of_metric:
        figures.oracle_share(study, folder / SHARE, goals=conclusions.SHARE_GOALS)
    figures.no_reference_against_truth(study, folder / NO_REFERENCE, noise=noise)
    methods = sheets.shown_methods(study, definition_from(study.definition, where="result"))
    for scene, name in sheet_names(study).items():
        sheets.write(study, dataset, folder / name, scene=scene, methods=methods)
    result.write(folder / f"{result.benchmark}.json.gz")
    page = folder / "README.md"
    write_text(page, text(study, noise))
    return page


def sheet_names(study: Study) -> dict[str, str]:
    """Return {scene: file} of the contact sheets."""
    return {scene: f"sheet_{number}.jpg" for number, scene in enumerate(sheets.chosen(study), start=1)}


def text(study: Study, noise: dict[str, float]) -> str:
    """Return the page; noise: what white noise scores (`no_reference.noise_scores`)."""
    known = printed()
    high = known.tables("6.3")[0].water
    parts = [
        "# Restoration in turbid water", _introduction(study), tables.left_out(study, known),
        "## Conclusions", conclusions.text(study, high=high, noise=noise),
        "## Methods by water", _BOLD, *_scores(study), *_figures(study),
        "## Contact sheets", _SHEETS, *(f"![{scene}]({name})" for scene, name in sheet_names(study).items()),
        "## The dissertation's tables", *dissertation.parts(study, known, noise),
        "## How it is measured", _method(study),
    ]  # fmt: skip
    return "\n\n".join(part for part in parts if part) + "\n"


_BOLD = """Bold: the best of the methods that see no layer of the truth. Given: what a method is shown beside the
picture; a range map (`range_m`) is the exact one."""
_SHEETS = """Rows: waters. Columns: the picture as it is, the truth, methods, the oracle; under each name its PSNR."""


def _introduction(study: Study) -> str:
    origin = study.result.provenance
    quick = " (a quick run: a few cases only)" if origin["quick"] else ""
    scenes = {shot.scene for shot in study.cases}
    waters = joined([title(water) for water in study.waters])
    return (
        f"How near restorations come to the same picture without water. {len(study.cases)} rendered frames{quick}: "
        f"{len(scenes)} scenes in {waters}, dataset {origin['dataset']['name']}. Made by "
        f"`uwsim bench {study.result.benchmark} --out DIR`; all numbers are in `{study.result.benchmark}.json.gz` (one "
        "record per case, method and metric), the printed ones in `benchmarks/printed/restoration.toml`."
    )


def _scores(study: Study) -> list[str]:
    found = [f"### {title(water)}\n\n{tables.scores(study, water)}" for water in study.waters]
    return [*found, f"### All waters\n\n{tables.scores(study, None)}"]


def _figures(study: Study) -> list[str]:
    share = f"![Share of the oracle's gain by water]({SHARE})" if "oracle_share" in study.of_metric else ""
    return [
        f"![Gain in PSNR by water]({GAIN})",
        share,
        f"![UIQM and UCIQE against PSNR, with white noise]({NO_REFERENCE})",
        "Points: methods without layers of the truth, in each water; rimmed: ours.",
        *(
            f"{found['caption']}:\n\n{finding_table(found)}"
            for found in study.result.provenance.get("findings", {}).values()
        ),
    ]


def _method(study: Study) -> str:
    statistics = study.result.provenance["statistics"]
    means = [title(name) for name in tables.measured(study)[0] if statistics.get(name, "mean") == "mean"]
    kinds = "medians over the cases" + (f"; means for {joined(means)}" if means else "")
    ours = joined([f"`{name}`" for name in study.ours]) or "none in this run"
    return f"""- Truth: the water-free twin, the same rays, port, lamps and exposure, without noise, in 8-bit sRGB.
- Tables of methods: {kinds}. Gains and shares of the oracle's gain in sentences and figures, and the dissertation's
  tables: means.
- PSNR and SSIM: of all pixels and channels, no gain fitted unless the name says so; SSIM in uniform windows of 7 pixels
  (`uwsim/metrics`).
- Share of the oracle's gain: (PSNR of the method - PSNR as it is) / (PSNR of the oracle - PSNR as it is), where the
  oracle gains at least 6 dB; the oracle (`{study.oracle}`) is a lower bound of what can be had.
- Methods are told apart by what they are given: nothing, what a robot knows (`rig`), a range map, or layers of the
  truth (oracles). Ours: {ours}; their other forms are neither ours nor rivals.
- Rank correlations: Spearman's. In sentences and in the figure over the methods without layers of the truth, in each
  water by itself; in the table over all methods, with the oracles.
- White noise: a picture of the frames' size whose levels are independent; its PSNR is a mean over a few truths."""
