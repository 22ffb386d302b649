"""The coefficients beta of x = V beta from the known distances between control points.

The camera's difference of a pair of control points is D beta (D (3, N) of that pair), so its squared length is
beta^T Q beta with Q = D^T D, and the residual r = beta^T Q beta - d^2.

Source: Lepetit et al., IJCV 81(2), 2009, sections 3.3 and 3.4; dissertation 5.10, 5.15, 5.16, 5.31.
Errata: 5.10 as printed lacks the square around the difference and has no least value; 5.31 takes the absolute value,
Gauss-Newton the square; in 5.16 V^T V is the identity.
"""

import numpy as np

from uwsim.pose.batches import Poses
from uwsim.pose.control_points import Controls, differences, in_camera
from uwsim.pose.levenberg import minimise
from uwsim.pose.reprojection import Errors, batch_first, batch_last

_TOLERANCE = 1e-9


def first_betas(vectors: np.ndarray, start: Poses, controls: Controls) -> np.ndarray:
    """Return V^T x0 (B, N) of the control points where a start's poses put them."""
    place = in_camera(start, controls).reshape(len(vectors), -1, 1)
    return (np.swapaxes(vectors, 1, 2) @ place)[..., 0]


def refined_betas(
    betas: np.ndarray, vectors: np.ndarray, controls: Controls, *, weights: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Return (betas (B, N), costs (B,)) of least sum of weights (B, pairs) times r^2 near the given ones.

    Betas or weights that are not finite give NaN. Costs are by the fourth power of the given betas' length.
    """
    forms = differences(vectors)
    forms = batch_last(np.swapaxes(forms, 2, 3) @ forms)
    # unknowns of the size of 1
    scale = np.linalg.norm(betas, axis=1)
    scale = np.where(np.isfinite(scale) & (scale > 0), scale, 1.0)
    wanted = batch_last(controls.distances2) / scale**2
    share = np.ones_like(wanted) if weights is None else batch_last(weights)

    def evaluate(state, index):
        (beta,) = state
        along = np.einsum("pijb,jb->pib", forms[..., index], beta)
        residual = np.einsum("pib,ib->pb", along, beta) - wanted[:, index]
        weighted = share[:, index] * residual
        slope = 2 * along
        return Errors(
            np.einsum("pb,pb->b", weighted, residual),
            np.einsum("pb,pib->ib", weighted, slope),
            np.einsum("pb,pib,pjb->ijb", share[:, index], slope, slope),
        )

    begin = batch_last(betas / scale[:, None])
    (found,), cost = minimise((begin,), evaluate, lambda state, step: (state[0] + step,), tolerance=_TOLERANCE)
    return batch_first(np.where(np.isfinite(cost), found * scale, np.nan)), cost
