"""When the rows of an image are exposed, and where a camera in motion therefore sees a point."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from uwsim.camera import pose
from uwsim.camera.lens import Lens

_ROUNDS = 100
_CLOSE_PX = 1e-7


@dataclass(frozen=True, kw_only=True)
class Shutter:
    """Exposure of `exposure_s` per row; the rows of an image of `height_px` start one after the other in `readout_s`.

    Times are relative to the middle of the exposure at half height.
    """

    height_px: int
    exposure_s: float
    readout_s: float = 0.0

    @property
    def span_s(self) -> float:
        """From the start of the first exposure to the end of the last. [s]"""
        return self.exposure_s + self.readout_s

    def middle_s(self, height_px: np.ndarray) -> np.ndarray:
        """Return the middle of the exposure at heights (...) [px] from the top, the edges' beyond the image. [s]"""
        return self.readout_s * (np.clip(height_px / self.height_px, 0.0, 1.0) - 0.5)

    def row_middles_s(self) -> np.ndarray:
        """Return the middle of the exposure of each row, (H,). [s]"""
        return self.middle_s(np.arange(self.height_px) + 0.5)

    def step_times_s(self, steps: int) -> np.ndarray:
        """Return the middles (n,) of n equal steps of the span. [s]"""
        return ((np.arange(steps) + 0.5) / steps - 0.5) * self.span_s


def see(
    points_world_m: np.ndarray, *, lens: Lens, poses_at: Callable[[np.ndarray], np.ndarray], shutter: Shutter,
    phase: float = 0.0,
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """Return where points (..., 3) [m] are imaged, (..., 2) [px], and the points in the camera's frame then, (..., 3).

    `poses_at`: world_from_camera (n, 4, 4) of times (n,). `phase`: at which moment of the exposure, from -0.5 (start)
    to 0.5 (end). With a rolling shutter that is the exposure at the height where the point is seen, found by the secant
    method where the fixed point iteration contracts. NaN where the camera does not see a point.
    Raises ValueError if the image moves down or up faster than the rows are read.
    """
    points = np.asarray(points_world_m, float)
    if shutter.readout_s == 0:
        local = pose.apply(pose.inverse(poses_at(np.array([phase * shutter.exposure_s]))[0]), points)
        return lens.project(local)[0], local
    flat = points.reshape(-1, 3)
    height = np.full(len(flat), shutter.height_px / 2)
    before, missed_before = np.full(len(flat), np.nan), np.full(len(flat), np.nan)
    rows = np.arange(len(flat))  # still moving
    local, pixels = np.empty_like(flat), np.full((len(flat), 2), np.nan)
    for _ in range(_ROUNDS):
        times_s = shutter.middle_s(height[rows]) + phase * shutter.exposure_s
        local[rows] = pose.apply_each(pose.inverse(poses_at(times_s)), flat[rows])
        pixels[rows] = lens.project(local[rows])[0]
        found = np.clip(pixels[rows, 1], 0.0, shutter.height_px)
        missed = found - height[rows]
        with np.errstate(divide="ignore", invalid="ignore"):
            slope = (missed - missed_before[rows]) / (height[rows] - before[rows])
            contracts = (slope > -2) & (slope < 0)  # False for NaN
            better = np.clip(np.where(contracts, height[rows] - missed / slope, found), 0.0, shutter.height_px)
        before[rows], missed_before[rows], height[rows] = height[rows], missed, better
        rows = rows[np.abs(missed) > _CLOSE_PX]  # False for NaN
        if len(rows) == 0:
            break
    else:
        raise ValueError(
            f"readout_s: {len(rows)} points have no row in which they are seen after {_ROUNDS} rounds, "
            f"allowed: an image that moves by less than {shutter.height_px} px in {shutter.readout_s:g} s"
        )
    return pixels.reshape(*points.shape[:-1], 2), local.reshape(points.shape)
