"""The dissertation's chart experiment: its tables 2.1 and 2.2 and figures 2.10-2.12, with the numbers found here.

Source: dissertation, chapter two, "Underwater Imaging Model Simulation Experiments". MSE there is of pictures from 0 to
1, cut off after two digits: PSNR 18.75 goes with MSE 0.0133. Its turbidity is told in words only; here c is 1 /m and
3 /m at 550 nm.
"""

from pathlib import Path

import numpy as np

from uwsim.bench.canvas import new_figure, save
from uwsim.bench.validity import pictures
from uwsim.bench.validity.figures import shares_of
from uwsim.bench.validity.study import Study
from uwsim.dataset.store import Dataset
from uwsim.metrics.image import DATA_RANGE

NAME = "validity_chart"
ROWS = {
    "multistage": "Ours, new model", "multistage_without_forward": "Ours, without forward",
    "jaffe_mcglamery": "JM, original", "jaffe_mcglamery_without_forward": "JM, without forward",
}  # fmt: skip
# (MSE, PSNR [dB]) as printed, in the order of ROWS
PRINTED = {
    "moderate": ("Table 2.1", ((0.01, 18.75), (0.01, 18.67), (0.07, 11.16), (0.03, 15.11))),
    "high": ("Table 2.2", ((0.03, 13.98), (0.04, 13.88), (0.05, 12.80), (0.04, 13.50))),
}


def turbid_cases(study: Study) -> dict[str, str]:
    """Return {"moderate": case, "high": case}: the two of most attenuation."""
    ordered = sorted(study.cases, key=lambda case: study.conditions[case]["attenuation_per_m"])
    if len(ordered) < 2:
        raise ValueError(f"{NAME}: {len(ordered)} cases, allowed: two or more turbidities")
    return {"moderate": ordered[-2], "high": ordered[-1]}


def printed_form(model: str) -> str:
    """Return the name of the same model with the equations as printed."""
    name, _, rest = model.partition("_without")
    return f"{name}_as_printed" + (f"_without{rest}" if rest else "")


def unit_mse(study: Study, case: str, model: str) -> float:
    """Return the mean squared error of pictures from 0 to 1."""
    return study.value(case, model, "mse") / DATA_RANGE**2


def write_figures(study: Study, dataset: Dataset, form: pictures.Form, folder: Path) -> None:
    """Write figures 2.10 to 2.12 into a folder."""
    cases = turbid_cases(study)
    _bars(study, cases, folder / "figure_2_10_mse.png", "MSE (pictures from 0 to 1)", 0, unit_mse)
    _bars(
        study, cases, folder / "figure_2_11_psnr.png", "PSNR [dB]", 1,
        lambda study, case, model: study.value(case, model, "psnr"),
    )  # fmt: skip
    pictures.gallery(study, dataset, form, folder / "figure_2_12.png", cases=list(cases.values()), models=list(ROWS))
    pictures.contrast_transfer(
        dataset, form, study, folder / "chart_contrast.png", cases=list(cases.values()),
        models=["multistage", "multistage_without_forward", "jaffe_mcglamery"],
    )  # fmt: skip


def _bars(study: Study, cases: dict[str, str], path: Path, label: str, column: int, value) -> None:
    figure, (panels,) = new_figure(1, len(cases), width=5, height=3.6, sharey=True)
    places = np.arange(len(ROWS))
    for panel, (turbidity, case) in zip(panels, cases.items(), strict=True):
        series = {
            "printed": [numbers[column] for numbers in PRINTED[turbidity][1]],
            "here, corrected equations": [value(study, case, model) for model in ROWS],
            "here, equations as printed": [value(study, case, printed_form(model)) for model in ROWS],
        }
        for index, (name, heights) in enumerate(series.items()):
            panel.bar(places + 0.27 * (index - 1), heights, 0.25, label=name)
        panel.set_xticks(places, [name.replace(", ", ",\n") for name in ROWS.values()], fontsize=8)
        panel.set_title(f"{turbidity} turbidity, c R = {study.conditions[case]['optical_depth']:.2g}")
    panels[0].set_ylabel(label)
    panels[-1].legend(fontsize=8)
    save(figure, path)


