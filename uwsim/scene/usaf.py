"""The USAF-1951 resolving power chart.

Element e of group g has 2^(g + (e - 1)/6) line pairs per mm; its bars are one half period wide and 2.5 periods
long, three upright and three lying. Source: MIL-STD-150A.
"""

import functools
import math
from dataclasses import dataclass

import numpy as np

TEXTURE_LIMIT = 4096  # texels across a chart
_LEAST_TEXELS = 2.0  # per finest bar


@dataclass(frozen=True)
class Element:
    """One element: its place (left, top) [mm] from the chart's top left corner and its bar width [mm]."""

    group: int
    element: int
    left_mm: float
    top_mm: float
    bar_mm: float

    @property
    def line_pairs_per_mm(self) -> float:
        return 0.5 / self.bar_mm

    @property
    def bars_mm(self) -> list[tuple[float, float, float, float]]:
        """Left, top, right, bottom of the six bars: three lying bars, then three upright ones to their right."""
        w, x, y = self.bar_mm, self.left_mm, self.top_mm
        lying = [(x, y + 2 * k * w, x + 5 * w, y + (2 * k + 1) * w) for k in range(3)]
        upright = [(x + (7 + 2 * k) * w, y, x + (8 + 2 * k) * w, y + 5 * w) for k in range(3)]
        return lying + upright


@dataclass(frozen=True)
class Layout:
    width_mm: float
    height_mm: float
    elements: tuple[Element, ...]

    @property
    def finest(self) -> Element:
        return min(self.elements, key=lambda element: element.bar_mm)


def bar_width_mm(*, group: int, element: int) -> float:
    """Return the width of one bar, half a period. [mm]"""
    return 0.5 / 2 ** (group + (element - 1) / 6)


def layout(*, first_group: int, last_group: int, width_mm: float) -> Layout:
    """Return a chart with one column of six elements per group.

    Raises ValueError if the groups do not fit into `width_mm`.
    """
    if last_group < first_group:
        raise ValueError(f"last_group: got {last_group}, allowed: at least first_group = {first_group}")
    margin = 4 * bar_width_mm(group=first_group, element=1)
    elements, left, height = [], margin, 0.0
    for group in range(first_group, last_group + 1):
        top = margin
        for element in range(1, 7):
            bar = bar_width_mm(group=group, element=element)
            elements.append(Element(group, element, left, top, bar))
            top += 8 * bar
        height = max(height, top)
        # 12 bars of the element, then room for its label and the gap to the next group
        left += 20 * bar_width_mm(group=group, element=1)
    needed = left
    if needed > width_mm:
        groups = f"groups {first_group} to {last_group}"
        raise ValueError(f"width_m: got {width_mm / 1e3:g}, needed for {groups}: {needed / 1e3:.3g} or more")
    finest = bar_width_mm(group=last_group, element=6)
    if finest * TEXTURE_LIMIT < _LEAST_TEXELS * width_mm:
        raise ValueError(
            f"last_group: {last_group} on a chart of {width_mm / 1e3:g} m has bars of {finest:.3g} mm, allowed: "
            f"{_LEAST_TEXELS * width_mm / TEXTURE_LIMIT:.3g} mm or more (the texture has {TEXTURE_LIMIT} texels); "
            "use a smaller chart"
        )
    shift = (width_mm - needed) / 2
    moved = tuple(Element(e.group, e.element, e.left_mm + shift, e.top_mm, e.bar_mm) for e in elements)
    return Layout(width_mm=width_mm, height_mm=height, elements=moved)


@functools.lru_cache(maxsize=4)
def draw(chart: Layout, *, texels_per_finest_bar: int = 4, limit: int = TEXTURE_LIMIT) -> np.ndarray:
    """Return the coverage of the chart, (rows, columns), 0 dark bars and labels, 1 bright ground.

    Each texel holds the exact covered share. The texture has `texels_per_finest_bar` texels per finest bar, at most
    `limit` columns.
    """
    columns = min(limit, math.ceil(chart.width_mm / chart.finest.bar_mm * texels_per_finest_bar))
    scale = columns / chart.width_mm
    rows = round(chart.height_mm * scale)
    dark = np.zeros((rows, columns))
    for element in chart.elements:
        for left, top, right, bottom in element.bars_mm:
            (first_row, down), (first_column, across) = _covered(top, bottom, scale), _covered(left, right, scale)
            region = dark[first_row : first_row + len(down), first_column : first_column + len(across)]
            region += down[:, None] * across[None, :]
    return 1.0 - np.clip(np.maximum(dark, _labels(chart, dark.shape, scale)), 0, 1)


def _covered(start_mm: float, stop_mm: float, scale: float) -> tuple[int, np.ndarray]:
    """Return the first texel that an interval touches, and the share of each texel from there that it covers."""
    start, stop = start_mm * scale, stop_mm * scale
    first = math.floor(start)
    edges = np.arange(first, math.ceil(stop))
    return first, np.minimum(stop, edges + 1) - np.maximum(start, edges)


def _labels(chart: Layout, shape: tuple[int, int], scale: float) -> np.ndarray:
    """Print each element's number to its right, and each group's number above its first element; 1 is dark."""
    import cv2

    ink = np.zeros(shape, np.uint8)

    def put(text, left_mm, baseline_mm, height_mm):
        size = height_mm * scale / 22  # Hershey capitals are 22 units high
        origin = (round(left_mm * scale), round(baseline_mm * scale))
        cv2.putText(ink, text, origin, cv2.FONT_HERSHEY_SIMPLEX, size, 255, max(1, round(2 * size)), cv2.LINE_AA)

    for element in chart.elements:
        w = element.bar_mm
        put(str(element.element), element.left_mm + 13.5 * w, element.top_mm + 4 * w, 3 * w)
        if element.element == 1:
            put(str(element.group), element.left_mm + 4 * w, element.top_mm - w, 2 * w)
    return ink / 255.0
