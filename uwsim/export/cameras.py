"""The camera as other formats know it: K in OpenCV's pixels (centres at integers), and no port.

A pinhole in the water is that exactly. A lens with distortion, or behind a port, has no K that projects points to its
pixels: then K is the pinhole that fits best, and how far it is off is stated.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from uwsim.camera.lens import lens_from_record, pixel_centres
from uwsim.dataset.frame import Frame

CENTRE_PX = 0.5  # ours minus OpenCV's coordinates of a pixel's centre
_MOST_POINTS = 20_000
_RANGE_M = 1.0


@dataclass(frozen=True, kw_only=True, eq=False)
class Pinhole:
    """K (3, 3) [px] in OpenCV's pixels, `distortion` of OpenCV; how far its projection of what is seen is off [px]."""

    K: np.ndarray
    distortion: tuple[float, ...] = ()
    is_exact: bool
    rms_px: float = 0.0
    max_px: float = 0.0


def camera_points_m(frame: Frame) -> np.ndarray:
    """Return what the pixels' centres see as points in the camera frame, (H, W, 3) [m]; NaN where no body is seen."""
    camera = frame.info.camera
    lens = lens_from_record(camera.model_dump())
    origins, directions = lens.rays(pixel_centres(width_px=camera.width_px, height_px=camera.height_px))
    range_m = frame.buffer("range")
    return origins + np.where(np.isfinite(range_m), range_m, np.nan)[..., None] * directions


def pinhole_of(frames: Sequence[Frame], *, with_distortion: bool = False) -> Pinhole:
    """Return the pinhole of frames that share one camera.

    with_distortion: where the format has OpenCV's k1, k2, p1, p2, a lens without a port and with no others is exact.
    Else fx, fy, cx, cy are least squares over the pixels of all frames of u - (fx X/Z + cx), with the points that they
    see; a pixel that sees no body counts with the point at the frame's median range, 1 m in a frame without bodies.
    Raises ValueError if the cameras differ.
    """
    camera, where = frames[0].info.camera, frames[0].folder
    alike = ("width_px", "height_px", "K", "distortion", "port")
    for frame in frames[1:]:
        if any(getattr(frame.info.camera, key) != getattr(camera, key) for key in alike):
            raise ValueError(f"{frame.folder}: the camera differs from that of {where}, allowed: one in a sequence")
    K = np.array(camera.K)
    K[:2, 2] -= CENTRE_PX
    if camera.port is None and not any(camera.distortion):
        return Pinhole(K=K, is_exact=True)
    if with_distortion and camera.port is None and not any(camera.distortion[4:]):
        return Pinhole(K=K, distortion=tuple(camera.distortion[:4]), is_exact=True)
    return _fitted(frames)


def _fitted(frames: Sequence[Frame]) -> Pinhole:
    samples = [_samples(frame, _MOST_POINTS // len(frames)) for frame in frames]
    points, pixels = (np.concatenate(parts) for parts in zip(*samples, strict=True))
    flat, K = points[:, :2] / points[:, 2:], np.eye(3)
    for axis in range(2):
        system = np.column_stack([flat[:, axis], np.ones(len(flat))])
        K[axis, axis], K[axis, 2] = np.linalg.lstsq(system, pixels[:, axis], rcond=None)[0]
    off_px = np.linalg.norm(flat @ K[:2, :2].T + K[:2, 2] - pixels, axis=-1)
    return Pinhole(K=K, is_exact=False, rms_px=float(np.sqrt(np.mean(off_px**2))), max_px=float(off_px.max()))


def _samples(frame: Frame, most: int) -> tuple[np.ndarray, np.ndarray]:
    """Return points (n, 3) [m] and OpenCV's pixels (n, 2) on a grid over the frame, about `most` of them."""
    camera = frame.info.camera
    lens = lens_from_record(camera.model_dump())
    step = max(1, int(np.sqrt(camera.width_px * camera.height_px / max(most, 1))))
    centres = pixel_centres(width_px=camera.width_px, height_px=camera.height_px)[::step, ::step].reshape(-1, 2)
    range_m = frame.buffer("range")[::step, ::step].reshape(-1).astype(float)
    seen = np.isfinite(range_m)
    range_m[~seen] = np.median(range_m[seen]) if seen.any() else _RANGE_M
    origins, directions = lens.rays(centres)
    points = origins + range_m[:, None] * directions
    usable = np.all(np.isfinite(points), axis=-1)
    return points[usable], centres[usable] - CENTRE_PX


def camera_text(pinholes: Sequence[Pinhole]) -> str:
    """Return in one paragraph what K means in an export."""
    text = "K is in OpenCV's pixels: the centre of the first pixel is (0, 0)."
    off = [one for one in pinholes if not one.is_exact]
    if not off:
        return f"{text} It is exact: the camera is a pinhole in the water{_distorted(pinholes)}."
    rms_px, max_px = max(one.rms_px for one in off), max(one.max_px for one in off)
    return (
        f"{text} **It is not exact**: lens distortion, or refraction at the port, has no pinhole. K is the pinhole "
        f"that fits what each picture's pixels see best; it misses them by up to {rms_px:.3g} px (root mean square "
        f"over a picture, the worst one) and {max_px:.3g} px (the worst pixel). Poses and depths are exact, and in the "
        "frame of the true pinhole behind the port. The exact lens is in the frame.json of the dataset."
    )


def _distorted(pinholes: Sequence[Pinhole]) -> str:
    return " with the distortion given beside it" if any(any(one.distortion) for one in pinholes) else ""
