"""The optics page: what `uwsim.optics` and `uwsim.camera` say, in figures and numbers, with the table of equations."""

from pathlib import Path

import numpy as np

from uwsim.camera import port as ports
from uwsim.camera.flat_port import FlatPort
from uwsim.camera.pinhole import camera_matrix
from uwsim.files import PACKAGE, write_text
from uwsim.optics import beam_profile, fresnel, lamp_plots, plots, refractive_index, window_field
from uwsim.optics.spectrum import WAVELENGTHS_NM
from uwsim.optics.water import Water, named_water, water_type_names
from uwsim.optics.window import FlatWindow

_SHOWN_NM = (450.0, 550.0, 650.0)
_GAP_M, _GLASS_M = 0.010, 0.005


def write(folder: Path) -> None:
    """Write README.md and its four figures into an existing folder."""
    waters = [named_water(name) for name in water_type_names()]
    plots.plot_waters(waters, folder / "waters.png")
    plots.plot_phase_functions(folder / "phase_functions.png")
    beam, window, port, K = _examples()
    lamp_plots.lamp_field_figure(beam, window).savefig(folder / "lamp_field.png", dpi=110)
    from uwsim.camera.port_plots import flat_port_error_figure

    figure = flat_port_error_figure(port=port, K=K, width_px=1280, height_px=720)
    figure.savefig(folder / "flat_port.png", dpi=110)
    parts = [_INTRODUCTION, _waters(waters), _window(), _lamp(beam, window), _port(port, K)]
    equations = (PACKAGE / "optics" / "EQUATIONS.md").read_text(encoding="utf-8")
    write_text(folder / "README.md", "\n\n".join([*parts, equations.replace("\n#", "\n##").replace("# ", "## ", 1)]))


_INTRODUCTION = """# Optics

Made by `uwsim optics --out results/optics`. Sources of all tables stand in the headers of `uwsim/optics/data` and in
the water types. `tests/physics` checks what is shown here against closed forms, published tables and
independent evaluations."""


def _examples():
    n_glass = float(refractive_index.glass_nbk7(np.array([587.6]))[0])
    window = FlatWindow(air_gap_m=_GAP_M, thickness_m=_GLASS_M, n_glass=n_glass, n_water=1.34)
    beam = beam_profile.Beam(1.0, beam_profile.lambertian(half_angle_deg=60.0))
    port = FlatPort(gap_m=0.030, thickness_m=0.010, n_glass=n_glass, n_water=1.34)
    return beam, window, port, camera_matrix(width_px=1280, height_px=720, horizontal_fov_deg=80.0)


def _row(cells) -> str:
    return "| " + " | ".join(cells) + " |"


def _table(head: list[str], rows: list[list[str]]) -> str:
    return "\n".join([_row(head), _row(["---"] * len(head)), *map(_row, rows)])


def _waters(waters: list[Water]) -> str:
    index = [list(WAVELENGTHS_NM).index(nm) for nm in _SHOWN_NM]
    head = ["water", *(f"a({nm:.0f})" for nm in _SHOWN_NM), *(f"b({nm:.0f})" for nm in _SHOWN_NM)]
    head += ["c(550)", "b/c(550)", "mean cosine(550)"]
    rows = []
    for water in waters:
        middle = index[1]
        numbers = [*water.absorption[index], *water.scattering[index], water.attenuation[middle]]
        numbers += [water.single_scattering_albedo[middle], water.phase.mean_cosine[middle]]
        rows.append([f"`{water.name}`", *(f"{number:.3g}" for number in numbers)])
    text = "## Waters\n\nCoefficients in 1/m. `uwsim water NAME` prints and draws one of them.\n\n" + _table(head, rows)
    text += "\n\n![a, b, c of every named water](waters.png)\n\n"
    return text + "![Phase functions against Petzold's measurements](phase_functions.png)"


def _window() -> str:
    n_glass = float(refractive_index.glass_nbk7(np.array([587.6]))[0])
    angles = np.array([0.0, 20.0, 40.0, 50.0, 60.0, 70.0, 80.0])
    slab = fresnel.slab(np.radians(angles), n_in=1.0, n_slab=n_glass, n_out=1.34)
    rows = [
        [f"{a:.0f}", f"{t:.4f}", f"{r:.4f}"]
        for a, t, r in zip(angles, slab.transmittance, slab.reflectance, strict=True)
    ]
    text = "## Window: air, BK7, water (n = 1.34)\n\nUnpolarised, with inter-reflections, clear glass.\n\n"
    return text + _table(["angle in air [deg]", "transmittance", "reflectance"], rows)


def _lamp(beam, window) -> str:
    angles = np.array([0.0, 10.0, 20.0, 30.0, 40.0])
    lateral = np.stack([np.tan(np.radians(angles)), np.zeros(len(angles))], axis=-1)
    field = window_field.exact_field(
        beam, window, lateral_m=lateral, depth_m=np.ones(len(angles)), attenuation_per_m=0.0
    )
    rows = [[f"{a:.0f}", f"{e:.4f}"] for a, e in zip(angles, field.irradiance_w_per_m2, strict=True)]
    text = "## Lamp behind a flat window\n\nLambertian lamp of 1 W/sr, 10 mm of air, 5 mm of BK7, clear water; "
    text += "irradiance on the plane 1 m from the window, at the point in that direction from the window's centre.\n\n"
    text += _table(["direction [deg]", "irradiance [W/m^2]"], rows)
    return text + "\n\n![Lamp field: printed, corrected and exact](lamp_field.png)"


def _port(port, K) -> str:
    far = float(ports.effective_focal_px(np.inf, port=port, focal_px=K[0, 0]))
    text = "## Camera behind a flat port\n\n1280 x 720 pixels, 80 deg in air, 30 mm of air, 10 mm of BK7: focal length "
    text += f"{K[0, 0]:.1f} px in air, {far:.1f} px near the axis in water for far points.\n\n"
    return text + "![Error of pinhole models over the field](flat_port.png)"
