"""Published spectra that colour-science carries: LED illuminants, camera responses, ColorChecker."""

import functools

import numpy as np

from uwsim.optics.spectrum import WAVELENGTHS_NM, on_grid


def _colour():
    """Import colour-science where it is used: it takes a second, and warns of optional packages."""
    import warnings

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        import colour
    return colour


def _look_up(table, name: str, *, what: str):
    known = [key for key, curve in table.items() if _covers(curve.wavelengths)]
    if name not in known:
        raise ValueError(f"{what}: got {name!r}, allowed: {', '.join(known)}")
    return table[name]


def _covers(wavelengths_nm: np.ndarray) -> bool:
    return wavelengths_nm[0] <= WAVELENGTHS_NM[0] and wavelengths_nm[-1] >= WAVELENGTHS_NM[-1]


@functools.cache
def illuminant(name: str) -> np.ndarray:
    """Return a relative spectral power distribution with unit integral over 400-700 nm, (61,) [1/nm].

    Names are those of the CIE (`LED-B1` ... `LED-V2`, `D65`, `A`, `E`, `FL1` ...).
    Source: CIE 15:2018 through colour-science.
    """
    curve = _look_up(_colour().SDS_ILLUMINANTS, name, what="illuminant")
    power = on_grid(curve.wavelengths, curve.values, where=f"illuminant {name}")
    return power / np.trapezoid(power, WAVELENGTHS_NM)


@functools.cache
def luminous_efficiency() -> np.ndarray:
    """Return the photopic luminous efficiency V(lambda) relative to its peak at 555 nm, (61,).

    Source: CIE 1924 observer (CIE 15:2018) through colour-science.
    """
    curve = _look_up(_colour().SDS_LEFS, "CIE 1924 Photopic Standard Observer", what="luminous efficiency")
    return on_grid(curve.wavelengths, curve.values, where="luminous efficiency")


@functools.cache
def camera_response(name: str) -> np.ndarray:
    """Return the relative energy response of the bands R, G, B, (61, 3), peak 1 over all bands.

    Source: NPL measurements (Darrodi et al. 2015, J. Opt. Soc. Am. A 32:381) through colour-science.
    """
    curves = _look_up(_colour().MSDS_CAMERA_SENSITIVITIES, name, what="camera response")
    bands = [on_grid(curves.wavelengths, column, where=f"camera {name}") for column in curves.values.T]
    response = np.maximum(np.stack(bands, axis=-1), 0.0)
    return response / response.max()


COLORCHECKER_ROWS, COLORCHECKER_COLUMNS = 4, 6


@functools.cache
def colorchecker() -> tuple[tuple[str, np.ndarray], ...]:
    """Return the 24 patches of the ColorChecker as (name, reflectance (61,)), row by row from `dark skin`.

    Source: average of 30 charts (BabelColor) through colour-science.
    """
    patches = _colour().SDS_COLOURCHECKERS["BabelColor Average"]
    return tuple(
        (name, on_grid(curve.wavelengths, curve.values, where=f"ColorChecker {name}"))
        for name, curve in patches.items()
    )
