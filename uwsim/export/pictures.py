"""What several formats take from a frame: the water-free twin as a picture, masks of the bodies, depth in steps."""

from collections.abc import Iterator

import numpy as np

from uwsim.camera import sensor_record
from uwsim.camera.sensor import expose_without_noise
from uwsim.dataset.frame import Frame
from uwsim.dataset.parts import Body

_MOST = np.iinfo(np.uint16).max


def twin(frame: Frame) -> np.ndarray:
    """Return the water-free twin through the frame's camera without noise, (H, W, 3) uint8 sRGB."""
    camera = frame.info.camera
    constants = sensor_record.constants(
        frame.info.sensor.model_dump(), K=frame.K, width_px=camera.width_px, height_px=camera.height_px
    )
    return expose_without_noise(frame.buffer("water_free"), **constants)


def visible(frame: Frame) -> Iterator[tuple[Body, np.ndarray]]:
    """Yield (body, mask (H, W) bool) of each body that is seen, by instance number."""
    instance = frame.buffer("instance")
    for body in sorted(frame.info.bodies, key=lambda body: body.instance):
        mask = instance == body.instance
        if mask.any():
            yield body, mask


def depth_steps(frame: Frame, step_m: float) -> np.ndarray:
    """Return z-depth in whole steps, (H, W) uint16, 0 where no body is seen.

    Raises ValueError where a depth has no such number: it rounds to 0, or to more than 65535 steps.
    """
    z_depth = frame.buffer("z_depth").astype(float)
    seen = np.isfinite(z_depth)
    steps = np.rint(np.where(seen, z_depth, 0) / step_m)
    if np.any(steps[seen] < 1) or np.any(steps > _MOST):
        low, high = z_depth[seen].min(), z_depth[seen].max()
        raise ValueError(
            f"{frame.folder}: z_depth from {low:.4g} to {high:.4g} m, allowed in 16 bits of {step_m:g} m: "
            f"{step_m:g} to {_MOST * step_m:.4g} m"
        )
    return steps.astype(np.uint16)


def depth_step_m(frame: Frame, finest_m: float) -> float:
    """Return the first of 1, 2, 5, 10, 20 ... `finest_m` in which the frame's depths fit 16 bits."""
    z_depth = frame.buffer("z_depth")
    most_m = float(np.max(z_depth, where=np.isfinite(z_depth), initial=0))
    decade = 1
    while True:
        for factor in (1, 2, 5):
            if most_m <= finest_m * factor * decade * _MOST:
                return finest_m * factor * decade
        decade *= 10
