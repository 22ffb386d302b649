"""Where points move in the picture during the exposure, from what a frame.json says: the path of the blur.

`uwsim.motion_blur.kernels.kernel_of_path` turns such a path into the effective kernel at a pixel.
"""

import numpy as np

from uwsim.camera import pose
from uwsim.camera.lens import lens_from_record
from uwsim.camera.shutter import Shutter, see


def streak(
    camera: dict, *, exposure_s: float, pixels_px: np.ndarray, range_m: np.ndarray, times: int = 65,
    body: dict | None = None,
) -> np.ndarray:  # fmt: skip
    """Return displacements (times, ..., 2) [px], x right, y **down**, at equal steps of the exposure, both ends too.

    Of the points that pixels (..., 2) see in the middle of their row's exposure at `range_m` (...) along the ray (the
    buffer `range`). `camera`: the entry of a frame.json; `exposure_s`: its `sensor.exposure_time_s`. `body`: the entry
    of the body seen (`instance`), needed where that moves. With an odd number of times the middle one is (0, 0).
    With a rolling shutter times are those of the row in which the point is seen then. NaN where the camera does not
    see the point.
    Raises ValueError for less than two times, a range that is not finite, or a moving body before a rolling shutter.
    Valid: poses between those stored are joined by screw motions, as in the frame.
    """
    pixels, ranges = np.asarray(pixels_px, float), np.asarray(range_m, float)
    if times < 2:
        raise ValueError(f"times: got {times}, allowed: at least 2")
    if pixels.shape[-1:] != (2,) or pixels.shape[:-1] != ranges.shape or not np.all(np.isfinite(ranges)):
        raise ValueError(
            f"range_m: got shape {ranges.shape} for pixels {pixels.shape}, {np.sum(~np.isfinite(ranges))} not finite, "
            "allowed: a finite range for each pixel (what sees no body has no path)"
        )
    shutter = Shutter(height_px=camera["height_px"], exposure_s=exposure_s, readout_s=camera["readout_s"])
    knots_s, lens = np.asarray(camera["times_s"], float), lens_from_record(camera)
    rig, bodies = _path(camera["world_from_camera_through_exposure"], knots_s), None
    if body is not None and body.get("world_from_body_through_exposure") is not None:
        if shutter.readout_s > 0:
            raise ValueError(f"body {body['name']} moves before a rolling shutter, allowed: readout_s = 0")
        bodies = _path(body["world_from_body_through_exposure"], knots_s)
    origins, directions = lens.rays(pixels)
    local = origins + directions * ranges[..., None]
    points = pose.apply_each(rig(shutter.middle_s(pixels[..., 1].ravel())).reshape(*ranges.shape, 4, 4), local)
    found = []
    for phase in np.linspace(-0.5, 0.5, times):
        then = points
        if bodies is not None:
            ends = bodies(np.array([0.0, phase * exposure_s]))
            then = pose.apply(ends[1] @ pose.inverse(ends[0]), points)
        found.append(see(then, lens=lens, poses_at=rig, shutter=shutter, phase=phase)[0] - pixels)
    return np.stack(found)


def _path(poses, knots_s: np.ndarray):
    """Return the function from times (n,) to poses (n, 4, 4) through those stored; one alone is a body at rest."""
    poses = np.asarray(poses, float)
    if len(knots_s) == 1:
        return lambda times_s: np.repeat(poses, len(times_s), axis=0)
    return lambda times_s: pose.interpolate(
        poses,
        knots_s=knots_s,
        times_s=np.clip(times_s, knots_s[0], knots_s[-1]),  # round-off at the ends
    )
