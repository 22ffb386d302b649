"""Find ArUco and AprilTag markers in a picture."""

import numpy as np

from uwsim.images import linear_from_srgb_uint8
from uwsim.pose.edges import refine_corners


def detect_markers(image: np.ndarray, dictionary_name: str) -> dict[int, np.ndarray]:
    """Return {marker id: corners (4, 2) [px]} of an (H, W, 3) uint8 sRGB image; empty if there are none.

    `dictionary_name` as OpenCV names it, "DICT_APRILTAG_36h11" for example. Corners run clockwise from the
    marker's own top left, **pixel centres at integer + 0.5** (OpenCV: at integers). An id that is found twice
    is left out: which of the two is meant cannot be told. ValueError for another kind of image or an unknown
    dictionary.

    Source: Garrido-Jurado et al., Pattern Recognition 47(6), 2014 (`cv2.aruco.ArucoDetector`); corners then
    refined in linear light by `refine_corners`.
    """
    import cv2

    if not isinstance(image, np.ndarray) or image.dtype != np.uint8 or image.ndim != 3 or image.shape[2] != 3:
        got = f"{image.dtype} {image.shape}" if isinstance(image, np.ndarray) else type(image).__name__
        raise ValueError(f"detect_markers: got {got}, allowed: uint8 (H, W, 3)")
    known = sorted(name for name in dir(cv2.aruco) if name.startswith("DICT_"))
    if dictionary_name not in known:
        raise ValueError(f"dictionary: got {dictionary_name!r}, allowed: {', '.join(known)}")
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, dictionary_name))
    parameters = cv2.aruco.DetectorParameters()
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    grey = cv2.cvtColor(np.ascontiguousarray(image), cv2.COLOR_RGB2GRAY)
    found, identities, _ = cv2.aruco.ArucoDetector(dictionary, parameters).detectMarkers(grey)
    if identities is None or len(identities) == 0:
        return {}
    identities = np.asarray(identities).ravel().tolist()
    linear = linear_from_srgb_uint8(grey).astype(np.float64)
    return {
        identity: refine_corners(linear, _our_pixels(corners), modules=dictionary.markerSize + 2)
        for identity, corners in sorted(zip(identities, found, strict=True), key=lambda pair: pair[0])
        if identities.count(identity) == 1
    }


def _our_pixels(opencv_corners: np.ndarray) -> np.ndarray:
    """Return OpenCV's corners (pixel centres at integers) as (4, 2) with centres at integer + 0.5."""
    return np.asarray(opencv_corners, dtype=float).reshape(4, 2) + 0.5
