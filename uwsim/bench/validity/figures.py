"""Figures of the validity page that the scores alone make. Matplotlib is imported where it draws."""

import math
from pathlib import Path

import numpy as np

from uwsim.bench.canvas import new_figure, save
from uwsim.bench.validity.study import FITTED, Study, title

LIMITS_PERCENT = (5.0, 10.0)
_COLOURS = ("#2a9d5c", "#f2c14e", "#d1495b")  # within the first limit, the second, beyond
_HIDDEN, _NO_CASE = "#b3b7d9", "#eeeeee"
SHARES = {
    "direct_unscattered": ("direct, unscattered", "#1d3557"), "direct_scattered": ("direct, lit by scatter", "#457b9d"),
    "forward_scatter": ("forward scatter", "#e9c46a"), "backscatter_single": ("backscatter, once", "#e76f51"),
    "backscatter_multiple": ("backscatter, more often", "#9b2226"),
}  # fmt: skip


def shares_of(condition: dict) -> dict[str, float]:
    """Return the shares of the light of a case by SHARES; scattered direct light and orders are 0 where unknown."""
    found = condition["shares"]
    unscattered = found.get("direct_unscattered", found["direct"])
    single = found.get("backscatter_single", found["backscatter"])
    return {
        "direct_unscattered": unscattered, "direct_scattered": found["direct"] - unscattered,
        "forward_scatter": found["forward_scatter"], "backscatter_single": single,
        "backscatter_multiple": found["backscatter"] - single,
    }  # fmt: skip


def error_over_depth(study: Study, path: Path) -> None:
    """Draw the median image error of every model over optical depth, fitted dashed, with what noise hides."""
    figure, ((panel,),) = new_figure(1, 1, width=8, height=5)
    steps = study.steps("optical_depth")
    depths = [depth for depth, _ in steps]
    definition = study.result.provenance["definition"]
    for index, model in enumerate([definition["do_nothing"], *study.physical]):
        style = {"color": f"C{index}" if index else "grey", "marker": "o", "markersize": 4}
        panel.plot(depths, [study.median(model, cases=cases) for _, cases in steps], label=title(model), **style)
        if model in study.fitted:
            values = [study.median(model + FITTED, cases=cases) for _, cases in steps]
            panel.plot(depths, values, "--", label=title(model + FITTED), **style | {"marker": "s"})
    hidden = [np.median([study.conditions[case]["resolution_percent"] for case in cases]) for _, cases in steps]
    panel.fill_between(depths, 1e-3, hidden, color="0.9", label="hidden by the truth's noise")
    for limit in LIMITS_PERCENT:
        panel.axhline(limit, color="0.5", linewidth=0.8, linestyle=":")
        panel.annotate(f"{limit:g} %", (depths[0], limit), textcoords="offset points", xytext=(2, 2), fontsize=8)
    panel.set(
        xscale="log", yscale="log", ylim=(0.5, None), xlabel="optical depth c x range",
        ylabel="image error [%], median over cases",
    )  # fmt: skip
    panel.set_xticks(depths, [f"{depth:.2g}" for depth in depths])
    panel.minorticks_off()
    panel.legend(fontsize=7, ncols=2)
    save(figure, path)


def light_over_depth(study: Study, path: Path) -> None:
    """Draw what the light of the truth is made of, over optical depth, one panel per albedo."""
    albedos = study.steps("single_scattering_albedo")
    figure, (panels,) = new_figure(1, len(albedos), width=4, height=3.6, sharey=True)
    depths = study.steps("optical_depth")
    for panel, (albedo, of_albedo) in zip(panels, albedos, strict=True):
        steps = [(depth, [case for case in cases if case in set(of_albedo)]) for depth, cases in depths]
        steps = [(depth, cases) for depth, cases in steps if cases]
        bottom = np.zeros(len(steps))
        for name, (label, colour) in SHARES.items():
            means = [np.mean([shares_of(study.conditions[case])[name] for case in cases]) for _, cases in steps]
            height = 100 * np.array(means)
            panel.bar(range(len(steps)), height, bottom=bottom, color=colour, label=label)
            bottom += height
        panel.set(title=f"albedo {albedo:.2g}", xlabel="optical depth", ylim=(0, 100))
        panel.set_xticks(range(len(steps)), [f"{depth:.2g}" for depth, _ in steps])
    panels[0].set_ylabel("share of the light [%]")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=5, fontsize=8)
    save(figure, path)


