"""Levenberg-Marquardt for many small problems at once, each with its own damping and its own end."""

from collections.abc import Callable

import numpy as np

from uwsim.pose.reprojection import Errors, batch_last, errors

_FIRST_DAMPING, _LEAST_DAMPING, _MOST_DAMPING = 1e-4, 1e-12, 1e8
STEPS = 20
"""Enough where errors are small against the image of the target; Gauss-Newton slows down with the residuals."""
_TOLERANCE = 1e-7
"""A step below this share of every unknown's unit ends a problem."""

State = tuple[np.ndarray, ...]


def minimise(
    state: State, evaluate: Callable[[State, np.ndarray], Errors], move: Callable[[State, np.ndarray], State],
    *, steps: int = STEPS, tolerance: float = _TOLERANCE,
) -> tuple[State, np.ndarray]:  # fmt: skip
    """Return (states, costs (B,)) of least cost near the given ones; arrays with the batch **last**.

    `evaluate(state, index)` gives Errors of the problems `index` in `state`; `move(state, step (k, B))` the states one
    step on. All k unknowns are to be of the size of 1. A state of infinite cost stays as it is.

    Source: Marquardt, SIAM J. Appl. Math. 11(2), 1963: damping of the diagonal, less after a step that helps, more
    after one that does not.
    """
    best = tuple(part.copy() for part in state)
    index = np.arange(state[-1].shape[-1])
    current, found = state, evaluate(state, index)
    costs = found.cost.copy()
    damping = np.full(len(index), _FIRST_DAMPING)
    for _ in range(steps):
        going = np.isfinite(found.cost) & (damping < _MOST_DAMPING)
        if not going.all():
            current, found, damping, index = _only(going, current, found, damping, index)
        if not len(index):
            break
        step = _step(found, damping)
        trial = move(current, step)
        tried = evaluate(trial, index)
        better = tried.cost < found.cost
        current = tuple(np.where(better, new, old) for new, old in zip(trial, current, strict=True))
        found = Errors(*(np.where(better, new, old) for new, old in zip(tried, found, strict=True)))
        damping = np.where(better, np.maximum(0.1 * damping, _LEAST_DAMPING), 10 * damping)
        for part, new in zip(best, current, strict=True):
            part[..., index] = new
        costs[index] = found.cost
        damping[np.abs(step).max(axis=0) < tolerance] = _MOST_DAMPING
    return best, costs


def _only(keep: np.ndarray, current: State, found: Errors, damping: np.ndarray, index: np.ndarray) -> tuple:
    return (
        tuple(part[..., keep] for part in current),
        Errors(*(part[..., keep] for part in found)),
        damping[keep],
        index[keep],
    )


def _step(found: Errors, damping: np.ndarray) -> np.ndarray:
    """Return -(H + damping diag H)^-1 g, (k, B)."""
    matrix = np.moveaxis(found.information, -1, 0).copy()
    size = matrix.shape[1]
    diagonal = matrix[:, range(size), range(size)]
    # an unknown that nothing depends on keeps the matrix regular and stays
    floor = 1e-14 * diagonal.max(axis=1, keepdims=True) + 1e-300
    matrix[:, range(size), range(size)] = diagonal * (1 + damping[:, None]) + floor
    return -np.linalg.solve(matrix, found.gradient.T[..., None])[..., 0].T


def exponential(turn: np.ndarray) -> np.ndarray:
    """Return rotations (3, 3, B) of rotation vectors (3, B) [rad]."""
    angle2 = np.einsum("kb,kb->b", turn, turn)
    angle = np.sqrt(angle2)
    sine = np.sinc(angle / np.pi)
    versine = 0.5 * np.sinc(angle / (2 * np.pi)) ** 2
    x, y, z = turn
    a, b, c = versine * turn
    sx, sy, sz = sine * turn
    cosine = 1 - versine * angle2
    return np.array(
        [
            [cosine + a * x, a * y - sz, a * z + sy],
            [a * y + sz, cosine + b * y, b * z - sx],
            [a * z - sy, b * z + sx, cosine + c * z],
        ]
    )


def product(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return matrix products of (3, 3, B) and (3, 3, B)."""
    return np.einsum("ijb,jkb->ikb", first, second)


def least_reprojection(
    rotation: np.ndarray, translation: np.ndarray, target: np.ndarray, image: np.ndarray, *, steps: int = STEPS
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return (rotation (B, 3, 3), translation (B, 3), cost (B,)) of least reprojection error near the given poses.

    Points (B, n, 3), best about their centroid, and images (B, n, 2). Unknowns: turn about the camera's axes, shift in
    shares of the depth. A start with points behind the camera has infinite cost and stays.
    """
    points, seen = (batch_last(np.swapaxes(values, 1, 2)) for values in (target, image))
    cached = {"index": None}

    def of(index: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        if cached["index"] is not index:
            whole = len(index) == points.shape[2]
            cached.update(index=index, data=(points, seen) if whole else (points[..., index], seen[..., index]))
        return cached["data"]

    def evaluate(state, index):
        return errors(*state, *of(index), np.abs(state[1][2]))

    def move(state, step):
        rotation, translation = state
        return product(exponential(step[:3]), rotation), translation + np.abs(translation[2]) * step[3:]

    state = (batch_last(rotation), batch_last(translation))
    (rotation, translation), cost = minimise(state, evaluate, move, steps=steps)
    return np.moveaxis(rotation, -1, 0), np.moveaxis(translation, -1, 0), cost
