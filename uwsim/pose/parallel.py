"""Betas from an affine start, refined by Gauss-Newton: what iepnp, parallel and parallel_weighted share."""

from collections.abc import Callable

import numpy as np

from uwsim.pose.batches import Centred, Poses, least
from uwsim.pose.betas import first_betas, refined_betas
from uwsim.pose.control_points import Controls, control_points, eigenvectors, pose_of
from uwsim.pose.refined import starts_of

Weights = Callable[[Poses, Controls, Centred], np.ndarray]


def from_start(
    centred: Centred, start: Callable[[Centred], Poses], *, weights_of: Weights | None = None
) -> Poses:  # fmt: skip
    """Return poses by betas near those of a start, in the 4 vectors of least eigenvalue (3 for a flat target).

    Both starts of a flat target are refined, and the one of less reprojection error counts. `weights_of` gives the
    weights (B, pairs) of the distances from the start's pose.
    """
    controls = control_points(centred)
    vectors = eigenvectors(controls.weights, centred.image)[1][..., : 3 if centred.flat else 4]
    found = []
    for pose in starts_of(start(centred)):
        weights = None if weights_of is None else weights_of(pose, controls, centred)
        betas, _ = refined_betas(first_betas(vectors, pose, controls), vectors, controls, weights=weights)
        stacked = (vectors @ betas[..., None])[..., 0]
        found.append(pose_of(stacked, controls, centred))
    if len(found) == 1:
        return found[0]
    both = Poses(np.stack([one.rotation for one in found]), np.stack([one.translation for one in found]))
    return least(both, centred)
