"""Diffuse reflectance of named materials."""

import functools

import numpy as np

from uwsim.optics import tables
from uwsim.optics.spectrum import WAVELENGTHS_NM

_TABLE = "surfaces"


def material_names() -> list[str]:
    """Return the materials whose reflectance is known."""
    return [key for key in tables.rows(_TABLE)[0] if key != "wavelength_nm"]


@functools.cache
def material_reflectance(name: str) -> np.ndarray:
    """Return the diffuse reflectance of a material over wavelength, (61,); ValueError names what there is.

    Source: stated per material in `uwsim/optics/data/surfaces.csv` (RELAB, ASTER, PROSAIL, PROSPECT-D).
    Valid: 400-700 nm, in air; linear between the printed 10 nm.
    """
    if name not in material_names():
        raise ValueError(f"material: got {name!r}, allowed: {', '.join(material_names())}")
    reflectance = tables.spectrum(_TABLE, name, WAVELENGTHS_NM)
    reflectance.setflags(write=False)
    return reflectance
