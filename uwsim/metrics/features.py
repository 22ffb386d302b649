"""Features of a picture found again in another picture of the same view, verified by where they lie."""

from typing import Literal, NamedTuple

import numpy as np

from uwsim.metrics.image import check_image

COUNT = 500
RATIO = 0.8
WITHIN_PX = 2.0


class Features(NamedTuple):
    """`points_px` (n, 2), `descriptors` (n, d), and the norm by which these are compared."""

    points_px: np.ndarray
    descriptors: np.ndarray
    norm: int


def features(image: np.ndarray, kind: Literal["sift", "orb"], *, count: int = COUNT) -> Features:
    """Return the strongest features of an (H, W, 3) uint8 sRGB image on its luma: at most `count`.

    ValueError for another kind of image or of feature.

    Source: Lowe, Int. J. Computer Vision 60(2), 2004 (SIFT); Rublee et al., ICCV 2011 (ORB); OpenCV's, its defaults.
    """
    import cv2

    check_image(image, where="features")
    if kind not in ("sift", "orb"):
        raise ValueError(f"features: got {kind!r}, allowed: 'sift', 'orb'")
    finder = cv2.SIFT_create(nfeatures=count) if kind == "sift" else cv2.ORB_create(nfeatures=count)
    points, descriptors = finder.detectAndCompute(cv2.cvtColor(np.ascontiguousarray(image), cv2.COLOR_RGB2GRAY), None)
    # of equal strength OpenCV keeps more than were asked for
    points, descriptors = points[:count], descriptors[:count] if len(points) else None
    places = np.array([point.pt for point in points]).reshape(-1, 2)
    return Features(places, descriptors, finder.defaultNorm())


def verified_percent(true: Features, found: Features, *, within_px: float = WITHIN_PX) -> float:
    """Return how many of the true features are found again, in percent; NaN if there are no true ones.

    A true feature is found again if it and the feature nearest to it in description are each other's nearest, the next
    nearest is at least 1.25 times as far (ratio 0.8), and both lie within `within_px` of each other.

    Source: Lowe 2004, section 7.1 (ratio test); the place takes the part of an estimated homography.
    Valid: features that repeat exactly, as in a drawing without noise, cannot be told apart and count as not found.
    """
    if len(true.points_px) == 0:
        return float("nan")
    pairs = _mutual(true, found)
    distance_px = np.linalg.norm(true.points_px[pairs[:, 0]] - found.points_px[pairs[:, 1]], axis=-1)
    return 100 * float(np.count_nonzero(distance_px <= within_px)) / len(true.points_px)


def _mutual(true: Features, found: Features) -> np.ndarray:
    """Return pairs (n, 2) of numbers of features that are each other's nearest and pass the ratio test."""
    import cv2

    if len(found.points_px) < 2 or len(true.points_px) == 0:
        return np.zeros((0, 2), int)
    matcher = cv2.BFMatcher(true.norm)
    back = {match.queryIdx: match.trainIdx for match in matcher.match(found.descriptors, true.descriptors)}
    pairs = [
        (first.queryIdx, first.trainIdx)
        for first, second in matcher.knnMatch(true.descriptors, found.descriptors, k=2)
        if first.distance <= RATIO * second.distance and back[first.trainIdx] == first.queryIdx
    ]
    return np.array(pairs, int).reshape(-1, 2)
