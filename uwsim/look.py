"""How pages look: false colours for maps, colours for bodies, and the style sheet that all pages share."""

import colorsys
from pathlib import Path

import numpy as np

EMPTY = (128, 128, 128)
"""Where a map has no value."""


def style() -> str:
    """Return the style sheet of the pages, for light and dark screens."""
    return Path(__file__).with_name("look.css").read_text(encoding="utf-8")


def colour_map(positions: np.ndarray) -> np.ndarray:
    """Return the viridis colours, (..., 3) uint8, of positions in [0, 1]."""
    from matplotlib import colormaps

    return colormaps["viridis"](np.clip(positions, 0, 1), bytes=True)[..., :3]


def false_colour(values: np.ndarray, low: float, high: float) -> np.ndarray:
    """Return (H, W) values in colours from `low` to `high`, (H, W, 3) uint8; grey where not finite."""
    finite = np.isfinite(values)
    span = max(high - low, np.finfo(float).tiny)
    return np.where(finite[..., None], colour_map((np.where(finite, values, low) - low) / span), EMPTY).astype(np.uint8)


def limits(values: np.ndarray, *, from_zero: bool = False) -> tuple[float, float]:
    """Return the 1 % and 99 % level of the finite values: the ends of the colour bar."""
    finite = values[np.isfinite(values)]
    if finite.size == 0:
        return 0.0, 1.0
    low, high = np.percentile(finite, [1, 99])
    low = 0.0 if from_zero else float(low)
    return (low, float(high)) if high > low else (low, low + 1.0)


def normal_colours(normals: np.ndarray) -> np.ndarray:
    """Return unit normals (..., 3) as colours, uint8: x, y, z as red, green, blue from -1 to 1; none: grey."""
    return np.rint(255 * np.clip(0.5 + 0.5 * normals, 0, 1)).astype(np.uint8)


def instance_colours(count: int) -> np.ndarray:
    """Return `count` colours told apart by hue and lightness, (count, 3) uint8."""
    hues = (0.55 + 0.381966 * np.arange(count)) % 1
    colours = [colorsys.hls_to_rgb(hue, 0.45 + 0.2 * (index % 2), 0.5) for index, hue in enumerate(hues)]
    return np.rint(255 * np.array(colours).reshape(-1, 3)).astype(np.uint8)
