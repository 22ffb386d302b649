"""Steps of the fits: damped, not too long, inside the limits. Parameters (..., 19) as in `model`."""

import numpy as np

from uwsim.motion_blur.whittle import model
from uwsim.motion_blur.whittle.model import RIGHT, UP

# longer steps would jump over a stripe of the spectrum into the next valley
_LONGEST_STEP_PX = 1.5
_TINY = 1e-12


def step_of(gradient: np.ndarray, curvature: np.ndarray, damping: float | np.ndarray) -> np.ndarray:
    """Return the Levenberg-Marquardt step (..., n) for a damping that broadcasts to the gradient (..., n)."""
    diagonal = np.einsum("...ii->...i", curvature)
    damped = curvature + np.eye(gradient.shape[-1]) * (damping * diagonal + 1e-9)[..., None]
    return np.linalg.solve(damped, gradient[..., None])[..., 0]


def shortened(step: np.ndarray) -> np.ndarray:
    """Return the step, as a whole shorter where its displacement is too long."""
    length = np.hypot(step[..., RIGHT], step[..., UP])
    return step * np.minimum(1.0, _LONGEST_STEP_PX / np.maximum(length, _TINY))[..., None]


def bounded(parameters: np.ndarray, limit_px: float) -> np.ndarray:
    """Return the parameters inside their limits; the displacement keeps its direction."""
    bounded = parameters.copy()
    for index, (low, high) in model.LIMITS.items():
        bounded[..., index] = np.clip(bounded[..., index], low, high)
    length = np.hypot(bounded[..., RIGHT], bounded[..., UP])
    shrink = np.minimum(1.0, limit_px / np.maximum(length, _TINY))
    bounded[..., RIGHT] *= shrink
    bounded[..., UP] *= shrink
    return bounded
