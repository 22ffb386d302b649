"""Named random streams: one frame can be made again alone, a new quantity shifts no other."""

import zlib

import numpy as np


def _sequence(seed: int, frame: int, purpose: str) -> np.random.SeedSequence:
    if seed < 0 or frame < 0:
        raise ValueError(f"seed and frame: got {seed} and {frame}, allowed: integers >= 0")
    return np.random.SeedSequence([seed, frame, zlib.crc32(purpose.encode())])


def generator(seed: int, frame: int, purpose: str) -> np.random.Generator:
    """Return the random generator of one purpose in one frame (seed 0 is a seed like any other)."""
    return np.random.default_rng(_sequence(seed, frame, purpose))


def integer(seed: int, frame: int, purpose: str) -> int:
    """Return a 31-bit integer seed for one purpose in one frame, for code with its own generator."""
    return int(_sequence(seed, frame, purpose).generate_state(1)[0] >> 1)
