"""Markers in the truth and in pictures: what the benchmarks of poses and of restorations share."""

from collections.abc import Iterable

import numpy as np

from uwsim.dataset.frame import Frame
from uwsim.dataset.info import FrameInfo, Marker
from uwsim.pose.detect import detect_markers, marker_covariances


def whole_markers(info: FrameInfo) -> list[Marker]:
    """Return the markers that are visible with all their corners."""
    return [marker for marker in info.markers if marker.corners_px and all(marker.visible)]


def found_markers(image: np.ndarray, markers: Iterable[Marker]) -> dict[tuple[str, int], np.ndarray]:
    """Return {(dictionary, id): corners (4, 2) [px]} of what is detected in an (H, W, 3) uint8 sRGB image.

    It is searched for the dictionaries of `markers`; ids that none of them has are there, too.
    """
    found = {}
    for dictionary in sorted({marker.dictionary for marker in markers}):
        for identity, corners in detect_markers(image, dictionary).items():
            found[dictionary, identity] = corners
    return found


def corner_covariances(
    image: np.ndarray, found: dict[tuple[str, int], np.ndarray]
) -> dict[tuple[str, int], np.ndarray]:
    """Return {(dictionary, id): covariances (4, 2, 2) [px^2]} of `found_markers`; NaN where an edge has no line."""
    covariances = {}
    for dictionary in sorted({dictionary for dictionary, _ in found}):
        of_this = {identity: corners for (other, identity), corners in found.items() if other == dictionary}
        for identity, one in marker_covariances(image, dictionary, of_this).items():
            covariances[dictionary, identity] = one
    return covariances


def camera_from_body(frame: Frame, name: str) -> np.ndarray:
    """Return the true pose of a body at mid-exposure, (4, 4) [m]."""
    body = next(body for body in frame.info.bodies if body.name == name)
    return np.linalg.inv(frame.world_from_camera) @ np.array(body.world_from_body)
