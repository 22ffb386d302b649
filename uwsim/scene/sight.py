"""What a single ray meets first, without a renderer."""

import numpy as np

from uwsim.camera import pose
from uwsim.scene.bodies import Generated, Heightfield, MarineSnow, Mesh

_BEHIND_M = 1e-9


def first_range_m(bodies, *, origin_m: np.ndarray, direction: np.ndarray) -> float | None:
    """Return how far along a ray in the world the first body is in the middle of the exposure; None without one.

    `origin_m` (3,), `direction` (3,) of unit length. Boards and charts count as flat; particles are no bodies.
    Raises ValueError for a mesh from a file, which only the renderer reads.
    """
    nearest = np.inf
    for body in bodies:
        if isinstance(body, MarineSnow):
            continue
        if isinstance(body, Mesh):
            raise ValueError(f"rig.motion.range_m: missing, and body {body.name} is a mesh from a file; give range_m")
        body_from_world = pose.inverse(body.world_from_body)
        local = pose.apply(body_from_world, np.asarray(origin_m, float)), body_from_world[:3, :3] @ direction
        nearest = min(nearest, _first_triangle(_triangles(body), *local))
    return None if np.isinf(nearest) else float(nearest)


def _triangles(body) -> np.ndarray:
    """Return the surface of a body as triangles (n, 3, 3) in its own frame. [m]"""
    if isinstance(body, Generated):
        return body.triangles
    if not isinstance(body, Heightfield):
        corners = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) / 2.0
        return (corners * (body.width_m, body.height_m, 1.0))[[[0, 1, 2], [0, 2, 3]]]
    z = body.heights_m
    x, y = np.meshgrid(
        np.linspace(-0.5, 0.5, z.shape[1]) * body.width_m, np.linspace(0.5, -0.5, z.shape[0]) * body.height_m
    )
    at = np.stack([x, y, z], axis=-1)
    a, b, c, d = (part.reshape(-1, 3) for part in (at[:-1, :-1], at[:-1, 1:], at[1:, :-1], at[1:, 1:]))
    return np.concatenate([np.stack([a, c, b], axis=1), np.stack([b, c, d], axis=1)])


def _first_triangle(triangles: np.ndarray, origin_m: np.ndarray, direction: np.ndarray) -> float:
    """Return the distance along a ray at which it meets the first triangle, inf if it meets none."""
    across = np.linalg.svd(direction[None])[2][1:]  # two axes at right angles to the ray
    offsets = triangles - origin_m
    u, v = np.moveaxis(offsets @ across.T, -1, 0)  # (n, 3) each: seen along the ray, which is the point (0, 0)
    # twice the areas of the three triangles that the point makes with the edges
    shares = np.stack([u[:, i - 2] * v[:, i - 1] - u[:, i - 1] * v[:, i - 2] for i in range(3)], axis=-1)
    total = shares.sum(axis=-1)
    met = np.all(shares * np.sign(total)[:, None] >= 0, axis=-1) & (total != 0)
    if not met.any():
        return np.inf
    depths = np.einsum("nk,nk->n", shares[met] / total[met, None], offsets[met] @ direction)
    return float(np.min(depths[depths > _BEHIND_M], initial=np.inf))
