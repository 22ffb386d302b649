"""Seeded smooth noise in space: gradient noise and sums of its octaves.

Source: Perlin 1985, SIGGRAPH Comput. Graph. 19:287 (an image synthesizer); the fifth-order blend is that of Perlin
2002, ACM Trans. Graph. 21:681.
"""

import numpy as np

_CELLS = 256  # after which the noise repeats


def gradient_noise(points: np.ndarray, *, rng: np.random.Generator) -> np.ndarray:
    """Return noise (n,) of mean 0 and within [-1, 1] at points (n, 3); features have a size of about 1."""
    order = rng.permutation(_CELLS)
    slopes = rng.normal(size=(_CELLS, 3))
    slopes /= np.linalg.norm(slopes, axis=-1, keepdims=True)
    cell = np.floor(points).astype(np.int64)
    inside = points - cell
    blend = inside**3 * (inside * (inside * 6 - 15) + 10)
    found = np.zeros(len(points))
    for corner in np.ndindex(2, 2, 2):
        x, y, z = (cell + corner).T % _CELLS
        slope = slopes[order[(order[(order[x] + y) % _CELLS] + z) % _CELLS]]
        weight = np.prod(np.where(corner, blend, 1 - blend), axis=-1)
        found += weight * np.einsum("ni,ni->n", slope, inside - corner)
    return found


def fractal_noise(
    points: np.ndarray, *, octaves: int, rng: np.random.Generator, gain: float = 0.5
) -> np.ndarray:  # fmt: skip
    """Return the sum of octaves of noise (n,) at points (n, 3): each twice as fine and `gain` times as strong.

    The first has strength 1. Raises ValueError unless there is at least one octave.
    """
    if octaves < 1:
        raise ValueError(f"octaves: got {octaves}, allowed: at least 1")
    # shifted, so that the zeros of the octaves' lattices do not coincide
    return sum(
        gain**octave * gradient_noise(points * 2.0**octave + rng.uniform(0, _CELLS, 3), rng=rng)
        for octave in range(octaves)
    )


def contrast(noise: np.ndarray, *, threshold: float, softness: float) -> np.ndarray:
    """Return shares in [0, 1] of noise: 1/2 at the threshold, 0 and 1 at `softness` below and above it."""
    ramp = np.clip((noise - threshold) / (2 * softness) + 0.5, 0, 1)
    return ramp * ramp * (3 - 2 * ramp)
