"""Scores per case against the attenuation on the way, as inline SVG that takes the colours of the page."""

import io
import re

import numpy as np

from uwsim.bench.page.markup import escape, figure, grid, paragraph
from uwsim.bench.records import Result, column_title, role, table
from uwsim.bench.task import frame_of_case
from uwsim.dataset.frame import Frame
from uwsim.dataset.store import Dataset

GREEN = 1
LOGARITHMIC = {"rotation_error_deg", "translation_error_percent"}
LOG_FLOOR = 1e-3
MARKERS = ("o", "s", "^", "D", "v", "P")
_SHAPES = {
    "o": '<circle cx="8" cy="4" r="3.4"/>',
    "s": '<rect x="5" y="1" width="6" height="6"/>',
    "^": '<path d="M8 .4 11.6 7.4H4.4z"/>',
    "D": '<path d="M8 0 12 4 8 8 4 4z"/>',
    "v": '<path d="M8 7.6 11.6 .6H4.4z"/>',
    "P": '<path d="M6.6 0h2.8v2.6H12v2.8H9.4V8H6.6V5.4H4V2.6h2.6z"/>',
}
# colours that stand for style sheet variables until the SVG is part of the page
_PLACEHOLDERS = {f"#0a0b{index:02x}": f"var(--c{index})" for index in range(8)}
_INK, _LINE = "#0a0c01", "#0a0c02"
_PLACEHOLDERS |= {_INK: "var(--soft)", _LINE: "var(--line)"}


def styles(result: Result) -> dict[str, tuple[int, str]]:
    """Return (colour number, marker) per algorithm: grey for do-nothing, ink for the oracle."""
    chosen, free = {}, 0
    for row in table(result)[1]:
        name = row[0].algorithm
        kind = role(result, name)
        if kind:
            chosen[name] = (0, "o") if kind == "do-nothing" else (7, "D")
        else:
            chosen[name] = (1 + free % 6, MARKERS[(1 + free) % len(MARKERS)])
            free += 1
    return chosen


def swatch(style: tuple[int, str]) -> str:
    """Return the key of an algorithm in a legend."""
    colour, marker = style
    return (
        f'<svg viewBox="0 0 16 8" aria-hidden="true" style="fill:var(--c{colour});stroke:var(--c{colour})">'
        f'<path d="M0 4H16" fill="none" stroke-width="1"/>{_SHAPES[marker]}</svg>'
    )


def legend(style_of: dict[str, tuple[int, str]]) -> str:
    items = "".join(f"<li>{swatch(style)}{escape(name)}</li>" for name, style in style_of.items())
    return f'<ul class="keys legend">{items}</ul>'


def optical_thickness(frame: Frame) -> float:
    """Return attenuation x range in the green band, the median of the pixels that see a body; NaN if none."""
    range_m = frame.buffer("range")
    seen = range_m[np.isfinite(range_m)]
    return float(np.median(seen)) * frame.info.water.bands.attenuation_per_m[GREEN] if seen.size else float("nan")


def score_plots(result: Result, dataset: Dataset, metrics: tuple[str, ...]) -> str:
    """Return one plot per metric with a common legend; "" where no case has a score."""
    places = _places(result, dataset)
    style_of = styles(result)
    figures = []
    for metric in metrics:
        curves = _curves(result, metric, places)
        if curves:
            title = next(column_title(record) for record in result.records if record.metric == metric)
            name = f"{result.benchmark}-{metric}"
            alt = f"{title} of each case against the optical thickness, one colour per algorithm"
            logarithmic = metric in LOGARITHMIC
            figures.append(figure(_svg(curves, style_of, title, name, alt, logarithmic=logarithmic), ""))
    if not figures:
        return ""
    words = "Each mark is a case, each line joins the medians of the waters."
    words += f" Errors under {LOG_FLOOR:g} stand at the lower edge." if LOGARITHMIC & set(metrics) else ""
    return legend(style_of) + grid(figures, "plots") + paragraph(words, "note")


