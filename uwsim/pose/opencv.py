"""OpenCV's pose solvers, one problem at a time, behind the batches of this package.

Flags go by name: their numbers changed from OpenCV 4 to 5, where SOLVEPNP_DLS and SOLVEPNP_UPNP, for years silent
aliases of SOLVEPNP_EPNP, are gone. Targets come centred and of unit size, since OpenCV's thresholds are absolute. Of
several solutions the least reprojection error with all points before the camera counts, and for flat targets the next
is the twin.
"""

from collections.abc import Callable

import numpy as np

from uwsim.pose.batches import Centred, Poses, least

NO_METHODS = ("SOLVEPNP_DLS", "SOLVEPNP_UPNP", "SOLVEPNP_MAX_COUNT")
"""Names that OpenCV has, or had, and that stand for no method of their own: never taken."""
# no rotation that markers usually have is this one's inverse times half a turn
_ODD_TURN = (0.61, -0.43, 0.27)
# directions and shares by which an image is squeezed: more than round-off, less than 1e-6 rad of tilt
_SQUEEZES = [(along, share) for share in (1e-14, 1e-13) for along in ((0.8, 0.6), (1.0, 0.0), (-0.6, 0.8))]


def opencv_core(flag: str, *, mend_frontal: bool = False) -> Callable[[Centred], Poses]:
    """Return a core for `batches.solved` that calls `cv2.solvePnPGeneric` with the flag of that name.

    `mend_frontal`: hand the target over in axes turned by an odd rotation, and where NaN comes back the image squeezed
    by a trace, for solvers that lose rotations of 180 deg and targets seen face-on.
    ValueError if this OpenCV does not have the flag, and for those of `NO_METHODS` whatever it has.
    """
    import cv2
    from scipy.spatial.transform import Rotation

    known = [name for name in dir(cv2) if name.startswith("SOLVEPNP_") and name not in NO_METHODS]
    if flag not in known:
        raise ValueError(f"OpenCV {cv2.__version__}: got {flag}, allowed: {', '.join(known)}")
    number = getattr(cv2, flag)
    turn = Rotation.from_rotvec(_ODD_TURN).as_matrix() if mend_frontal else np.eye(3)

    solutions = _solutions_face_on if mend_frontal else _solutions

    def core(centred: Centred) -> Poses:
        turned = centred.target @ turn.T
        found = [solutions(one, seen, number) for one, seen in zip(turned, centred.image, strict=True)]
        most = max([len(poses) for poses in found] + [1])
        rotation = np.full((most, len(found), 3, 3), np.nan)
        translation = np.full((most, len(found), 3), np.nan)
        for problem, poses in enumerate(found):
            for place, pose in enumerate(poses):
                rotation[place, problem], translation[place, problem] = pose
        return least(Poses(rotation @ turn, translation), centred)

    return core


def _solutions(target: np.ndarray, image: np.ndarray, number: int) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return the (rotation, translation) that OpenCV finds; none where it refuses the problem."""
    import cv2

    try:
        _, vectors, shifts, _ = cv2.solvePnPGeneric(
            np.ascontiguousarray(target), np.ascontiguousarray(image), np.eye(3), None, flags=number
        )
    except cv2.error:
        return []
    return [
        (cv2.Rodrigues(vector)[0], shift.ravel())
        for vector, shift in zip(vectors, shifts, strict=True)
        if np.all(np.isfinite(vector)) and np.all(np.isfinite(shift))
    ]


def _solutions_face_on(target: np.ndarray, image: np.ndarray, number: int) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return as `_solutions`; where that finds none, from images that show the target tilted by next to nothing.

    IPPE takes the root of the tilt's squared sine, which round-off makes negative for every fourth target seen face-on.
    """
    found = _solutions(target, image, number)
    middle = image.mean(axis=0)
    for along, share in () if found else _SQUEEZES:
        found = _solutions(target, image - share * np.outer((image - middle) @ along, along), number)
        if found:
            break
    return found
