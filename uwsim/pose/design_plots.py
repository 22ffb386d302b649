"""Picture of a layout's expected errors. Matplotlib is imported where it draws."""

from typing import BinaryIO

import numpy as np

from uwsim.pose.design import Curves, Sweep
from uwsim.pose.design_trials import Trials

_AXES = {
    "distance_m": "distance of the target [m]",
    "off_axis_m": "way off the optical axis [m]",
    "tilt_deg": "angle of the target's z to the axis [deg]",
}
_ROTATION = (
    ("rotation_bound_deg", "k-", "bound, all points"),
    ("rotation_plane_corrected_deg", "C2--", "plane, 5.11-5.13 corrected"),
    ("rotation_plane_printed_deg", "C1-.", "plane, 5.11-5.13 as printed"),
    ("rotation_segments_deg", "C0--", "segments, 5.29 corrected"),
    ("rotation_segments_printed_deg", "C3:", "segments, 5.29 as printed"),
)
_TRANSLATION = (
    ("translation_bound_percent", "k-", "bound, all points"),
    ("translation_segments_percent", "C0--", "segments, 5.28 corrected, of the centroid"),
    ("translation_segments_printed_percent", "C3:", "segments, 5.28 as printed, of the centroid"),
)
# errors beyond these say no more than that there is no pose
_MOST = 180.0


def plot_design(
    title: str, found: list[tuple[Sweep, Curves, Trials | None]], file: BinaryIO, *, left_out: dict[str, str]
) -> None:
    """Draw rotation and translation errors over each sweep, and with trials the share of poses elsewhere, as PNG.

    `left_out`: names of curves that the legend says to be left out, and why.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    rows = 3 if any(trials is not None for *_, trials in found) else 2
    heights = [3.2, 3.2, 1.6][:rows]
    figure = Figure(figsize=(13, sum(heights) + 1), layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplots(rows, len(found), sharex="col", sharey="row", height_ratios=heights, squeeze=False)
    for column, (sweep, curves, trials) in enumerate(found):
        _draw(panels[0, column], sweep, curves, _ROTATION, trials and trials.rotation_deg, trials)
        _draw(panels[1, column], sweep, curves, _TRANSLATION, trials and trials.translation_percent, trials)
        if trials is not None:
            panels[2, column].plot(trials.values, trials.elsewhere_percent, "ko-", markersize=4, linewidth=0.8)
            panels[2, column].set(ylim=(-3, 103))
        if sweep.quantity == "distance_m":
            panels[0, column].set_xscale("log")
            _plain_ticks(panels[-1, column].xaxis)
        panels[-1, column].set_xlabel(_AXES[sweep.quantity])
    for row, label in zip(
        panels, ("rotation error [deg]", "translation error [%]", "off by > 5 bounds [%]"), strict=False
    ):
        row[0].set_ylabel(label)
    for name, style, label in _ROTATION + _TRANSLATION:
        if name in left_out:
            row = panels[0 if name.startswith("rotation") else 1]
            row[-1].plot([], [], style, alpha=0.4, label=f"{label}:\nleft out, {left_out[name]}")
    for panel in panels.flat:
        panel.grid(alpha=0.3)
    for row in panels[:2]:
        _plain_ticks(row[0].yaxis)
        row[-1].legend(fontsize=8, loc="center left", bbox_to_anchor=(1.0, 0.5))
    # a file's name is no formula, whatever $ it has
    figure.suptitle(title, fontsize=11, parse_math=False)
    # no date and no version in the file: the same picture has the same bytes
    figure.savefig(file, dpi=110, format="png", metadata={"Software": None})


def _draw(
    panel, sweep: Sweep, curves: Curves, lines: tuple, measured: np.ndarray | None, trials: Trials | None
) -> None:
    for name, style, label in lines:
        values = getattr(curves, name)
        good = np.isfinite(values) & (values > 0) & (values < _MOST)
        if good.any():
            panel.semilogy(sweep.values, np.where(good, values, np.nan), style, label=label)
    if trials is not None:
        panel.semilogy(
            trials.values, measured, "ko", markersize=4, fillstyle="none", label="solver `best`, within 5 bounds"
        )


def _plain_ticks(axis) -> None:
    """Label a logarithmic axis at 1, 2 and 5 of each decade, in plain numbers."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())
