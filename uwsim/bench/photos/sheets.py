"""Contact sheets: one row per picture, one column per method."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from uwsim.bench.photos.tags import Found
from uwsim.images import write_png

CELL_PX, HEAD_PX, GAP_PX, ROWS = 240, 26, 4, 4
_PAPER, _INK, _FRAME = (255, 255, 255), (20, 20, 20), (255, 40, 40)


@dataclass
class Sheets:
    """Rows of shrunk pictures, as they come; `columns`: what stands above them."""

    columns: list[str]
    rows: list[tuple[str, list[np.ndarray | None]]] = field(default_factory=list)

    def add(self, label: str, pictures: list[np.ndarray | None]) -> None:
        """Take in a row of pictures (H, W, 3) uint8, None for an empty cell."""
        self.rows.append((label, [None if picture is None else _shrunk(picture) for picture in pictures]))

    def write(self, folder: Path, stem: str) -> list[Path]:
        """Write the rows to `stem`_01.png and so on in a folder; return the files."""
        written = []
        for first in range(0, len(self.rows), ROWS):
            path = folder / f"{stem}_{first // ROWS + 1:02d}.png"
            write_png(path, self._sheet(self.rows[first : first + ROWS]))
            written.append(path)
        return written

    def _sheet(self, rows: list[tuple[str, list[np.ndarray | None]]]) -> np.ndarray:
        bands = [_band(self.columns)]
        for label, pictures in rows:
            height = max(picture.shape[0] for picture in pictures if picture is not None)
            bands += [_band([label, *[""] * (len(pictures) - 1)]), _line(pictures, height)]
        return np.concatenate(bands)


def with_tags(picture: np.ndarray, found: Found) -> np.ndarray:
    """Return a picture with the outlines of its verified tags and their ids."""
    import cv2

    drawn = picture.copy()
    for identity, corners in found.verified.items():
        outline = np.rint(corners).astype(np.int32)
        cv2.polylines(drawn, [outline], True, _FRAME, 3, cv2.LINE_AA)
        place = tuple(outline.max(axis=0).tolist())
        cv2.putText(drawn, str(identity), place, cv2.FONT_HERSHEY_SIMPLEX, 1.0, _FRAME, 2, cv2.LINE_AA)
    return drawn


def _shrunk(picture: np.ndarray) -> np.ndarray:
    import cv2

    height = max(1, round(picture.shape[0] * CELL_PX / picture.shape[1]))
    return cv2.resize(picture, (CELL_PX, height), interpolation=cv2.INTER_AREA)


def _band(texts: list[str]) -> np.ndarray:
    """Return a band of the sheet with one text per column."""
    import cv2

    band = np.full((HEAD_PX, len(texts) * (CELL_PX + GAP_PX), 3), _PAPER, np.uint8)
    for column, text in enumerate(texts):
        place = (column * (CELL_PX + GAP_PX) + 2, HEAD_PX - 8)
        cv2.putText(band, text, place, cv2.FONT_HERSHEY_SIMPLEX, 0.48, _INK, 1, cv2.LINE_AA)
    return band


def _line(pictures: list[np.ndarray | None], height: int) -> np.ndarray:
    line = np.full((height + GAP_PX, len(pictures) * (CELL_PX + GAP_PX), 3), _PAPER, np.uint8)
    for column, picture in enumerate(pictures):
        if picture is not None:
            left = column * (CELL_PX + GAP_PX)
            line[: picture.shape[0], left : left + CELL_PX] = picture
    return line
