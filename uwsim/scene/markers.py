"""Drawing ArUco and AprilTag boards."""

import numpy as np


def dictionary_names() -> list[str]:
    """Return the marker dictionaries that OpenCV knows."""
    import cv2

    return sorted(name for name in dir(cv2.aruco) if name.startswith("DICT_"))


def check(dictionary: str, *, ids: range) -> None:
    """Raise ValueError unless the dictionary exists and holds all ids."""
    if dictionary not in dictionary_names():
        raise ValueError(f"dictionary: got {dictionary!r}, allowed: {', '.join(dictionary_names())}")
    count = len(_dictionary(dictionary).bytesList)
    if ids[-1] >= count:
        raise ValueError(f"dictionary {dictionary} has {count} markers, needed: ids up to {ids[-1]}")


def _dictionary(name: str):
    import cv2

    return cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, name))


def modules(dictionary: str, marker_id: int) -> np.ndarray:
    """Return one marker with its black border, one texel per module, 0 dark, 1 bright."""
    import cv2

    kind = _dictionary(dictionary)
    side = kind.markerSize + 2
    return cv2.aruco.generateImageMarker(kind, marker_id, side) / 255.0


def corners(*, rows: int, columns: int, marker_size_m: float, gap_m: float) -> np.ndarray:
    """Return marker corners (n, 4, 3) [m] in the frame of a board centred on the origin, x right, y up.

    Markers in reading order; corners top left, top right, bottom right, bottom left.
    """
    pitch = marker_size_m + gap_m
    centres = [
        ((column - (columns - 1) / 2) * pitch, ((rows - 1) / 2 - row) * pitch, 0.0)
        for row in range(rows)
        for column in range(columns)
    ]
    half = marker_size_m / 2
    offsets = np.array([[-half, half, 0], [half, half, 0], [half, -half, 0], [-half, -half, 0]])
    return np.array(centres)[:, None, :] + offsets[None, :, :]
