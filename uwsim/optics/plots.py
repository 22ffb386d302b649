"""Pictures of waters and phase functions. Matplotlib is imported where it draws."""

from pathlib import Path

import numpy as np

from uwsim.optics.phase_functions.fournier_forand import petzold_fournier_forand
from uwsim.optics.phase_functions.henyey_greenstein import HenyeyGreenstein
from uwsim.optics.phase_functions.mixture import four_term
from uwsim.optics.phase_functions.petzold import WATERS, petzold
from uwsim.optics.phase_functions.two_term import petzold_two_term
from uwsim.optics.spectrum import WAVELENGTHS_NM
from uwsim.optics.water import Water

_ANGLES_DEG = np.geomspace(0.1, 180, 400)


def _figure(rows: int, columns: int):
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(5 * columns, 3.6 * rows), layout="constrained")
    FigureCanvasAgg(figure)
    return figure, figure.subplots(rows, columns, squeeze=False)


def _save(figure, path: Path) -> None:
    # no date and no version in the file: the same picture has the same bytes
    figure.savefig(path, dpi=110, metadata={"Software": None})


def plot_water(water: Water, path: Path) -> None:
    """Draw a, b, c over wavelength and the phase function at 550 nm beside Petzold's average particle."""
    figure, ((left, right),) = _figure(1, 2)
    for values, name, style in (
        (water.attenuation, "c", "k-"),
        (water.scattering, "b", "C0-"),
        (water.absorption, "a", "C3-"),
    ):
        left.plot(WAVELENGTHS_NM, values, style, label=name)
    left.set(xlabel="wavelength [nm]", ylabel="coefficient [1/m]", title=water.name, ylim=(0, None))
    left.legend()
    middle = int(np.flatnonzero(WAVELENGTHS_NM == 550)[0])
    density = water.phase.density(np.cos(np.radians(_ANGLES_DEG)))[:, middle]
    right.loglog(_ANGLES_DEG, density, "k-", label="this water, 550 nm")
    right.loglog(_ANGLES_DEG, _of(petzold("average")), "C1--", label="Petzold, average particle")
    right.set(xlabel="scattering angle [deg]", ylabel="phase function [1/sr]")
    right.legend()
    _save(figure, path)


def plot_waters(waters: list[Water], path: Path) -> None:
    """Draw a, b and c of several waters, one panel each, logarithmic."""
    figure, (panels,) = _figure(1, 3)
    for panel, name in zip(panels, ("absorption", "scattering", "attenuation"), strict=True):
        for index, water in enumerate(waters):
            panel.semilogy(WAVELENGTHS_NM, getattr(water, name), label=water.name, color=f"C{index % 10}",
                           linestyle=("-", "--", ":")[index // 10 % 3])  # fmt: skip
        panel.set(xlabel="wavelength [nm]", ylabel=f"{name} [1/m]")
    panels[-1].legend(fontsize=6, loc="center left", bbox_to_anchor=(1, 0.5))
    _save(figure, path)


def plot_phase_functions(path: Path) -> None:
    """Draw Petzold's measured phase functions over 0.1-180 deg and what is fitted to each."""
    figure, panels = _figure(2, 2)
    for panel, water in zip(panels.flat, WATERS, strict=True):
        measured = petzold(water)
        panel.loglog(np.degrees(measured.angles_rad), measured.density(measured.angles_rad), "k.", label="measured")
        for name, fit in (
            ("four terms", four_term(water)),
            ("Fournier-Forand", petzold_fournier_forand(water)),
            ("two terms", petzold_two_term(water)),
            ("Henyey-Greenstein", HenyeyGreenstein(measured.mean_cosine)),
        ):
            panel.loglog(_ANGLES_DEG, _of(fit), label=name, linewidth=1)
        panel.set(xlabel="scattering angle [deg]", ylabel="phase function [1/sr]", title=f"Petzold, {water}")
        panel.legend(fontsize=7)
    _save(figure, path)


def _of(phase_function) -> np.ndarray:
    return phase_function.density(np.radians(_ANGLES_DEG))
