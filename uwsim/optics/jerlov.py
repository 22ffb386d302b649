"""Jerlov's water types: absorption, scattering and diffuse attenuation from the published tables."""

import numpy as np

from uwsim.optics import tables

TYPES = ("I", "IA", "IB", "II", "III", "1C", "3C", "5C", "7C", "9C")
SOURCES = {
    "williamson2022": "Williamson & Hollins 2022, Appl. Opt. 61:9951 (OGL v3.0, (c) Crown copyright, Dstl)",
    "solonenko2015": "Solonenko & Mobley 2015, Appl. Opt. 54:5392",
}
"""Rival tables of absorption and scattering: name -> citation."""

KD_SOURCES = ("jerlov1976", "austin1986")
_WILLIAMSON = ("IB", "II", "III", "1C", "3C", "5C")


def default_source(water_type: str) -> str:
    """Return the source a type has when none is asked for: Williamson & Hollins where they give the type."""
    _check(water_type, TYPES, "Jerlov type")
    return "williamson2022" if water_type in _WILLIAMSON else "solonenko2015"


def coefficients(
    water_type: str, wavelengths_nm: np.ndarray, *, source: str | None = None
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """Return absorption and scattering of a type, wavelengths (...,) -> 2 x (...,). [1/m]

    `williamson2022`: types IB-5C, 300-800 nm on 5 nm, measured 412-715 nm, extrapolated by their model elsewhere.
    `solonenko2015`: all types, 300-700 nm on 10-40 nm, linear between (coarse at 575-600 nm, where water itself rises).
    Source: Williamson & Hollins 2022, Appl. Opt. 61:9951; Solonenko & Mobley 2015, Appl. Opt. 54:5392.
    Errata: Table 7 of the latter repeats rows, a of 3C (675, 700 nm) and 5C (600-700 nm) is lost: refused.
    Valid: the two disagree on b by a factor up to 3.4 (III at 550 nm: 0.287 against 0.98 /m), for a type is defined by
    K_d, which fixes neither b nor the phase function. Solonenko's b of I and IA is about that of sea water itself.
    In the red a lies below this project's pure water (`pure_water.absorption_merged`) by up to 9 %: I at 660 nm 0.374
    against 0.410 /m, linear between Solonenko's steps of 25 nm; at 700 nm IB and II by 8 %, III 7 %, 1C 6 %.
    a of IB at 450 nm (Williamson & Hollins), 0.0407 /m, lies above Jerlov's K_d of that type, 0.036 /m.
    """
    source = default_source(water_type) if source is None else source
    _check(water_type, TYPES, "Jerlov type")
    _check(source, tuple(SOURCES), f"Jerlov type {water_type}: source")
    where = f"Jerlov type {water_type} ({source})"
    if source == "williamson2022":
        _check(water_type, _WILLIAMSON, "Jerlov type of williamson2022")
        nm = tables.column("jerlov_williamson2022", "wavelength_nm")
        pair = [tables.column("jerlov_williamson2022", f"{x}_{water_type}_per_m") for x in "ab"]
    else:
        rows = [row for row in tables.rows("jerlov_solonenko2015") if row["water_type"] == water_type]
        nm = np.array([float(row["wavelength_nm"]) for row in rows])
        pair = [
            np.array([float(row[key] or "nan") for row in rows]) for key in ("absorption_per_m", "scattering_per_m")
        ]
    a, b = (tables.interpolate(wavelengths_nm, nm, values, where=where) for values in pair)
    return a, b


def diffuse_attenuation(
    water_type: str, wavelengths_nm: np.ndarray, *, source: str = "jerlov1976"
) -> np.ndarray:  # fmt: skip
    """Return K_d of downward irradiance near the surface, wavelengths (...,) -> (...,). [1/m]

    Not a beam attenuation: a < K_d < c. `jerlov1976` all types, `austin1986` (350-700 nm) I to 1C; linear between.
    Source: Jerlov 1976, Marine Optics, Table XXVII; Austin & Petzold 1986, Opt. Eng. 25:471, Table VI.
    """
    _check(source, KD_SOURCES, "Jerlov K_d: source")
    name = f"jerlov_kd_{source}"
    _check(water_type, tuple(tables.rows(name)[0])[1:], f"Jerlov type of {source}")
    return tables.spectrum(name, water_type, wavelengths_nm)


def _check(got: str, allowed: tuple[str, ...], what: str) -> None:
    if got not in allowed:
        raise ValueError(f"{what}: got {got!r}, allowed: {', '.join(allowed)}")
