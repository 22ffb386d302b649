"""The picture without water: what a model that does nothing is worth.

Source: definition of the twin in `uwsim/dataset/FORMAT.md`.
"""

import numpy as np

from uwsim.formation.view import View

NEEDS = ("water_free",)
PARAMETERS: dict[str, tuple[float, float]] = {}


def layers(view: View, *, water_free: np.ndarray) -> dict[str, np.ndarray]:
    """Return the frame's twin without water (H, W, 3) as direct light, and no scattered light."""
    nothing = np.zeros_like(water_free)
    return {
        "direct": water_free, "forward_scatter": nothing, "backscatter": nothing, "radiance": water_free
    }  # fmt: skip
