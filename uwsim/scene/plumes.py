"""Bodies of water in a scene that differ from the water around: layers, plumes and measured grids of particles."""

from pathlib import Path
from typing import Annotated, Literal, NamedTuple

import numpy as np
from pydantic import Field, model_validator

from uwsim.scene.base import Positive, Strict, Vector3
from uwsim.scene.water import NamedWater, TabulatedWater, TurbidWater

_WIDE_M = 500.0  # half width of a layer, which stands for one without end
_SIGMAS = 3.0
_CELLS_PER_SIGMA = 4


class Cells(NamedTuple):
    """Shares of an added water, constant in cells: edges (n + 1,) along world x, y, z [m]; values (nx, ny, nz)."""

    edges_m: tuple[np.ndarray, np.ndarray, np.ndarray]
    values: np.ndarray


class _Added(Strict):
    """Water whose absorption and scattering come on top of those of the scene's water."""

    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9_-]+$")]
    water: NamedWater | TurbidWater | TabulatedWater


class Layer(_Added):
    """A horizontal layer, the same everywhere between two depths below the surface."""

    kind: Literal["layer"]
    top_water_depth_m: Annotated[float, Field(ge=0, le=1000)]
    bottom_water_depth_m: Annotated[float, Field(gt=0, le=1000)]

    @model_validator(mode="after")
    def _ordered(self):
        if self.bottom_water_depth_m <= self.top_water_depth_m:
            raise ValueError(
                f"bottom_water_depth_m is {self.bottom_water_depth_m:g}, allowed: above top_water_depth_m "
                f"({self.top_water_depth_m:g})"
            )
        return self

    @property
    def cells(self) -> Cells:
        wide = np.array([-_WIDE_M, _WIDE_M])
        depth = np.array([-self.bottom_water_depth_m, -self.top_water_depth_m])
        return Cells((wide, wide, depth), np.ones((1, 1, 1)))


class Plume(_Added):
    """A cloud, densest in its centre, Gaussian along the world's axes; cut at three standard deviations."""

    kind: Literal["plume"]
    position_m: Vector3
    sigma_m: tuple[Positive, Positive, Positive]

    @property
    def cells(self) -> Cells:
        steps = np.linspace(-_SIGMAS, _SIGMAS, int(2 * _SIGMAS * _CELLS_PER_SIGMA) + 1)
        edges = tuple(p + s * steps for p, s in zip(self.position_m, self.sigma_m, strict=True))
        middle = np.exp(-0.5 * ((steps[1:] + steps[:-1]) / 2) ** 2)
        return Cells(edges, middle[:, None, None] * middle[None, :, None] * middle[None, None, :])


class Grid(_Added):
    """Shares from a NumPy file (nx, ny, nz), 0 to 1, in equal cells of the box between two corners."""

    kind: Literal["grid"]
    file: Annotated[Path, Field(strict=False)]
    low_m: Vector3
    high_m: Vector3

    @model_validator(mode="after")
    def _usable(self):
        if not all(low < high for low, high in zip(self.low_m, self.high_m, strict=True)):
            raise ValueError(f"low_m is {self.low_m}, allowed: below high_m {self.high_m} along every axis")
        _ = self.cells
        return self

    @property
    def cells(self) -> Cells:
        values = _read_array(self.file)
        if values.ndim != 3 or not np.all(np.isfinite(values) & (values >= 0) & (values <= 1)):
            raise ValueError(f"file {self.file}: got shape {values.shape}, allowed: three axes, values 0 to 1")
        corners = zip(self.low_m, self.high_m, values.shape, strict=True)
        return Cells(tuple(np.linspace(low, high, count + 1) for low, high, count in corners), values.astype(float))


def _read_array(path: Path) -> np.ndarray:
    try:
        return np.load(path, allow_pickle=False)
    except (OSError, ValueError) as error:
        raise ValueError(f"file {path}: not readable as a NumPy array: {error}") from None


AddedWater = Annotated[Layer | Plume | Grid, Field(discriminator="kind")]

_MOST_CELLS = 1 << 24


def merged(added: tuple[AddedWater, ...]) -> tuple[tuple[np.ndarray, ...], np.ndarray]:
    """Return common edges along x, y, z and the shares of all added waters in their cells, (n, nx, ny, nz).

    Exact: every edge of every water is an edge of the common grid. Raises ValueError above 16.8 million cells.
    """
    parts = [water.cells for water in added]
    edges = tuple(np.unique(np.concatenate([part.edges_m[axis] for part in parts])) for axis in range(3))
    count = int(np.prod([len(e) - 1 for e in edges])) * len(parts)
    if count > _MOST_CELLS:
        raise ValueError(f"added_water: makes {count} cells together, allowed: {_MOST_CELLS} (memory); use fewer")
    return edges, np.stack([_resampled(part, edges) for part in parts])


def _resampled(part: Cells, edges: tuple[np.ndarray, ...]) -> np.ndarray:
    """Return shares in the cells of finer edges; 0 outside."""
    indices, inside = [], []
    for own, common in zip(part.edges_m, edges, strict=True):
        middle = (common[1:] + common[:-1]) / 2
        indices.append(np.clip(np.searchsorted(own, middle) - 1, 0, len(own) - 2))
        inside.append((middle > own[0]) & (middle < own[-1]))
    return part.values[np.ix_(*indices)] * (
        inside[0][:, None, None] & inside[1][None, :, None] & inside[2][None, None, :]
    )
