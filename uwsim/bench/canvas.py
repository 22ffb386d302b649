"""Figures of the pages of benchmarks. Matplotlib is imported where it draws."""

from pathlib import Path


def new_figure(rows: int, columns: int, *, width: float, height: float, **keywords):
    """Return (figure, axes (rows, columns)); width and height of one panel [inches]."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(columns * width, rows * height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure, figure.subplots(rows, columns, squeeze=False, **keywords)


def save(figure, path: Path, *, dpi: int = 110) -> None:
    """Write a PNG without date and version: the same picture has the same bytes."""
    figure.savefig(path, dpi=dpi, metadata={"Software": None})
