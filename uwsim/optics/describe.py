"""A water in numbers and in text, for people and for JSON."""

import numpy as np

from uwsim.optics import jerlov
from uwsim.optics.spectrum import WAVELENGTHS_NM
from uwsim.optics.turbidity import approximate_ntu
from uwsim.optics.water import Water, named_water, water_type

ANGLES_DEG = (0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 60.0, 90.0, 120.0, 150.0, 180.0)
"""Angles at which the phase function is listed. [deg]"""

_EVERY_NM = 25.0
_AT_NM = 550.0


def describe(water: Water) -> dict:
    """Return a water's coefficients every 25 nm and what it is at 550 nm, in plain numbers ready for JSON."""
    listed = np.flatnonzero(np.mod(WAVELENGTHS_NM - WAVELENGTHS_NM[0], _EVERY_NM) == 0)
    middle = int(np.flatnonzero(_AT_NM == WAVELENGTHS_NM)[0])
    spectra = {
        "absorption_per_m": water.absorption,
        "scattering_per_m": water.scattering,
        "attenuation_per_m": water.attenuation,
        "backscattering_per_m": water.backscattering,
        "single_scattering_albedo": water.single_scattering_albedo,
    }
    return {
        "name": water.name,
        "wavelengths_nm": WAVELENGTHS_NM[listed].tolist(),
        **{name: values[listed].tolist() for name, values in spectra.items()},
        "at_550_nm": {
            **{name: float(values[middle]) for name, values in spectra.items()},
            "mean_cosine": float(water.phase.mean_cosine[middle]),
            "backscatter_fraction": float(water.phase.backscatter_fraction[middle]),
            "approximate_turbidity_ntu": approximate_ntu(float(water.scattering[middle])),
            "phase_angles_deg": list(ANGLES_DEG),
            "phase_per_sr": water.phase.density(np.cos(np.radians(ANGLES_DEG)))[:, middle].tolist(),
        },
    }


def describe_named(name: str, *, particle_factor: float = 1.0, source: str | None = None) -> dict:
    """Return `describe` of a named water with its `description` and `source`."""
    water = named_water(name, particle_factor=particle_factor, source=source)
    kind = water_type(name)
    cited = kind.source if source is None else jerlov.SOURCES[source]
    return {**describe(water), "description": kind.description, "source": cited}


def as_text(numbers: dict) -> str:
    """Return the numbers of `describe` as lines of text, columns aligned."""
    columns = ("absorption_per_m", "scattering_per_m", "attenuation_per_m", "single_scattering_albedo")
    head = [line for line in (numbers["name"], numbers.get("description"), numbers.get("source")) if line]
    table = [f"{'nm':>5} {'a /m':>9} {'b /m':>9} {'c /m':>9} {'b/c':>7}"]
    for i, wavelength in enumerate(numbers["wavelengths_nm"]):
        a, b, c, albedo = (numbers[column][i] for column in columns)
        table.append(f"{wavelength:5.0f} {a:9.5f} {b:9.5f} {c:9.5f} {albedo:7.4f}")
    middle = numbers["at_550_nm"]
    shape = [
        "at 550 nm:",
        f"  mean cosine {middle['mean_cosine']:.4f}, backscatter fraction {middle['backscatter_fraction']:.4f}, "
        f"b_b {middle['backscattering_per_m']:.5f} /m",
        f"  turbidity about {middle['approximate_turbidity_ntu']:.2g} NTU (within a factor of 2)",
        f"  {'angle deg':>9} {'p 1/sr':>11}",
    ]
    pairs = zip(middle["phase_angles_deg"], middle["phase_per_sr"], strict=True)
    return "\n".join([*head, "", *table, "", *shape, *(f"  {angle:9.1f} {value:11.4g}" for angle, value in pairs)])
