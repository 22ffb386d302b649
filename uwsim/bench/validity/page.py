"""The page of the validity study: README.md, figures and JSON in one folder; every number comes out of the records.

Two benchmarks share the folder, the grid and the chart experiment: each writes its figures and its JSON, and the page
is made of the JSON of both that lies there.
"""

from pathlib import Path

import numpy as np

from uwsim.bench.definition import definition_from
from uwsim.bench.records import Result, markdown, read_result
from uwsim.bench.validity import experiment, figures, pictures
from uwsim.bench.validity.study import Study, title
from uwsim.dataset.store import Dataset
from uwsim.files import write_text

GRID = "validity"
_SUFFIXES = {"_three_bands": "by three bands", "_as_printed": "as printed", "_closed_form": "closed form 2.64"}
_SHOWN_DEPTHS = (1.0, 4.0)


def check(name: str, *, algorithms: list[str] | None) -> None:
    """Raise ValueError unless a benchmark has a page, and all of its algorithms take part."""
    if name not in (GRID, experiment.NAME) or algorithms:
        got = f"{name} with {', '.join(algorithms)} alone" if algorithms else name
        allowed = f"{GRID} and {experiment.NAME} with all their algorithms, and restoration"
        raise ValueError(f"--out: got {got}, allowed: {allowed}")


def write(folder: Path, *, result: Result, dataset: Dataset) -> Path:
    """Write the figures and the JSON of a result, then the page of all results that lie in the folder; return it."""
    folder, study = Path(folder), Study(result)
    folder.mkdir(exist_ok=True)
    form = pictures.former(dataset, definition_from(result.provenance["definition"], where="result"))
    if result.benchmark == experiment.NAME:
        experiment.write_figures(study, dataset, form, folder)
    else:
        _grid_figures(study, dataset, form, folder)
    result.write(folder / f"{result.benchmark}.json.gz")
    page = folder / "README.md"
    write_text(page, text(folder))
    return page


def text(folder: Path) -> str:
    """Return the page of the results in a folder."""
    found = {name: folder / f"{name}.json.gz" for name in (GRID, experiment.NAME)}
    studies = {name: Study(read_result(path)) for name, path in found.items() if path.is_file()}
    parts = ["# Where imaging models hold", _INTRODUCTION]
    if GRID in studies:
        parts.append(_grid_section(studies[GRID]))
    if experiment.NAME in studies:
        parts.append(experiment.section(studies[experiment.NAME]))
    parts.append(_METHOD)
    return "\n\n".join(parts) + "\n"


_INTRODUCTION = """Imaging models by formula (`uwsim/formation`) against light transport (`uwsim.render`) of the same
scenes: same water at every wavelength, same lamp, same camera, no free scale factor between the terms. Made by
`uwsim bench validity --out DIR` and `uwsim bench validity_chart --out DIR`; all numbers are in the JSON files
(one record per case, model and metric)."""

_METHOD = """## How it is measured

- Image error: root mean square of model minus truth over root mean square of the truth, in radiance, all bands. The
  truth's Monte-Carlo variance is taken off, in the smallest blocks of 1 to 16 pixels in which 2 % can be told from it;
  single blocks of very large noise are left out (`uwsim/bench/validity/grain.py`).
- Layer errors: the same of the means over 8 x 8 regions. Layers are told apart by the last event before the camera:
  a body (direct), a particle after a body (forward scatter), a particle without a body before (backscatter).
- Contrast error: of the contrast in the groups of a USAF chart relative to that without water, by cross-spectra.
- PSNR and MSE: of 8-bit pictures by the same camera without sensor noise; auto-exposed to the truth.
- Models get the reflectance of the whole pixel (from the twin without water), not that of its centre.
- Akkaynak-Treibitz with physical parameters takes its two coefficients from the spectra within a band; in these waters
  they hardly differ there, so that it comes out as Beer-Lambert. What its freedom is worth shows when it is fitted.
- Fitted: the model's own parameters, fitted to each truth by least squares; what they came to is in the JSON (notes).
- Below sensor noise: the light from bodies is weaker than the camera's noise in 95 % of the pixels."""


