"""The image formation turned around with true backscatter and true transmission: an oracle.

J = (I - B) / max(t, t0) in linear light. It knows what a method has to guess, but not how much to trust it:
where little light comes back it divides noise by a small number, so in dark water it can fall below the raw
image.

Source: direct light + backscatter of Jaffe, IEEE J. Oceanic Engineering 15(2), 1990, solved for the object;
t0 as the floor of the transmission in He, Sun, Tang, IEEE Trans. PAMI 33(12), 2011.
"""

import numpy as np

INPUT = "linear_float32"
NEEDS = ("backscatter", "transmission")

# gain is limited to 10; a smaller floor brightens distant noise, a larger one leaves distant objects dark
SMALLEST_TRANSMISSION = 0.1


def restore(image: np.ndarray, *, backscatter: np.ndarray, transmission: np.ndarray) -> np.ndarray:
    """Return the linear image (H, W, 3) float32 in [0, 1] without the water.

    `backscatter` (H, W, 3) in the units of the image, `transmission` (H, W, 3) in [0, 1]. Where the
    transmission is 0 no body is seen, there is nothing to restore, and the result is 0. Other shapes or NaN
    raise ValueError.
    """
    for name, values in (("backscatter", backscatter), ("transmission", transmission)):
        if np.shape(values) != image.shape or not np.all(np.isfinite(values)):
            raise ValueError(f"oracle_inverse: {name} is {np.shape(values)}, allowed: finite, shape {image.shape}")
    restored = (image - backscatter) / np.maximum(transmission, SMALLEST_TRANSMISSION)
    return np.where(transmission > 0, np.clip(restored, 0, 1), 0).astype(np.float32)
