"""OpenCV's pose solvers, one problem at a time, behind the batches of this package.

Flags go by name: their numbers changed from OpenCV 4 to 5, where SOLVEPNP_DLS and SOLVEPNP_UPNP, for years silent
aliases of SOLVEPNP_EPNP, are gone. Targets come centred and of unit size, since OpenCV's thresholds are absolute. Of
several solutions the least reprojection error with all points before the camera counts, and for flat targets the next
is the twin.
"""

from collections.abc import Callable

import numpy as np

from uwsim.pose.batches import Centred, Poses, least

# no rotation that markers usually have is this one's inverse times half a turn
_ODD_TURN = (0.61, -0.43, 0.27)


def opencv_core(flag: str, *, turn_target: bool = False) -> Callable[[Centred], Poses]:
    """Return a core for `batches.solved` that calls `cv2.solvePnPGeneric` with the flag of that name.

    `turn_target`: hand the target over in axes turned by an odd rotation, for solvers that lose rotations of 180 deg.
    ValueError if this OpenCV does not have the flag.
    """
    import cv2
    from scipy.spatial.transform import Rotation

    if not hasattr(cv2, flag):
        known = ", ".join(name for name in dir(cv2) if name.startswith("SOLVEPNP_"))
        raise ValueError(f"OpenCV {cv2.__version__}: got {flag}, allowed: {known}")
    number = getattr(cv2, flag)
    turn = Rotation.from_rotvec(_ODD_TURN).as_matrix() if turn_target else np.eye(3)

    def core(centred: Centred) -> Poses:
        turned = centred.target @ turn.T
        found = [_solutions(one, seen, number) for one, seen in zip(turned, centred.image, strict=True)]
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
    return [(cv2.Rodrigues(vector)[0], shift.ravel()) for vector, shift in zip(vectors, shifts, strict=True)]