def validity_map(study: Study, path: Path, *, models: list[str]) -> None:
    """Draw where each model's image error is surely within 5 % and 10 %: optical depth x lamp offset, per albedo.

    A cell has the worst case that falls into it. Where the noise of the truth leaves it open whether a limit is met,
    the cell says so, and what the error may be at most.
    """
    albedos, depths = study.steps("single_scattering_albedo"), study.steps("optical_depth")
    offsets = study.steps("lamp_offset_m")
    # at least the room of the legend and the labels
    width, height = max(0.55 * len(depths) + 1, 8 / len(albedos)), max(0.45 * len(offsets) + 0.6, 3.5 / len(models))
    figure, panels = new_figure(len(models), len(albedos), width=width, height=height, sharex=True, sharey=True)
    for panel, (albedo, _) in zip(panels[0], albedos, strict=True):
        panel.set_title(f"albedo {albedo:.2g}")
    for panel in panels[-1]:
        panel.set_xlabel("optical depth")
    for row, model in zip(panels, models, strict=True):
        for panel, (_, of_albedo) in zip(row, albedos, strict=True):
            for x, (_, of_depth) in enumerate(depths):
                for y, (_, of_offset) in enumerate(offsets):
                    _cell(panel, x, y, study, model, sorted(set(of_albedo) & set(of_depth) & set(of_offset)))
            panel.set(xlim=(-0.5, len(depths) - 0.5), ylim=(-0.5, len(offsets) - 0.5))
            panel.set_xticks(range(len(depths)), [f"{depth:.1g}" for depth, _ in depths])
            panel.set_yticks(range(len(offsets)), [f"{offset:.2g}" for offset, _ in offsets])
            panel.tick_params(length=0)
        row[0].set_ylabel(f"{title(model)}\nlamp offset [m]")
    _legend(figure)
    save(figure, path, dpi=150)


def _cell(panel, x: int, y: int, study: Study, model: str, cases: list[str]) -> None:
    from matplotlib.patches import Rectangle

    buried = any(study.conditions[case]["below_sensor_noise"] for case in cases)
    found = max((study.value(case, model) for case in cases), default=math.nan)
    seen = max((study.seen_error(case, model) for case in cases), default=math.nan)
    if math.isnan(seen):
        colour, text = _NO_CASE, ""
    else:
        hidden = _class(seen) > _class(found)
        colour = _HIDDEN if hidden else _COLOURS[_class(found)]
        text = ("\u2264" if hidden else "") + (f"{seen:.0f}" if seen >= 10 else f"{seen:.1f}")
    hatch = "////" if buried else None
    panel.add_patch(Rectangle((x - 0.5, y - 0.5), 1, 1, facecolor=colour, edgecolor="white", hatch=hatch))
    panel.text(x, y, text, ha="center", va="center", fontsize=8)


def _class(percent: float) -> int:
    """Return 0 within the first limit, 1 within the second, 2 beyond."""
    return sum(percent > limit for limit in LIMITS_PERCENT)


def _legend(figure) -> None:
    from matplotlib.patches import Patch

    first, second = LIMITS_PERCENT
    names = (f"image error within {first:g} %", f"within {second:g} %", f"more than {second:g} %")
    patches = [Patch(facecolor=colour, label=name) for colour, name in zip(_COLOURS, names, strict=True)]
    patches.append(Patch(facecolor=_HIDDEN, label="hidden by the truth's noise"))
    patches.append(Patch(facecolor=_NO_CASE, label="no case"))
    patches.append(Patch(facecolor="white", edgecolor="0.5", hatch="////", label="bodies below sensor noise"))
    figure.legend(handles=patches, loc="outside lower center", ncols=3, fontsize=8)
