"""Figures of the restoration page that the scores alone make."""

import math
from pathlib import Path

from uwsim.bench.canvas import new_figure, save
from uwsim.bench.restoration_page import no_reference
from uwsim.bench.restoration_page.study import MAIN, OURS, Study
from uwsim.bench.study import title


def gain_over_raw(study: Study, path: Path) -> None:
    """Draw what each of the main methods gains in PSNR over the picture as it is, by water."""
    _by_water(
        study, path, label="PSNR above the picture as it is [dB], mean",
        value=lambda method, water: study.gain(method, "psnr", water),
    )  # fmt: skip


def oracle_share(study: Study, path: Path, *, goals: dict[str, float]) -> None:
    """Draw the mean share of the oracle's gain of the main methods by water; goals: of which method how much."""
    _by_water(
        study, path, label="share of the oracle's gain, mean", goals=goals,
        value=lambda method, water: study.mean(method, "oracle_share", water),
    )  # fmt: skip


def _by_water(study: Study, path: Path, *, label: str, value, goals: dict[str, float] | None = None) -> None:
    figure, ((panel,),) = new_figure(1, 1, width=8, height=4.6)
    places = range(len(study.waters))
    panel.axhline(0, color="0.3", linewidth=1)
    for index, method in enumerate(method for method in MAIN if method in study.methods):
        heights = [value(method, water) for water in study.waters]
        if all(map(math.isnan, heights)):
            continue
        own = method in OURS
        style = {"color": f"C{index}", "linewidth": 2.4 if own else 1.2, "marker": "o" if own else "."}
        panel.plot(places, heights, label=title(method), **style)
        if method in (goals or {}):
            panel.axhline(goals[method], color=f"C{index}", linestyle=":", linewidth=1.2)
            text = f"goal of {title(method)}: {goals[method]:g}"
            panel.annotate(
                text, (1, goals[method]), xycoords=("axes fraction", "data"), textcoords="offset points",
                xytext=(-4, 3), ha="right", fontsize=8, color=f"C{index}",
            )  # fmt: skip
    panel.set_xticks(places, [title(water) for water in study.waters])
    panel.set(ylabel=label, xlim=(-0.3, len(study.waters) - 0.7))
    panel.grid(axis="y", color="0.9")
    figure.legend(*panel.get_legend_handles_labels(), loc="outside right upper", fontsize=8)
    save(figure, path)


def no_reference_against_truth(study: Study, path: Path, *, noise: dict[str, float]) -> None:
    """Draw each no-reference metric against PSNR: a point per method and water, and white noise."""
    metrics = [name for name in no_reference.METRICS if name in study.of_metric]
    figure, (panels,) = new_figure(1, len(metrics), width=4, height=4.6, sharey=True)
    for panel, metric in zip(panels, metrics, strict=True):
        for index, water in enumerate(study.waters):
            found = no_reference.points(study, metric, water)
            rank = no_reference.rank_correlation(study, metric, water)
            label = title(water) + ("" if math.isnan(rank) else f": {rank:+.2f}")
            _, x, y = zip(*found, strict=True) if found else ((), (), ())
            panel.plot(x, y, "o", color=f"C{index}", markersize=4, alpha=0.8, label=label)
            own = [point for point in found if point[0] in OURS]
            panel.plot([p[1] for p in own], [p[2] for p in own], "o", color=f"C{index}", markeredgecolor="k")
        label = f"white noise, {noise[metric]:.3g}"
        panel.plot(noise[metric], noise["psnr"], "*", color="k", markersize=13, label=label)
        panel.axvline(noise[metric], color="k", linestyle=":", linewidth=1)
        panel.set(xlabel=f"{title(metric)}, mean", title=title(metric))
        panel.legend(
            fontsize=8, title="rank correlation with PSNR", title_fontsize=8, ncols=2, loc="upper center",
            bbox_to_anchor=(0.5, -0.15),
        )  # fmt: skip
    panels[0].set_ylabel("PSNR to the truth [dB], mean")
    save(figure, path)
