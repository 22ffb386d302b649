"""Find ArUco and AprilTag markers in a picture."""

import numpy as np

from uwsim.images import check_srgb_uint8, linear_from_srgb_uint8
from uwsim.pose.edges import corner_covariances, refine_corners


def detect_markers(image: np.ndarray, dictionary_name: str) -> dict[int, np.ndarray]:
    """Return {marker id: corners (4, 2) [px]} of an (H, W, 3) uint8 sRGB image; empty if there are none.

    `dictionary_name` as OpenCV names it, "DICT_APRILTAG_36h11" for example. Corners run clockwise from the
    marker's own top left, **pixel centres at integer + 0.5** (OpenCV: at integers). An id that is found twice
    is left out: which of the two is meant cannot be told. ValueError for another kind of image or an unknown
    dictionary.

    Source: Garrido-Jurado et al., Pattern Recognition 47(6), 2014 (`cv2.aruco.ArucoDetector`); corners then
    refined in linear light by `refine_corners`.
    """
    check_srgb_uint8(image, where="detect_markers")
    modules = _modules(dictionary_name)
    grey = _grey(image)
    found = opencv_markers(grey, dictionary_name)
    identities = [identity for identity, _ in found]
    linear = _linear(grey)
    return {
        # from OpenCV's pixels, whose centres are at integers
        identity: refine_corners(linear, corners + 0.5, modules=modules)
        for identity, corners in sorted(found, key=lambda pair: pair[0])
        if identities.count(identity) == 1
    }


def marker_covariances(image: np.ndarray, dictionary_name: str, found: dict[int, np.ndarray]) -> dict[int, np.ndarray]:
    """Return {marker id: covariances (4, 2, 2) [px^2]} of corners that `detect_markers` found in an image.

    NaN where the corners are OpenCV's, not refined along the edges.
    """
    linear, modules = _linear(_grey(image)), _modules(dictionary_name)
    return {identity: corner_covariances(linear, corners, modules=modules) for identity, corners in found.items()}


def _modules(dictionary_name: str) -> int:
    """Return the modules along a marker's side, black border included."""
    return dictionary(dictionary_name).markerSize + 2


def _grey(image: np.ndarray) -> np.ndarray:
    import cv2

    return cv2.cvtColor(np.ascontiguousarray(image), cv2.COLOR_RGB2GRAY)


def _linear(grey: np.ndarray) -> np.ndarray:
    return linear_from_srgb_uint8(grey).astype(np.float64)


def opencv_markers(grey: np.ndarray, dictionary_name: str) -> list[tuple[int, np.ndarray]]:
    """Return (id, corners (4, 2) [px, **centres at integers**]) of each detection in a grey (H, W) uint8 picture.

    An id may come more than once. `dictionary_name`, source: as `detect_markers`; corners with OpenCV's sub-pixel
    refinement.
    """
    import cv2

    parameters = cv2.aruco.DetectorParameters()
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    found, identities, _ = cv2.aruco.ArucoDetector(dictionary(dictionary_name), parameters).detectMarkers(grey)
    if identities is None:
        return []
    listed = np.asarray(identities).ravel().tolist()
    return [(identity, np.reshape(four, (4, 2)).astype(float)) for identity, four in zip(listed, found, strict=True)]


def dictionary(name: str, *, what: str = "dictionary"):
    """Return OpenCV's dictionary of that name; ValueError for an unknown one, under the name of `what` it is."""
    import cv2

    known = sorted(name for name in dir(cv2.aruco) if name.startswith("DICT_"))
    if name not in known:
        raise ValueError(f"{what}: got {name!r}, allowed: {', '.join(known)}")
    return cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, name))
