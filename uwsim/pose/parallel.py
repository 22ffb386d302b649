"""Betas from an affine start, refined by Gauss-Newton: what iepnp, parallel and its weighted kin share."""

from collections.abc import Callable

import numpy as np

from uwsim.pose.affine import paraperspective_start
from uwsim.pose.batches import Centred, Poses, least, together
from uwsim.pose.betas import first_betas, refined_betas
from uwsim.pose.control_points import Controls, control_points, eigenvectors, in_camera, pose_of
from uwsim.pose.marginalised import likely_controls
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
    vectors = _least_vectors(centred, controls)
    found = [
        _refined(pose, vectors, controls, centred, None if weights_of is None else weights_of(pose, controls, centred))
        for pose in starts_of(start(centred))
    ]
    return found[0] if len(found) == 1 else least(together(found), centred)


def by_covariance(centred: Centred) -> Poses:
    """Return poses as `from_start` from para-perspective ones, moved to the greatest likelihood where that helps."""
    controls = control_points(centred)
    vectors = _least_vectors(centred, controls)
    found = []
    for start in starts_of(paraperspective_start(centred)):
        pose = _refined(start, vectors, controls, centred, None)
        depth = (centred.target @ pose.rotation[:, 2, :, None])[..., 0] + pose.translation[:, 2, None]
        usable = np.all(depth > 0, axis=1)
        values, all_vectors = eigenvectors(controls.weights, centred.image, np.where(usable[:, None], depth, 1.0))
        stacked = in_camera(pose, controls).reshape(len(depth), -1)
        stacked = np.where(usable[:, None], stacked, in_camera(start, controls).reshape(len(depth), -1))
        found += [pose, pose_of(likely_controls(stacked, values, all_vectors, controls), controls, centred)]
    return least(together(found), centred)


def _least_vectors(centred: Centred, controls: Controls) -> np.ndarray:
    return eigenvectors(controls.weights, centred.image)[1][..., : controls.points.shape[1]]


def _refined(
    start: Poses, vectors: np.ndarray, controls: Controls, centred: Centred, weights: np.ndarray | None
) -> Poses:
    betas, _ = refined_betas(first_betas(vectors, start, controls), vectors, controls, weights=weights)
    return pose_of((vectors @ betas[..., None])[..., 0], controls, centred)
