"""EPnP's betas from linear equations: what epnp and epnp_gn share.

The distances are linear in the products b_kl = beta_k beta_l: d_ij^2 = sum_kl b_kl D_k.D_l. With fewer unknown products
than distances they follow by least squares, for 1, 2, 3 or 4 vectors whose other products are left out.

Source: Lepetit, Moreno-Noguer and Fua, IJCV 81(2), 2009, section 3.3. The sets of products are those of the authors'
program for 4 (b11, b12, b13, b14), 2 (b11, b12, b22) and 3 vectors (b11, b12, b22, b13, b23); 1 vector is the paper's
N = 1. A flat target has 3 distances, so 1 to 3 vectors with 3 products at most.

A nearly flat target takes its first pose from the flat form, as if its points were in the plane, and Gauss-Newton on
the distances of all four control points, from that pose and from its mirror image, brings in that they are not. The
linear equations of four control points are of little use there: of four points they give wrong poses in 97 %.
"""

import numpy as np

from uwsim.pose.affine import mirrored
from uwsim.pose.batches import Centred, Poses, least, together
from uwsim.pose.betas import refined_betas
from uwsim.pose.control_points import control_points, differences, eigenvectors, pose_of
from uwsim.pose.parallel import from_start

_SETS = {
    4: (((0, 0),), ((0, 0), (0, 1), (0, 2), (0, 3)), ((0, 0), (0, 1), (1, 1)),
        ((0, 0), (0, 1), (1, 1), (0, 2), (1, 2))),
    3: (((0, 0),), ((0, 0), (0, 1), (0, 2)), ((0, 0), (0, 1), (1, 1))),
}  # fmt: skip


def by_linear_equations(centred: Centred, *, refine: bool) -> Poses:
    """Return of the sets' poses that of least reprojection error; `refine`: each by Gauss-Newton on all betas first.

    Of nearly flat targets the minimum next to it, and the next to its mirror image as the twin.
    """
    if centred.relief:
        even = by_linear_equations(centred._replace(relief=False), refine=refine)
        other = mirrored(even)
        return from_start(
            centred, lambda _: even._replace(twin_rotation=other.rotation, twin_translation=other.translation)
        )
    controls = control_points(centred)
    vectors = eigenvectors(controls.weights, centred.image)[1][..., : controls.points.shape[1]]
    apart = differences(vectors)
    found = []
    for products in _SETS[vectors.shape[2]]:
        betas = _betas(_products(apart, controls.distances2, products), products, vectors.shape[2])
        if refine:
            betas, _ = refined_betas(betas, vectors, controls)
        found.append(pose_of((vectors @ betas[..., None])[..., 0], controls, centred))
    return least(together(found), centred)._replace(twin_rotation=None, twin_translation=None)


def _products(apart: np.ndarray, distances2: np.ndarray, products: tuple) -> np.ndarray:
    """Return b_kl (B, len(products)) of least squares from D (B, pairs, 3, N)."""
    columns = [
        (1 if k == l else 2) * np.einsum("bpc,bpc->bp", apart[..., k], apart[..., l]) for k, l in products
    ]  # fmt: skip
    matrix = np.stack(columns, axis=2)
    if matrix.shape[2] == 1:
        return (matrix[..., 0] * distances2).sum(axis=1, keepdims=True) / (matrix**2).sum(axis=1)
    orthogonal, triangle = np.linalg.qr(matrix)
    diagonal = np.abs(triangle[:, range(len(products)), range(len(products))])
    regular = diagonal.min(axis=1) > 1e-13 * diagonal.max(axis=1)
    triangle = np.where(regular[:, None, None], triangle, np.eye(len(products)))
    found = np.linalg.solve(triangle, np.swapaxes(orthogonal, 1, 2) @ distances2[..., None])[..., 0]
    return np.where(regular[:, None], found, np.nan)


def _betas(products: np.ndarray, names: tuple, count: int) -> np.ndarray:
    """Return betas (B, count) of products; those that take part in none are 0."""
    betas = np.zeros((len(products), count))
    value = {name: products[:, place] for place, name in enumerate(names)}
    # b11 is a square: where the equations make it negative, so are all
    sign = np.where(value[0, 0] < 0, -1.0, 1.0)
    betas[:, 0] = np.sqrt(np.abs(value[0, 0]))
    if (1, 1) in value:
        betas[:, 1] = np.sqrt(np.maximum(sign * value[1, 1], 0)) * np.where(sign * value[0, 1] < 0, -1.0, 1.0)
    for other in range(1, count):
        if (0, other) in value and (other, other) not in value:
            with np.errstate(divide="ignore", invalid="ignore"):
                betas[:, other] = sign * value[0, other] / betas[:, 0]
    return betas