def _grid_figures(study: Study, dataset: Dataset, form: pictures.Form, folder: Path) -> None:
    figures.error_over_depth(study, folder / "error_over_optical_depth.png")
    figures.light_over_depth(study, folder / "light_over_optical_depth.png")
    figures.validity_map(study, folder / "validity_map.png", models=study.physical)
    if study.fitted:
        figures.validity_map(study, folder / "validity_map_fitted.png", models=list(study.fitted.values()))
    charts = [case for case in study.cases if study.conditions[case]["scene"] == "tank_usaf"] or study.cases
    reliefs = [case for case in study.cases if case not in charts] or study.cases
    near = {"lamp_offset_m": 0.1, "single_scattering_albedo": 0.75, "range_m": 1.05}
    shown = [study.nearest(charts, optical_depth=1.0, **near), study.nearest(reliefs, optical_depth=2.0, **near)]
    pictures.error_maps(study, dataset, form, folder / "error_maps.png", cases=shown, models=study.physical)
    contrast = [study.nearest(charts, optical_depth=depth, **near) for depth in _SHOWN_DEPTHS]
    pictures.contrast_transfer(
        dataset, form, study, folder / "contrast_transfer.png", cases=contrast, models=study.physical
    )


def _grid_section(study: Study) -> str:
    quick = " (a quick run: a few cases only)" if study.result.provenance["quick"] else ""
    steps = {key: study.steps(key) for key in ("optical_depth", "single_scattering_albedo", "lamp_offset_m", "range_m")}
    extent = {key: f"{found[0][0]:.2g} to {found[-1][0]:.2g}" for key, found in steps.items()}
    phases = sorted({condition["phase"] for condition in study.conditions.values()})
    parts = [
        f"## The grid\n\n{len(study.cases)} cases{quick}: optical depth c R {extent['optical_depth']}, range "
        f"{extent['range_m']} m, single-scattering albedo {extent['single_scattering_albedo']}, lamp "
        f"{extent['lamp_offset_m']} m beside the camera, phase functions: {', '.join(phases)}.",
        _found(study),
        "![Where each model holds](validity_map.png)",
        _within_table(study),
        "![Image error over optical depth](error_over_optical_depth.png)",
        "![What the light is made of](light_over_optical_depth.png)",
        _variants_text(study),
        "![Contrast transfer](contrast_transfer.png)",
        "![Pictures and where they differ](error_maps.png)",
        "![Where each fitted model holds](validity_map_fitted.png)" if study.fitted else "",
        "Medians over all cases:",
        markdown(study.result).partition("\n\n")[2],
    ]
    return "\n\n".join(part for part in parts if part)


def _found(study: Study) -> str:
    """Return what the grid says, in sentences."""
    best = min(study.physical, key=study.median)
    sentences = [
        f"With physical parameters the model with the smallest median image error is {title(best)}, "
        f"{study.median(best):.1f} %."
    ]
    for low, high, name in ((0, 0.5, "below 0.5"), (0.5, 2.5, "from 0.5 to 2.5"), (2.5, np.inf, "beyond 2.5")):
        cases = [case for case in study.cases if low <= study.conditions[case]["optical_depth"] < high]
        if cases:
            first = min(study.physical, key=lambda model, cases=cases: study.median(model, cases=cases))
            rest = ", ".join(
                f"{title(model)} {study.median(model, cases=cases):.1f} %" for model in study.physical if model != first
            )
            value = study.median(first, cases=cases)
            sentences.append(f"At optical depths {name}: {title(first)} {value:.1f} %, {rest}.")
    unscattered = [figures.shares_of(condition)["direct_unscattered"] for condition in study.conditions.values()]
    forward = [condition["shares"]["forward_scatter"] for condition in study.conditions.values()]
    sentences.append(
        f"In the median case {100 * np.median(unscattered):.0f} % of the picture's light is unscattered direct light "
        f"and {100 * np.median(forward):.0f} % forward scatter."
    )
    sentences += [
        f"Fitted to every truth, {title(model)} goes from {study.median(model):.1f} % to {study.median(fitted):.1f} %."
        for model, fitted in study.fitted.items()
    ]
    return " ".join(sentences)


def _within_table(study: Study) -> str:
    lines = [
        "| model | cases within 5 % | within 10 % | fitted: within 5 % | within 10 % |",
        "|---|---:|---:|---:|---:|",
    ]
    for model in study.physical:
        cells = [f"{study.share_within(model, limit):.0f} %" for limit in figures.LIMITS_PERCENT]
        fitted = study.fitted.get(model)
        cells += [f"{study.share_within(fitted, limit):.0f} %" if fitted else "-" for limit in figures.LIMITS_PERCENT]
        lines.append(f"| {title(model)} | {' | '.join(cells)} |")
    return "\n".join(lines)


def _variants_text(study: Study) -> str:
    """Return what three bands and the printed equations do to the models."""
    sentences = []
    for model in study.models:
        for suffix, words in _SUFFIXES.items():
            base = model.removesuffix(suffix)
            if model != base and base in study.models:
                sentences.append(
                    f"{title(base)} {words}: {study.median(model):.1f} % instead of {study.median(base):.1f} %."
                )
    return f"Other forms, median image error. {' '.join(sentences)}" if sentences else ""
