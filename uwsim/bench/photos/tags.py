"""Tags of a known layout in a picture: which of them are found where the plane can have them."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from uwsim.bench.photos.layout import Layout
from uwsim.pose.detect import opencv_markers
from uwsim.pose.geometry import normalise
from uwsim.pose.solvers import opencv_ippe

TOLERANCE_PX = 4.0


@dataclass(frozen=True)
class Found:
    """Tags of one picture. `verified`: {id: corners (4, 2) [px]}; `rejected`: how many detections were not.

    `homography_error_px`, `pose_error_px`: root mean square distance of the verified corners from where the best
    homography of the plane and the best pose of the camera put them; NaN where there are none, or no intrinsics.
    """

    verified: dict[int, np.ndarray]
    rejected: int
    homography_error_px: float
    pose_error_px: float


def verified_tags(image: np.ndarray, layout: Layout) -> Found:
    """Return the tags of a picture (H, W, 3) uint8 that agree with a layout.

    A set of detections agrees if the homography of the plane that fits all its corners best leaves none of them by
    more than TOLERANCE_PX; each id counts once, and two tags are the least (one is fitted by some homography wherever
    it lies). The largest such set counts, grown from each pair of detections by the one that fits next best. That is
    the set that RANSAC looks for, without its luck: from four random corners, mostly of one or two tags, it often
    misses the tags far from them.

    Source: Fischler and Bolles, Communications of the ACM 24(6), 1981 (consensus); homography:
    `cv2.findHomography`, least squares.
    """
    corners_m = layout.corners_m()
    detections = detected(image, layout.family)
    usable = [(identity, corners) for identity, corners in detections if identity in corners_m]
    plane = np.array([corners_m[identity] for identity, _ in usable]).reshape(-1, 4, 2)
    seen = np.array([corners for _, corners in usable]).reshape(-1, 4, 2)
    members = _largest_set([identity for identity, _ in usable], plane, seen)
    if not members:
        return Found({}, len(detections), np.nan, np.nan)
    plane, seen = plane[members], seen[members]
    distances = _distances(_homography(plane, seen), plane, seen)
    return Found(
        verified={usable[member][0]: usable[member][1] for member in members},
        rejected=len(detections) - len(members),
        homography_error_px=float(np.sqrt(np.mean(distances**2))),
        pose_error_px=_pose_error_px(plane, seen, layout.K()),
    )


def detected(image: np.ndarray, family: str) -> list[tuple[int, np.ndarray]]:
    """Return (id, corners (4, 2) [px, centres at integers]) of each detection; an id may come more than once.

    By OpenCV alone: `pose.detect_markers` refines along the edges, the better on rendered frames, but not on compressed
    video whose local contrast a method has raised (in the tag tank after CLAHE 1.6 px from the homography against
    0.9 px), and drops an id that a wrong detection shares with the right one: here the layout tells them apart.
    """
    import cv2

    return opencv_markers(cv2.cvtColor(np.ascontiguousarray(image), cv2.COLOR_RGB2GRAY), family)


def _largest_set(identities: Sequence[int], plane: np.ndarray, seen: np.ndarray) -> list[int]:
    """Return the indices of the largest set of detections that agree, [] if no two do."""
    largest: list[int] = []
    for pair in combinations(range(len(identities)), 2):
        grown = list(pair)
        if set(grown) <= set(largest) or not _agree(grown, identities, plane, seen):
            continue
        while (larger := _grown(grown, identities, plane, seen)) is not None:
            grown = larger
        if len(grown) > len(largest):
            largest = grown
    return sorted(largest)


def _grown(members: list[int], identities: Sequence[int], plane: np.ndarray, seen: np.ndarray) -> list[int] | None:
    """Return the set with the best fitting further detection that agrees, None if there is none."""
    distances = _distances(_homography(plane[members], seen[members]), plane, seen).max(axis=1)
    for index in np.argsort(distances, kind="stable").tolist():
        if index not in members and _agree([*members, index], identities, plane, seen):
            return [*members, index]
    return None


def _agree(members: list[int], identities: Sequence[int], plane: np.ndarray, seen: np.ndarray) -> bool:
    if len({identities[member] for member in members}) < len(members):
        return False
    homography = _homography(plane[members], seen[members])
    return homography is not None and _distances(homography, plane[members], seen[members]).max() <= TOLERANCE_PX


def _homography(plane: np.ndarray, seen: np.ndarray) -> np.ndarray | None:
    import cv2

    return cv2.findHomography(plane.reshape(-1, 2), seen.reshape(-1, 2), 0)[0]


def _distances(homography: np.ndarray, plane: np.ndarray, seen: np.ndarray) -> np.ndarray:
    """Return the distances (n, 4) [px] of corners from where the homography puts them."""
    import cv2

    mapped = cv2.perspectiveTransform(plane.reshape(-1, 1, 2), homography).reshape(seen.shape)
    return np.linalg.norm(mapped - seen, axis=-1)


def _pose_error_px(plane: np.ndarray, seen: np.ndarray, K: np.ndarray | None) -> float:
    import cv2

    if K is None:
        return np.nan
    points, pixels = np.pad(plane.reshape(-1, 2), ((0, 0), (0, 1))), seen.reshape(-1, 2)
    start = opencv_ippe.solve(points[None], normalise(pixels, K)[None])
    if not start.ok[0]:
        return np.nan
    # as columns: of a row the refinement makes something else
    vector, shift = cv2.Rodrigues(start.rotation[0])[0], start.translation_m.T.copy()
    rotation, translation = cv2.solvePnPRefineLM(points, pixels, K, None, vector, shift)
    projected = cv2.projectPoints(points, rotation, translation, K, None)[0].reshape(-1, 2)
    return float(np.sqrt(np.mean(np.sum((projected - pixels) ** 2, axis=1))))
