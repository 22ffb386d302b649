"""Layouts of the targets' points: the dissertation's, random ones, and a family apart that no method was set on."""

import numpy as np

from uwsim.pose import problems

_TRIANGLE = np.array([[0, 0], [1, 0], [0.5, np.sqrt(0.75)]])
_BOX = np.array([[x, y, z] for x in (0, 1) for y in (0, 0.6) for z in (0, 0.3)], float)
_TURN = np.arange(6) * np.pi / 3

HOLD_OUT = {
    "prism6": np.concatenate([np.column_stack([_TRIANGLE, np.full(3, z)]) for z in (0.0, 0.7)]),
    "box8": _BOX,
    "corner4": np.array([[0, 0, 0], [1, 0, 0], [0, 0.7, 0], [0, 0, 0.4]]),
    "skew5": np.array([[0, 0, 0], [1, 0.1, 0.2], [0.2, 0.9, -0.1], [-0.5, 0.4, 0.6], [0.3, -0.4, 0.5]]),
    "plane6": np.column_stack([np.cos(_TURN), 0.8 * np.sin(_TURN), np.zeros(6)]),
}
"""Edge about 1: prism on a triangle, box, corner of three axes, five points askew, ring in a plane."""
LAYOUTS = problems.LAYOUTS | HOLD_OUT
"""Name -> points (n, 3) of edge 1."""
RANDOM = {"random10": 10, "random": None, "cloud7": 7}
"""Name -> points drawn anew in each trial: in the box before the camera (10, or as many as the sweep says), or about
the target's origin (hold-out)."""
POINTS = {name: len(points) for name, points in LAYOUTS.items()} | RANDOM
CLOUD_M = 0.1
"""Standard deviation of the points of cloud7."""


def is_random(layout: str) -> bool:
    return layout in RANDOM


def is_flat(layout: str) -> bool:
    """Return whether the points of a layout lie in a plane."""
    return not is_random(layout) and bool(np.linalg.matrix_rank(LAYOUTS[layout] - LAYOUTS[layout].mean(axis=0)) < 3)


def size_m(layout: str, edge_m: float | None) -> float | None:
    """Return the edge [m] that depths are compared with; None for points in the box before the camera."""
    return CLOUD_M if layout == "cloud7" else edge_m
