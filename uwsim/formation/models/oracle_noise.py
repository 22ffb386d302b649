"""The truth once more with other Monte-Carlo noise: the best score that any model can have.

Source: definition of `standard_error` in `uwsim/dataset/FORMAT.md`.
"""

import numpy as np

from uwsim import seeds
from uwsim.formation.view import View

NEEDS = ("radiance", "standard_error", "direct", "forward_scatter", "backscatter")
PARAMETERS: dict[str, tuple[float, float]] = {}


def layers(
    view: View, *, radiance: np.ndarray, standard_error: np.ndarray, **of_truth: np.ndarray
) -> dict[str, np.ndarray]:
    """Return the frame's layers (H, W, 3), each with its share of normal noise of the frame's standard error."""
    noise = standard_error * seeds.generator(0, 0, "oracle_noise").standard_normal(radiance.shape)
    share = np.divide(noise, radiance, out=np.zeros_like(radiance), where=radiance > 0)
    found = {name: (layer * (1 + share)).astype(np.float32) for name, layer in of_truth.items()}
    return found | {"radiance": sum(found.values())}
