"""One self-contained HTML page: what a dataset shows and how well algorithms do on it."""

from pathlib import Path

from uwsim.bench.page import frames, methods, motion, scores
from uwsim.bench.page.markup import asset, escape, flatten, pairs_table, paragraph, section
from uwsim.bench.records import Result, result_from_dict
from uwsim.dataset.store import Dataset
from uwsim.files import write_text
from uwsim.look import style

LEAD = (
    "Simulated underwater pictures with the truth behind every pixel, and how near algorithms for "
    "restoration, motion blur and pose come to it."
)
# nothing may be loaded from anywhere: the page is the whole report
_POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'"


def write_report(
    path: Path, *, dataset: Dataset, results: list[dict], environment: dict, method_images: bool = True,
    gallery: str | None = None,
) -> None:  # fmt: skip
    """Write the report of a dataset and of benchmark results on it, complete or absent.

    `results`: contents of result files (`Result.to_dict()`); `environment`: settings and versions to list,
    may be nested; `method_images`: run the methods on one frame each to show what they do; `gallery`: address of the
    dataset's gallery, seen from the page, to link to.
    The bytes depend on the arguments alone. Raises ValueError on a result that is none.
    """
    read = [result_from_dict(result) for result in results]
    write_text(Path(path), page(dataset, read, environment, method_images=method_images, gallery=gallery))


def page(
    dataset: Dataset, results: list[Result], environment: dict, *, method_images: bool = True,
    gallery: str | None = None,
) -> str:  # fmt: skip
    """Return the page as a string."""
    frame = frames.shown_frame(dataset)
    by_task = {result.provenance.get("definition", {}).get("task", result.benchmark): result for result in results}
    shown = by_task if method_images else {}
    parts = [
        frames.compare_section(frame),
        frames.layers_section(frame),
        methods.restoration_section(frame, dataset, shown["restoration"]) if "restoration" in shown else "",
        motion.blur_section(dataset, shown.get("blur")),
        methods.pose_section(dataset, shown.get("pose")),
        _benchmarks(results, dataset),
        frames.overview_section(dataset, gallery),
        section("environment", "Environment", pairs_table(flatten(environment), "What this was made with")),
        _reproduce(dataset, results),
    ]
    return _document(f"uwsim report: {dataset.name}", frames.facts(dataset), [part for part in parts if part])


def _benchmarks(results: list[Result], dataset: Dataset) -> str:
    if not results:
        return section("benchmarks", "Benchmarks", paragraph("No benchmark was run for this report."))
    hint = paragraph("A click on the head of a column sorts by it.", "note")
    return section("benchmarks", "Benchmarks", hint, *(scores.benchmark(result, dataset) for result in results))


def _reproduce(dataset: Dataset, results: list[Result]) -> str:
    """Return the commands that make the same data and numbers again."""
    recipe = dataset.manifest["recipe"].get("name", dataset.name)
    folder = f"out/{dataset.name}"
    lines = [
        f"uwsim generate {recipe} --out {folder}",
        f"uwsim check {folder}",
    ]
    for result in results:
        quick = " --quick" if result.provenance.get("quick") else ""
        made = "frames" in result.provenance.get("definition", {})
        lines.append(f"uwsim bench {result.benchmark}{'' if made else f' --dataset {folder}'}{quick}")
    text = "With the versions above and the same kind of processor the first command gives the same bytes."
    return section("reproduce", "Make it again", paragraph(text), f"<pre>{escape(chr(10).join(lines))}</pre>")


def _document(title: str, facts: str, parts: list[str]) -> str:
    links = "".join(
        f'<a href="#{identity}">{text}</a>'
        for identity, text in (
            ("twin", "Twin"), ("truth", "Truth"), ("restorations", "Restorations"), ("blur", "Blur"),
            ("pose", "Pose"), ("benchmarks", "Benchmarks"), ("frames", "Frames"),
            ("environment", "Environment"), ("reproduce", "Reproduce"),
        )
        if any(part.startswith(f'<section id="{identity}"') for part in parts)
    )  # fmt: skip
    return f"""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="{_POLICY}">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{escape(title)}</title>
<link rel="icon" href="data:,">
<style>
{style()}</style>
</head>
<body>
<header>
<h1>{escape(title)}</h1>
<p class="lead">{escape(LEAD)}</p>
{facts}
<nav aria-label="Sections">{links}</nav>
</header>
<main>
{chr(10).join(parts)}
</main>
<footer>Written by uwsim. The page is one file and loads nothing.</footer>
<script>
{asset("script.js")}</script>
</body>
</html>
"""
