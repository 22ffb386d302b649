"""Errors of poses from pictures over the distance, by water."""

from pathlib import Path

import numpy as np

from uwsim.bench.canvas import new_figure, save
from uwsim.bench.pose_page.study import BEST, ERRORS, IGNORING, PRINTED, REFINED, TABLES, PictureStudy
from uwsim.bench.study import title

NAME = "distance.png"
_WORDS = ("mean rotation error [deg]", "mean translation error [%]")


def draw(study: PictureStudy, folder: Path) -> bool:
    """Write the figure; False where the result has no cases for it."""
    cases = study.cases(group=TABLES)
    if not cases:
        return False
    steps = study.steps("distance_mm", cases)
    figure, (panels,) = new_figure(1, 2, width=5.2, height=3.6)
    for panel, metric, words in zip(panels, ERRORS, _WORDS, strict=True):
        for method in study.shown(IGNORING, PRINTED, "opnp", BEST, REFINED):
            heights = [study.mean(method, metric, study.cases(group=TABLES, distance_mm=far)) for far in steps]
            line = "o-" if method == REFINED else ".--"
            panel.plot(steps, np.array(heights), line, label=title(method), linewidth=1.2, markersize=4)
        panel.set(xlabel="distance [mm]", ylabel=words, yscale="log")
        panel.grid(color="0.9")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=6, fontsize=7)
    save(figure, folder / NAME, dpi=90)
    return True
