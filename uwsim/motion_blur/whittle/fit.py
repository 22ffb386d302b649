"""Fisher scoring of all parameters on all frequencies, from a start near the solution.

Source: Whittle, Arkiv foer Matematik 2, 1953 (the likelihood); Levenberg-Marquardt damping.
"""

from dataclasses import dataclass

import numpy as np

from uwsim.motion_blur.whittle import model
from uwsim.motion_blur.whittle.model import FILL, NOISE, RIGHT, STATIC, TEXTURE, UP
from uwsim.motion_blur.whittle.periodogram import Frequencies
from uwsim.motion_blur.whittle.steps import bounded, shortened, step_of

CLIP = 8.0
STEPS = 20
# a step that gains less changes nothing that the data could tell
_ENOUGH_NATS = 0.005
_LEAST_DAMPING, _FIRST_DAMPING, _MOST_DAMPING = 1e-6, 1e-3, 1e6


@dataclass(frozen=True)
class Fit:
    """Parameters of the model, the loss [nats], and the information of the data and of the prior."""

    parameters: np.ndarray  # (19,)
    loss: float
    information: np.ndarray  # (19, 19), of the data
    precision: np.ndarray  # (19,) of the prior


def refine(
    frequencies: Frequencies, power: np.ndarray, start: np.ndarray, *, limit_px: float, prior, free=None
) -> Fit:
    """Return the fit to a periodogram (H, W // 2 + 1), float32, of the parameters with indices `free` (default all).

    `start` (19,); `prior` as `model.prior` gives it.
    """
    free = np.arange(model.PARAMETERS) if free is None else np.asarray(free)
    mean, precision = prior

    def evaluate(parameters):
        total, slopes = _density(frequencies, parameters)
        loss, score = model.losses(power, total, CLIP)
        slopes /= total
        slopes *= frequencies.fitted
        slopes = slopes.reshape(model.PARAMETERS, -1)
        away = parameters - mean
        value = float(np.sum(loss, where=frequencies.fitted, dtype=float)) + 0.5 * float(precision @ away**2)
        gradient = slopes @ score.ravel() - precision * away
        return value, gradient, (slopes @ slopes.T).astype(float)

    parameters, damping = bounded(start, limit_px), _FIRST_DAMPING
    value, gradient, information = evaluate(parameters)
    for _ in range(STEPS):
        step = np.zeros(model.PARAMETERS)
        curvature = information[np.ix_(free, free)] + np.diag(precision[free])
        step[free] = step_of(gradient[free], curvature, damping)
        trial = bounded(parameters + shortened(step), limit_px)
        trial_value, trial_gradient, trial_information = evaluate(trial)
        gain = value - trial_value
        if gain > 0:
            parameters, value, gradient, information = trial, trial_value, trial_gradient, trial_information
            damping = max(damping / 10, _LEAST_DAMPING)
        else:
            damping *= 10
        if abs(gain) < _ENOUGH_NATS or damping > _MOST_DAMPING:
            break
    return Fit(parameters, value, information, precision)


def _density(frequencies: Frequencies, parameters: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return P (H, W // 2 + 1) and its derivatives (19, H, W // 2 + 1) by every parameter, float32.

    The texture's factors change little from bin to bin: their derivatives leave the leakage out.
    """
    u, v = frequencies.u.astype(np.float32), frequencies.v.astype(np.float32)
    static, fill, noise = np.exp(parameters[[STATIC, FILL, NOISE]]).astype(np.float32)
    along = np.float32(parameters[RIGHT]) * u - np.float32(parameters[UP]) * v
    texture = np.exp(frequencies.terms @ parameters[TEXTURE].astype(np.float32)).reshape(along.shape)
    moving, slope, ramp = model.transfer(along, fill)
    signal = frequencies.leak(texture * ((1 - static) * moving + static))
    slopes = np.empty((model.PARAMETERS, *along.shape), np.float32)
    slope = (1 - static) * texture * slope
    slopes[RIGHT], slopes[UP] = frequencies.leak(slope * u), frequencies.leak(-slope * v)
    slopes[NOISE] = noise
    slopes[STATIC] = static / (1 - static) * (texture - signal)
    slopes[FILL] = (1 - static) * fill * texture * ramp
    np.multiply(frequencies.terms.T.reshape(-1, *along.shape), signal, out=slopes[TEXTURE])
    return signal + noise, slopes
