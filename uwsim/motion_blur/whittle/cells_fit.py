"""Damped Fisher scoring of many parameter sets at once on averaged frequencies, without leakage: fast, nearly exact."""

import numpy as np

from uwsim.motion_blur.whittle import model
from uwsim.motion_blur.whittle.model import FILL, NOISE, RIGHT, STATIC, TEXTURE, UP
from uwsim.motion_blur.whittle.periodogram import Cells
from uwsim.motion_blur.whittle.steps import bounded, shortened, step_of

# means of several frequencies scatter less than one
CLIP = 3.0
# 1 / the form of the zero fill at the first zero
_RAMP_AT_ZERO = np.float32(1 + np.pi**2)
_HEAD = [RIGHT, UP, NOISE, STATIC, FILL]
_DAMPING = 1e-2


def fit_cells(
    cells: Cells, power: np.ndarray, parameters: np.ndarray, *, free: np.ndarray, steps: int, limit_px: float, prior,
    moving: np.ndarray | None = None, clip: float = CLIP,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:  # fmt: skip
    """Return (parameters (S, 19), losses (S,) [nats], informative (S,)) after some steps from parameters (S, 19).

    `power` (C,): mean of the periodogram over each cell. Only parameters with indices `free` move. Informative is the
    number of frequencies that the texture rules, those that noise covers counting less. `moving` (C,): mean squared
    transfer of the moving part over each cell where the blur is known; its parameters mean nothing then. `clip`: as
    in `model.losses`.
    """
    evaluate = _Evaluation(cells, power, *prior, moving, clip)
    damping = np.full(len(parameters), _DAMPING)
    losses, gradient, curvature = evaluate(parameters)
    for _ in range(steps):
        step = np.zeros_like(parameters)
        step[:, free] = step_of(gradient[:, free], curvature[:, free[:, None], free], damping[:, None])
        trial = bounded(parameters + shortened(step), limit_px)
        with np.errstate(over="ignore", invalid="ignore"):  # a step out of float32 has no loss: it is not better
            trial_losses, trial_gradient, trial_curvature = evaluate(trial)
        better = trial_losses < losses
        parameters = np.where(better[:, None], trial, parameters)
        losses = np.where(better, trial_losses, losses)
        gradient = np.where(better[:, None], trial_gradient, gradient)
        curvature = np.where(better[:, None, None], trial_curvature, curvature)
        damping = np.where(better, damping / 5, damping * 10)
    # the amplitude has no prior: its curvature is all the data's
    return parameters, losses, curvature[:, TEXTURE.start, TEXTURE.start]


class _Evaluation:
    """Loss, gradient and curvature of many parameter sets on the cells."""

    def __init__(
        self,
        cells: Cells,
        power: np.ndarray,
        mean: np.ndarray,
        precision: np.ndarray,
        moving: np.ndarray | None,
        clip: float,
    ):
        self.u, self.v, self.count, self.power, self.terms = (
            a.astype(np.float32) for a in (cells.u, cells.v, cells.count, power, cells.terms)
        )
        self.products = (self.terms[:, :, None] * self.terms[:, None, :]).reshape(len(power), -1)
        self.variance = np.array(cells.variance, np.float32)
        self.mean, self.precision, self.clip = mean, precision, clip
        self.moving = None if moving is None else moving.astype(np.float32)

    def __call__(self, parameters: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return losses (S,), minus the gradients (S, 19) and the curvatures (S, 19, 19)."""
        p = parameters.astype(np.float32)
        static, fill, noise = (np.exp(p[:, index, None]) for index in (STATIC, FILL, NOISE))
        moving, slope, ramp = self._transfer(p, fill)
        texture = np.exp(p[:, TEXTURE] @ self.terms.T)
        signal = texture * ((1 - static) * moving + static)
        total = signal + noise
        loss, score = model.losses(self.power, total, self.clip)
        slope = (1 - static) * texture * slope
        by_head = np.stack(
            [
                slope * self.u, -slope * self.v, np.broadcast_to(noise, total.shape),
                static * texture * (1 - moving), (1 - static) * fill * texture * ramp,
            ],
            axis=1,
        ) / total[:, None, :]  # fmt: skip
        share = signal / total
        away = parameters - self.mean
        losses = (loss * self.count).sum(axis=1, dtype=float) + 0.5 * away**2 @ self.precision
        weighted = score * self.count
        gradient = np.concatenate(
            [np.einsum("skc,sc->sk", by_head, weighted), (weighted * share) @ self.terms], axis=1
        ) - self.precision * away  # fmt: skip
        return losses, gradient, self._curvature(by_head, share)

    def _transfer(self, p: np.ndarray, fill: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return what `model.transfer` does, each (S, C), averaged over the cells."""
        if self.moving is not None:
            nothing = np.zeros((len(p), len(self.moving)), np.float32)
            return np.broadcast_to(self.moving, nothing.shape), nothing, nothing
        along = p[:, RIGHT, None] * self.u - p[:, UP, None] * self.v
        # over a cell sinc^2 at the k-th zero has the mean of the variance of its argument over k^2: a zero fill
        spread = (p[:, [RIGHT, UP]] ** 2) @ self.variance
        return model.transfer(along, fill + _RAMP_AT_ZERO * spread[:, None])

    def _curvature(self, by_head: np.ndarray, share: np.ndarray) -> np.ndarray:
        head, count, terms = len(_HEAD), len(share), self.terms.shape[1]
        curvature = np.empty((count, head + terms, head + terms))
        curvature[:, :head, :head] = (by_head * self.count) @ by_head.transpose(0, 2, 1)
        curvature[:, :head, head:] = (by_head * (self.count * share)[:, None, :]) @ self.terms
        curvature[:, head:, :head] = curvature[:, :head, head:].transpose(0, 2, 1)
        curvature[:, head:, head:] = ((self.count * share**2) @ self.products).reshape(count, terms, terms)
        return curvature + np.diag(self.precision)
