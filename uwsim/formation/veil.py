"""The veiling light of formulas with one colour A at infinity: what the water and the lamps of a view make of it."""

import dataclasses

import numpy as np

from uwsim.formation.airlight import single
from uwsim.formation.view import View

_ROWS, _COLUMNS = 9, 12
_PANELS = 48


def veiling_light(view: View, *, spectral: bool = True) -> np.ndarray:
    """Return A, (3,): light of the lamps scattered once along rays without end, its mean over the picture.

    Radiance in the water. `airlight.single` at infinite range on 9 x 12 of the picture's rays; zeros without rays.
    Formulas with a constant A have no place for what it depends on: the distance of the lamps from the ray.
    """
    rows, columns = (
        np.unique(np.linspace(0, size - 1, count).round().astype(int))
        for size, count in zip(view.shape, (_ROWS, _COLUMNS), strict=True)
    )
    few = np.ix_(rows, columns)
    names = ("origins_m", "directions", "normals", "albedo", "factor")
    part = {name: np.asarray(getattr(view, name))[few] for name in names}
    far = np.full((len(rows), len(columns)), np.inf)
    visibility = None if view.visibility is None else view.visibility[few]
    endless = dataclasses.replace(view, **part, range_m=far, visibility=visibility)
    if not endless.has_ray.any():
        return np.zeros(3)
    light = sum(
        single(endless, lamp, spectral=spectral, panels=_PANELS, stride_px=1).astype(float) for lamp in view.lamps
    )
    return np.zeros(3) + np.mean(light[endless.has_ray], axis=0) if view.lamps else np.zeros(3)