def _places(result: Result, dataset: Dataset) -> dict[str, tuple[float, tuple]]:
    """Return {case: (optical thickness, water)} of the cases that lie in the dataset and see a body."""
    places, by_frame = {}, {}
    for case in {record.case for record in result.records}:
        name = frame_of_case(case)
        if name not in by_frame and name in dataset.frame_names:
            frame = dataset.frame(name)
            by_frame[name] = optical_thickness(frame), frame.info.water.bands.attenuation_per_m
        if name in by_frame and np.isfinite(by_frame[name][0]):
            places[case] = by_frame[name]
    return places


def _curves(result: Result, metric: str, places: dict) -> dict[str, list]:
    """Return {algorithm: [(optical thickness, score, water), ...]} of one metric."""
    curves: dict[str, list] = {}
    for record in result.records:
        if record.metric == metric and record.case in places and record.value is not None:
            thickness, water = places[record.case]
            curves.setdefault(record.algorithm, []).append((thickness, record.value, water))
    return curves


def _svg(curves: dict, style_of: dict, title: str, name: str, alt: str, *, logarithmic: bool) -> str:
    from matplotlib import rc_context
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure

    with rc_context({"svg.fonttype": "none", "svg.hashsalt": name, "font.size": 9}):
        drawing = Figure(figsize=(4.6, 2.9), layout="constrained")
        FigureCanvasSVG(drawing)
        axes = drawing.add_subplot()
        for algorithm, points in curves.items():
            _draw(axes, points, *style_of[algorithm], floor=LOG_FLOOR if logarithmic else None)
        if logarithmic:
            axes.set_yscale("log")
            axes.set_ylim(bottom=0.8 * LOG_FLOOR)
        elif "↓" in title:
            axes.set_ylim(bottom=0)
        axes.set_xlim(0, 1.06 * max(x for points in curves.values() for x, _, _ in points))
        axes.set_xlabel("optical thickness c r, one way (green band)", color=_INK)
        axes.set_ylabel(title.rstrip("↑↓ "), color=_INK)
        _dress(axes)
        target = io.StringIO()
        drawing.savefig(target, format="svg", transparent=True, metadata={"Date": None, "Creator": None})
    return _inline(target.getvalue(), name, alt)


def _draw(axes, points: list, colour: int, marker: str, *, floor: float | None) -> None:
    """Draw the cases as marks and a line through the median of each water."""
    ink = f"#0a0b{colour:02x}"
    waters: dict[tuple, list] = {}
    for x, y, water in points:
        waters.setdefault(water, []).append((x, y if floor is None else max(y, floor)))
    x, y = np.array([point for group in waters.values() for point in group]).T
    axes.plot(x, y, linestyle="none", marker=marker, color=ink, markersize=4.5, clip_on=False)
    medians = sorted(tuple(np.median(group, axis=0)) for group in waters.values())
    if len(medians) > 1:
        style = ":" if colour in (0, 7) else "-"
        axes.plot(*np.array(medians).T, linestyle=style, linewidth=1, color=ink, clip_on=False)


def _dress(axes) -> None:
    axes.tick_params(which="both", colors=_INK, labelcolor=_INK, length=3)
    axes.tick_params(which="minor", length=0)
    axes.grid(axis="y", color=_LINE, linewidth=0.8)
    axes.set_axisbelow(True)
    for side in ("top", "right", "left"):
        axes.spines[side].set_visible(False)
    axes.spines["bottom"].set_color(_INK)


def _inline(svg: str, name: str, alt: str) -> str:
    """Return the SVG as markup: ids of its own, page fonts and colours, no metadata."""
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r"<metadata>.*?</metadata>", "", svg, flags=re.DOTALL)
    svg = re.sub(r' xmlns(:\w+)?="[^"]*"', "", svg)
    svg = re.sub(r'\bid="', f'id="{name}-', svg)
    svg = svg.replace("url(#", f"url(#{name}-").replace('xlink:href="#', f'href="#{name}-')
    svg = re.sub(r"font: ([\d.]+)px [^;\"]*", r"font: \1px var(--sans)", svg)
    for placeholder, colour in _PLACEHOLDERS.items():
        svg = svg.replace(placeholder, colour)
    attributes = f'class="plot" role="img" aria-label="{escape(alt)}"'
    return re.sub(r'width="[\d.]+pt" height="[\d.]+pt"', attributes, svg, count=1)
