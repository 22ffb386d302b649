"""Parallel with the dissertation's weights of the distances, its contribution in the reading that can be computed.

`form="pairs"`: w_ij = d_ij^2 / m_ij of each pair of control points, d_ij its distance and m_ij that of its images (at
the start's pose). `form="as_printed"`: w_ij = d_i^2 / (z^2 m_o m_i) of 5.30, which names the first control point of the
pair alone: d_i and m_i its distance from the target's origin in space and image, m_o the origin's from the optical
axis, z its depth. They are those of the start's pose: only where that is exact, and the origin on the optical axis or
seen where the first control point of a pair is, does it divide by 0 and give no pose.

No gain over `parallel` should be expected: the residual is a squared length whose variance is not the square of a
product of rates, and the pairs' errors go together; `parallel_covariance` has the weights that follow from the noise.

Source: dissertation 5.30, 5.31.
Errata: z^2 m_o is common to all pairs and cancels; the weight is to be an inverse variance; 5.31 prints an absolute
value for the square; the angle's factor is not constant. For a flat target three betas meet three distances: the
weights change nothing.
"""

from functools import partial

import numpy as np

from uwsim.pose.affine import paraperspective_start
from uwsim.pose.batches import Centred, Poses, solved
from uwsim.pose.control_points import PAIRS, Controls, in_camera
from uwsim.pose.parallel import from_start
from uwsim.pose.solution import Solution

MINIMUM_POINTS = 4
PLANAR_OK = True
NEEDS = ()
FORMS = ("pairs", "as_printed")
# a segment along the line of sight has no length in the image
_FLOOR_SHARE = 1e-3


def solve(points_m: np.ndarray, points: np.ndarray, *, form: str = "pairs") -> Solution:
    """Return camera_from_target for target points (B, n, 3) [m] seen at normalised image points (B, n, 2).

    Both starts of a flat or nearly flat target are refined; the other pose is the `twin`. Degenerate points, points
    behind the camera, weights that cannot be computed: not ok. Fewer than 4 points, NaN, other shapes or another form:
    ValueError.
    """
    if form not in FORMS:
        raise ValueError(f"parallel_weighted: form is {form!r}, allowed: {', '.join(FORMS)}")
    weights_of = _of_pairs if form == "pairs" else _as_printed
    core = partial(from_start, start=paraperspective_start, weights_of=weights_of)
    return solved(points_m, points, core, minimum=MINIMUM_POINTS, where="parallel_weighted")


def _of_pairs(pose: Poses, controls: Controls, centred: Centred) -> np.ndarray:
    camera = in_camera(pose, controls)
    seen = camera[..., :2] / camera[..., 2:]
    first, second = PAIRS[camera.shape[1]]
    length = np.linalg.norm(seen[:, first] - seen[:, second], axis=2)
    floor = _FLOOR_SHARE * np.sqrt(controls.distances2) / np.abs(pose.translation[:, 2:])
    weights = controls.distances2 / np.maximum(length, floor)
    return weights / weights.mean(axis=1, keepdims=True)


def _as_printed(pose: Poses, controls: Controls, centred: Centred) -> np.ndarray:
    """Return d_i^2 / (z^2 m_o m_i) of each pair; NaN where it divides by 0."""
    camera = in_camera(pose, controls)
    origin = (pose.rotation @ centred.origin[..., None])[..., 0] + pose.translation
    seen, of_origin = camera[..., :2] / camera[..., 2:], origin[:, :2] / origin[:, 2:]
    distance2 = ((controls.points - centred.origin[:, None]) ** 2).sum(axis=2)
    length = np.linalg.norm(seen - of_origin[:, None], axis=2)
    off_axis = np.linalg.norm(of_origin, axis=1)
    first = PAIRS[camera.shape[1]][0]
    with np.errstate(divide="ignore", invalid="ignore"):
        weights = (distance2 / (origin[:, 2:] ** 2 * off_axis[:, None] * length))[:, first]
    return np.where(np.all(np.isfinite(weights), axis=1, keepdims=True), weights, np.nan)
