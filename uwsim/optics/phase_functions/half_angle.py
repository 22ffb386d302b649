"""s = sin^2(angle / 2), the variable in which the phase functions are written, and inversion of a CDF in it."""

from collections.abc import Callable

import numpy as np


def half_angle_square(angle_rad: np.ndarray) -> np.ndarray:
    """Return sin^2(angle / 2); float32 stays float32. Raises ValueError outside 0 to pi."""
    angle = np.asarray(angle_rad)
    if angle.dtype.kind != "f":
        angle = angle.astype(float)
    if not np.all((angle >= 0) & (angle <= np.asarray(np.pi, angle.dtype))):
        raise ValueError(f"scattering angle: got {_worst(angle, 0, np.pi):g}, allowed: 0 to pi [rad]")
    return np.sin(angle / 2) ** 2


def angle_of(s: np.ndarray) -> np.ndarray:
    """Return the angle whose sin^2(angle / 2) is s. [rad]"""
    return 2 * np.arcsin(np.sqrt(np.clip(s, 0, 1)))


def checked_uniform(uniform: np.ndarray) -> np.ndarray:
    """Return the numbers to be sampled with; ValueError unless within 0 to 1."""
    uniform = np.asarray(uniform)
    if uniform.dtype.kind != "f":
        uniform = uniform.astype(float)
    if not np.all((uniform >= 0) & (uniform <= 1)):
        raise ValueError(f"uniform numbers: got {_worst(uniform, 0, 1):g}, allowed: 0 to 1")
    return uniform


def _worst(values: np.ndarray, low: float, high: float) -> float:
    values = np.atleast_1d(values)
    return values[~((values >= low) & (values <= high))][0]


def invert(cdf: Callable, density: Callable, uniform: np.ndarray, *, iterations: int = 60) -> np.ndarray:
    """Return s with cdf(s) = uniform, by Newton steps in ln s on ln cdf, halving where a step leaves the bracket.

    `cdf(s)`, `density(s)` (derivative of the CDF over 4 pi) take arrays.
    Numbers below 1e-300 count as 1e-300, and s is never below 1e-300, not even for 0.
    """
    target = np.maximum(checked_uniform(uniform).astype(float), 1e-300)
    low, high = np.full(target.shape, np.log(1e-300)), np.zeros(target.shape)
    t = np.full(target.shape, np.log(1e-3))
    for _ in range(iterations):
        s = np.exp(t)
        share = cdf(s)
        low, high = np.where(share < target, t, low), np.where(share < target, high, t)
        step = np.log(np.maximum(share, 1e-300) / target) * share / (4 * np.pi * s * density(s))
        newton = t - step
        inside = (newton > low) & (newton < high)
        new = np.where(inside, newton, (low + high) / 2)
        if np.all(np.abs(new - t) <= 1e-13 * np.maximum(np.abs(t), 1)):
            break
        t = new
    return np.where(checked_uniform(uniform) >= 1, 1.0, np.exp(t))
