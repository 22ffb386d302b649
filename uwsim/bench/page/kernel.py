"""The path of a point during the exposure, true and estimated, as a drawing in pixels."""

import math

from uwsim.bench.page.markup import escape
from uwsim.dataset.info import Blur

ASPECT = 0.75  # of height to width, as most pictures


Vector = tuple[float, float]


def kernel_drawing(true: Blur, estimates: dict[str, Vector], colours: dict[str, str]) -> str:
    """Return the drawing as SVG: the true kernel as a wide band, the estimates (length, angle) as lines.

    Estimates that are no numbers are left out.
    """
    drawn = {name: pair for name, pair in estimates.items() if all(map(math.isfinite, pair))}
    ends = [_end(true.length_px, true.angle_deg), *(_end(*pair) for pair in drawn.values())]
    half = max([2.0, *(1.25 * max(abs(x), abs(y) / ASPECT) for x, y in ends)])
    unit = half / 60
    lines = [_grid(half, _step(half), unit)]
    lines.append(_segment(true.length_px, true.angle_deg, "currentColor", 7 * unit, "stroke-opacity:.28"))
    for name, pair in sorted(drawn.items(), key=lambda item: -item[1][0]):
        lines.append(_segment(*pair, colours[name], (5 if pair[0] < unit else 1.8) * unit, ""))
    x, y = half - 2 * unit, ASPECT * half - 2 * unit
    text = f'<text x="{x:.4g}" y="{y:.4g}" text-anchor="end" font-size="{6 * unit:.4g}">'
    lines.append(f"{text}grid {_step(half):g} px</text>")
    alt = escape(f"True kernel {true.length_px:.3g} px at {true.angle_deg:.3g} degrees, and the estimates")
    box = f"{-half:.5g} {-ASPECT * half:.5g} {2 * half:.5g} {2 * ASPECT * half:.5g}"
    return f'<svg class="kernel" viewBox="{box}" role="img" aria-label="{alt}">{"".join(lines)}</svg>'


def _step(half: float) -> float:
    """Return the pitch of the grid: 1, 2 or 5 times a power of ten, at most ten lines to each side."""
    least = max(1.0, half / 10)
    power = 10.0 ** math.floor(math.log10(least))
    return next(factor * power for factor in (1, 2, 5, 10) if factor * power >= least)


def _grid(half: float, step: float, unit: float) -> str:
    count = math.floor(half / step)
    paths = (
        f"M{k * step:g} {-half:.5g}V{half:.5g}M{-half:.5g} {k * step:g}H{half:.5g}" for k in range(-count, count + 1)
    )
    return f'<path class="rule" d="{"".join(paths)}" stroke-width="{unit / 2:.4g}"/>'


def _end(length_px: float, angle_deg: float) -> tuple[float, float]:
    """Return half of the displacement, x right and y down."""
    angle = math.radians(angle_deg)
    return length_px / 2 * math.cos(angle), -length_px / 2 * math.sin(angle)


def _segment(length_px: float, angle_deg: float, colour: str, width: float, more: str) -> str:
    x, y = _end(length_px, angle_deg)
    style = f"stroke:{colour};stroke-width:{width:.4g};stroke-linecap:round;{more}"
    return f'<path d="M{-x:.4g} {-y:.4g}L{x:.4g} {y:.4g}" style="{style}"/>'
