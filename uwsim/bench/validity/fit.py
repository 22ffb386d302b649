"""Parameters of a formation model fitted to a rendered picture."""

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from uwsim.formation.view import View

MOST_STEPS = 5  # of the solver, each of one call per parameter and one more
_RATIO = 20.0  # of high to low, from which on a parameter is searched by its logarithm
Layers = Callable[..., Mapping[str, np.ndarray]]


@dataclass(frozen=True)
class Fit:
    """`parameters` to give to the model; `calls` of the model that it took."""

    parameters: dict[str, float | tuple[float, ...]]
    calls: int

    @property
    def text(self) -> str:
        """One line: name = value, ..."""
        listed = {name: np.atleast_1d(value) for name, value in self.parameters.items()}
        return ", ".join(f"{name} = {' '.join(f'{one:.4g}' for one in value)}" for name, value in listed.items())


def fit(
    layers: Layers, bounds: Mapping[str, tuple], *, view: View, target: np.ndarray, compose: Callable
) -> Fit:  # fmt: skip
    """Return the parameters with which a model comes nearest to a target, by least squares within bounds.

    `bounds`: name -> (low, high), numbers or, for a parameter of several numbers, sequences of them. `compose` makes of
    what the model returns what is held against `target`, of its shape. Started from the middle of the bounds, and from
    the function's own default where that is a number; the better end counts. The model's default parameters are kept
    where neither is better. Raises ValueError for bounds that are none.
    """
    search = _Search(layers, _ranges(bounds), view, target, compose)
    best = (search.cost_of({}), {})
    for start in search.starts():
        found = least_squares(search.residuals, start, bounds=(0, 1), max_nfev=MOST_STEPS, diff_step=0.01, ftol=1e-3)
        best = min(best, (float(found.cost), search.parameters(found.x)), key=lambda pair: pair[0])
    return Fit(parameters=best[1], calls=search.calls)


@dataclass
class _Search:
    """The model as a function of numbers between 0 and 1."""

    layers: Layers
    ranges: dict[str, tuple[np.ndarray, np.ndarray]]
    view: View
    target: np.ndarray
    compose: Callable
    calls: int = 0

    def parameters(self, unit: np.ndarray) -> dict[str, float | tuple[float, ...]]:
        found, place = {}, 0
        for name, (low, high) in self.ranges.items():
            share = np.asarray(unit[place : place + low.size])
            place += low.size
            value = low * (high / low) ** share if _logarithmic(low, high) else low + (high - low) * share
            found[name] = tuple(value.tolist()) if low.ndim else float(value[0])
        return found

    def starts(self) -> list[np.ndarray]:
        """Return the middle of the ranges, and the defaults of the function if they are numbers inside them."""
        sizes = [low.size for low, _ in self.ranges.values()]
        starts = [np.full(sum(sizes), 0.5)]
        known = inspect.signature(self.layers).parameters
        units = []
        for name, (low, high) in self.ranges.items():
            default = known[name].default if name in known else None
            if isinstance(default, bool) or not isinstance(default, int | float):
                return starts
            if np.any(default < low) or np.any(default > high):
                return starts
            if _logarithmic(low, high):
                units.append(np.atleast_1d(np.log(default / low) / np.log(high / low)))
            else:
                units.append(np.atleast_1d((default - low) / (high - low)))
        return [*starts, np.clip(np.concatenate(units), 1e-3, 1 - 1e-3)]

    def residuals(self, unit: np.ndarray) -> np.ndarray:
        return self._residuals(self.parameters(unit))

    def cost_of(self, parameters: dict) -> float:
        return 0.5 * float(np.square(self._residuals(parameters)).sum())

    def _residuals(self, parameters: dict) -> np.ndarray:
        self.calls += 1
        found = self.compose(self.layers(self.view, **parameters))
        return ((found - self.target) / np.sqrt(np.square(self.target, dtype=float).sum())).ravel()


def _ranges(bounds: Mapping[str, tuple]) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    found = {name: tuple(np.asarray(end, float) for end in ends) for name, ends in bounds.items()}
    for name, ends in found.items():
        good = len(ends) == 2 and ends[0].shape == ends[1].shape and ends[0].ndim <= 1 and np.all(ends[0] < ends[1])
        if not good:
            raise ValueError(f"PARAMETERS: {name} is {bounds[name]}, allowed: (low, high), low below high")
    return found


def _logarithmic(low: np.ndarray, high: np.ndarray) -> bool:
    return bool(np.all(low > 0) and np.all(high >= _RATIO * low))
