"""Control points of greatest likelihood: see `solvers.parallel_covariance`, where the method is derived."""

import numpy as np

from uwsim.pose.control_points import Controls, differences

_STEPS = 3
_FLOOR = 1e-14


def likely_controls(
    stacked: np.ndarray, values: np.ndarray, vectors: np.ndarray, controls: Controls, *, steps: int = _STEPS
) -> np.ndarray:
    """Return control points x (B, 3 m) of greatest likelihood near the given ones.

    `values`, `vectors`: of M^T M whose rows are errors of image points.
    """
    kept = 4 if controls.points.shape[1] == 4 else 3
    apart = differences(vectors)
    inner, outer = apart[..., :kept], apart[..., kept:]
    # exact points have eigenvalues 0 but for round-off, and are not to weigh more than that
    values = np.maximum(values, 1e-16 * values[:, -1:])
    least, spare = values[:, :kept], values[:, kept:]
    betas = (np.swapaxes(vectors[..., :kept], 1, 2) @ stacked[..., None])[..., 0]
    for _ in range(steps):
        now, residual, weights, _ = _weights(betas, inner, outer, spare, controls)
        slope = 2 * np.einsum("bpc,bpck->bpk", now, inner)
        pull = np.swapaxes(slope, 1, 2) @ weights
        normal = pull @ slope
        normal[:, range(kept), range(kept)] += least
        _regular(normal)
        gradient = least * betas + (pull @ residual[..., None])[..., 0]
        betas = betas - np.linalg.solve(normal, gradient[..., None])[..., 0]
    _, residual, weights, along = _weights(betas, inner, outer, spare, controls)
    outside = -(np.swapaxes(along, 1, 2) @ weights @ residual[..., None])[..., 0] / spare
    return (vectors @ np.concatenate([betas, outside], axis=1)[..., None])[..., 0]


def _weights(betas, inner, outer, spare, controls) -> tuple[np.ndarray, ...]:
    """Return differences (B, pairs, 3), residuals r (B, pairs), S^-1, and the slope A V2 (B, pairs, 3 m - N)."""
    now = (inner @ betas[:, None, :, None])[..., 0]
    residual = (now**2).sum(axis=2) - controls.distances2
    along = 2 * np.einsum("bpc,bpck->bpk", now, outer)
    spread = (along / spare[:, None]) @ np.swapaxes(along, 1, 2)
    _regular(spread)
    return now, residual, np.linalg.inv(spread), along


def _regular(matrices: np.ndarray) -> None:
    """Keep matrices (B, k, k) from being singular: images in one point, targets a thousand times their size away."""
    size = matrices.shape[1]
    diagonal = matrices[:, range(size), range(size)]
    matrices[:, range(size), range(size)] = (
        (1 + _FLOOR) * diagonal + _FLOOR * diagonal.max(axis=1, keepdims=True) + 1e-300
    )
