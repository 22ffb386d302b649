"""Figures of the validity page that show pictures: error maps, contrast transfer, the chart experiment."""

import functools
from collections.abc import Callable
from pathlib import Path

import numpy as np

from uwsim.bench.canvas import new_figure, save
from uwsim.bench.definition import Definition
from uwsim.bench.validity import grain, task
from uwsim.bench.validity.study import Study, title
from uwsim.bench.validity.truth import Truth
from uwsim.dataset.store import Dataset

Form = Callable[[str, str], np.ndarray]
"""Model and case -> its picture (H, W, 3) in radiance."""
_MAP_PX, _MAP_PERCENT = 2, 50.0


def former(dataset: Dataset, definition: Definition) -> Form:
    """Return what makes the pictures of a benchmark's models; each is made once."""
    from uwsim.bench.run import load

    @functools.cache
    def case(name: str):
        return task.case(dataset, name)

    @functools.cache
    def form(model: str, name: str) -> np.ndarray:
        found = load(task.TASK, model, definition.variants)
        return sum(task.formed(found.module, found.name, found.given, case(name))[0].values())

    return form


def error_maps(study: Study, dataset: Dataset, form: Form, path: Path, *, cases: list[str], models: list[str]) -> None:
    """Draw the truth and the models' pictures of some cases, and below them where they differ, in blocks of pixels."""
    figure, panels = new_figure(2 * len(cases), len(models) + 1, width=2.2, height=1.8)
    for index, case in enumerate(cases):
        truth = Truth(dataset.frame(case))
        upper, lower = panels[2 * index], panels[2 * index + 1]
        condition = study.conditions[case]
        _show(upper[0], truth.picture(truth.radiance), f"truth, c R = {condition['optical_depth']:.2g}")
        lower[0].axis("off")
        true = grain.means(truth.radiance, size_px=_MAP_PX).sum(axis=-1)
        for column, model in enumerate(models, start=1):
            light = form(model, case)
            _show(upper[column], truth.picture(light), title(model))
            found = grain.means(light, size_px=_MAP_PX).sum(axis=-1)
            difference = 100 * (found - true) / np.sqrt(np.mean(true**2))
            image = lower[column].imshow(difference, cmap="RdBu_r", vmin=-_MAP_PERCENT, vmax=_MAP_PERCENT)
            lower[column].set_title(f"{study.value(case, model):.1f} %", fontsize=8)
            lower[column].axis("off")
    figure.colorbar(image, ax=panels[1::2].ravel().tolist(), label="model - truth [% of the picture]", shrink=0.6)
    save(figure, path)


def contrast_transfer(dataset: Dataset, form: Form, study: Study, path: Path, *, cases: list[str], models: list[str]):
    """Draw the contrast that is left in the groups of the chart: truth with its noise, and models."""
    figure, (panels,) = new_figure(1, len(cases), width=4, height=3.6)
    for panel, case in zip(panels, cases, strict=True):
        truth = Truth(dataset.frame(case))
        known = truth.transfer(truth.radiance, noisy=True)
        pairs = 2.0 ** (np.array(truth.chart_groups) + 0.5)
        panel.errorbar(pairs, 100 * known.value, 200 * known.standard_error, fmt="ko", capsize=3, label="truth, 2 s.e.")
        for index, model in enumerate(models):
            found = truth.transfer(form(model, case))
            panel.plot(pairs, 100 * found.value, f"C{index}-", marker=".", label=title(model))
        condition = study.conditions[case]
        panel.set(
            xscale="log", xlabel="line pairs per mm (middle of a group)", ylim=(0, None),
            title=f"c R = {condition['optical_depth']:.2g}, albedo {condition['single_scattering_albedo']:.2g}",
        )  # fmt: skip
        panel.set_xticks(pairs, [f"{pair:.3g}" for pair in pairs])
        panel.minorticks_off()
    panels[0].set_ylabel("contrast, of that without water [%]")
    panels[-1].legend(fontsize=7)
    save(figure, path)


def gallery(study: Study, dataset: Dataset, form: Form, path: Path, *, cases: list[str], models: list[str]) -> None:
    """Draw one row per case: the truth, and every model's picture with its PSNR."""
    figure, panels = new_figure(len(cases), len(models) + 1, width=2.6, height=2.2)
    for row, case in zip(panels, cases, strict=True):
        truth = Truth(dataset.frame(case))
        _show(row[0], truth.picture(truth.radiance), f"truth, c R = {study.conditions[case]['optical_depth']:.2g}")
        for panel, model in zip(row[1:], models, strict=True):
            text = f"{title(model)}\n{study.value(case, model, 'psnr'):.1f} dB"
            _show(panel, truth.picture(form(model, case)), text)
    save(figure, path)


def _show(panel, picture: np.ndarray, text: str) -> None:
    panel.imshow(picture)
    panel.set_title(text, fontsize=8)
    panel.axis("off")