def section(study: Study) -> str:
    """Return the experiment's part of the page."""
    cases = turbid_cases(study)
    parts = ["## The dissertation's experiment", _setting(study, cases), *_tables(study, cases), _verdict(study, cases)]
    parts += [
        "![MSE, printed and found](figure_2_10_mse.png)", "![PSNR, printed and found](figure_2_11_psnr.png)",
        "![Pictures of the truth and the models](figure_2_12.png)",
        "![Contrast that is left in the groups of the chart](chart_contrast.png)",
    ]  # fmt: skip
    return "\n\n".join(parts)


def _setting(study: Study, cases: dict[str, str]) -> str:
    oracle = study.result.provenance["definition"]["oracle"]
    limits = ", ".join(f"{study.value(case, oracle, 'psnr'):.1f} dB ({name})" for name, case in cases.items())
    waters = " and ".join(f"{study.conditions[case]['attenuation_per_m']:.2g} /m" for case in cases.values())
    return (
        f"A USAF chart 1 m away, 640 x 480 pixels, a lamp above the camera, c = {waters} at 550 nm for its words "
        "moderate and high. MSE of 8-bit pictures taken from 0 to 1. The truth's own Monte-Carlo noise limits any "
        f"model to a PSNR of {limits}."
    )


def _tables(study: Study, cases: dict[str, str]) -> list[str]:
    found = []
    for turbidity, case in cases.items():
        name, printed = PRINTED[turbidity]
        lines = [
            f"**{name}**, {turbidity} turbidity",
            "",
            "| model | MSE printed | MSE here | as printed | PSNR printed | here [dB] | as printed | image error [%] |",
            "|---|---:|---:|---:|---:|---:|---:|---:|",
        ]
        for (model, label), (mse, psnr) in zip(ROWS.items(), printed, strict=True):
            other = printed_form(model)
            cells = [
                label, f"{mse:.2f}", f"{unit_mse(study, case, model):.4f}", f"{unit_mse(study, case, other):.4f}",
                f"{psnr:.2f}", f"{study.value(case, model, 'psnr'):.2f}", f"{study.value(case, other, 'psnr'):.2f}",
                f"{study.value(case, model):.1f}",
            ]  # fmt: skip
            lines.append(f"| {' | '.join(cells)} |")
        found.append("\n".join(lines))
    return found


def _verdict(study: Study, cases: dict[str, str]) -> str:
    def psnr(case: str, model: str) -> float:
        return study.value(case, model, "psnr")

    better = {name: psnr(case, "multistage") - psnr(case, "jaffe_mcglamery") for name, case in cases.items()}
    lost = {name: psnr(case, "multistage") - psnr(case, "multistage_without_forward") for name, case in cases.items()}
    forward = {name: 100 * study.conditions[case]["shares"]["forward_scatter"] for name, case in cases.items()}
    explained = {}
    for name, case in cases.items():
        shares = shares_of(study.conditions[case])
        kept = shares["direct_unscattered"] + study.conditions[case]["shares"]["backscatter"]
        explained[name] = 100 * kept

    def veil(model: str) -> str:
        return _listed(
            {name: study.value(case, model, "backscatter_error") for name, case in cases.items()}, "{:.0f} %"
        )

    wins = "holds" if min(better.values()) > 0 else "does not hold"
    negligible = "holds" if max(map(abs, lost.values())) < 1 and max(forward.values()) < 5 else "does not hold"
    return (
        f"*Multistage better than Jaffe-McGlamery* {wins} here: PSNR higher by {_listed(better, '{:+.2f} dB')} "
        f"(printed {_printed_gain('moderate')} and {_printed_gain('high')}). The two share the light from bodies and "
        f"differ in the backscatter: multistage has light scattered once, an error of {veil('multistage')}; "
        f"Jaffe-McGlamery blurs its slabs on their way, {veil('jaffe_mcglamery')}. *Forward scattering negligible* "
        f"{negligible}: it is {_listed(forward, '{:.0f} %')} of the light of the truth; without it the multistage "
        f"model loses {_listed(lost, '{:.2f} dB')}. Unscattered direct light and backscatter together, all that the "
        f"simplified model has, are {_listed(explained, '{:.0f} %')} of the light."
    )


def _printed_gain(turbidity: str) -> str:
    numbers = PRINTED[turbidity][1]
    return f"{numbers[0][1] - numbers[2][1]:+.2f} dB"


def _listed(values: dict[str, float], form: str) -> str:
    return ", ".join(f"{form.format(value)} ({name})" for name, value in values.items())
