"""What a flat port does to the picture, as a figure (matplotlib, imported where it is used)."""

from typing import TYPE_CHECKING

import numpy as np

from uwsim.camera import port as ports
from uwsim.camera.refraction import dot

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def pinhole_error_px(
    pixels_px: np.ndarray, *, port: ports.Port, K: np.ndarray, range_m: float, focal_px: float, centre_m: np.ndarray
) -> np.ndarray:
    """Return how far a pinhole in the water puts points from their pixels (..., 2), (...) [px].

    The points lie at `range_m` from the port on the rays of the pixels. The pinhole is at `centre_m` (3,), looks along
    z, has the principal point of `K` and the focal length `focal_px`.
    """
    origins, directions = ports.rays(pixels_px, port=port, K=K)
    offsets = origins + range_m * directions - centre_m
    seen = K[:2, 2] + focal_px * offsets[..., :2] / np.where(offsets[..., 2:] > 0, offsets[..., 2:], np.nan)
    return np.linalg.norm(seen - pixels_px, axis=-1)


def central_error_px(
    pixels_px: np.ndarray, *, port: ports.Port, K: np.ndarray, range_m: float, fitted_range_m: float,
    centre_m: np.ndarray,
) -> np.ndarray:  # fmt: skip
    """Return the error at `range_m` of a camera with one centre that is exact at `fitted_range_m`, (...) [px].

    What is left when a lens distortion takes up all it can. Pixels (..., 2); `centre_m` (3,) of that camera.
    """
    origins, directions = ports.rays(pixels_px, port=port, K=K)
    offsets = origins + range_m * directions - centre_m
    offsets = offsets / np.linalg.norm(offsets, axis=-1, keepdims=True)
    seen = pixels_px
    # the pixel whose point at the fitted range lies on the same line from the centre
    for _ in range(20):
        origins, directions = ports.rays(seen, port=port, K=K)
        distance = np.linalg.norm(origins + fitted_range_m * directions - centre_m, axis=-1, keepdims=True)
        seen, _ = ports.project(centre_m + distance * offsets, port=port, K=K)
    return np.linalg.norm(seen - pixels_px, axis=-1)


def flat_port_error_figure(
    *, port: ports.Port, K: np.ndarray, width_px: int, height_px: int, fitted_range_m: float = 1.0,
    ranges_m: tuple[float, ...] = (0.2, 0.5, 2.0, 5.0, 20.0),
) -> "Figure":  # fmt: skip
    """Return a figure: ray error of pinhole models over the field, and where the rays meet the port's axis.

    The field goes from the principal point to the lower right corner. Left: the pinhole of the air (dashed) and one
    with the focal length and the centre that rays next to the axis have. Middle: `central_error_px`.
    """
    from matplotlib.figure import Figure

    steps = np.linspace(0, 1, 201)[1:, None]
    pixels = K[:2, 2] + steps * (np.array([width_px, height_px]) - K[:2, 2])
    field_px = np.linalg.norm(pixels - K[:2, 2], axis=-1)
    focal_px = float(ports.effective_focal_px(np.inf, port=port, focal_px=K[0, 0]))
    centre = port.paraxial_crossing_m * port.axis
    common = {"port": port, "K": K}
    figure = Figure(figsize=(13, 4), layout="constrained")
    left, middle, right = figure.subplots(1, 3)
    for index, range_m in enumerate(ranges_m):
        line = {"color": f"C{index}", "label": f"{range_m:g} m"}
        in_air = pinhole_error_px(pixels, range_m=range_m, focal_px=K[0, 0], centre_m=np.zeros(3), **common)
        in_water = pinhole_error_px(pixels, range_m=range_m, focal_px=focal_px, centre_m=centre, **common)
        central = central_error_px(pixels, range_m=range_m, fitted_range_m=fitted_range_m, centre_m=centre, **common)
        left.semilogy(field_px, in_air, "--", color=line["color"])
        left.semilogy(field_px, in_water, **line)
        middle.semilogy(field_px, central, **line)
    left.set(title=f"pinhole of the air (dashed), f = {focal_px:.0f} px in water", ylim=(1e-2, None))
    middle.set(title=f"one centre, any distortion, exact at {fitted_range_m:g} m", ylim=(1e-4, None))
    left.legend(title="range from the port")
    for panel in (left, middle):
        panel.set(xlabel="distance from the principal point [px]", ylabel="error [px]")
    directions = np.concatenate([(pixels - K[:2, 2]) / K[0, 0], np.ones_like(steps)], axis=-1)
    cosine = dot(ports.rays(pixels, **common)[1], port.axis)[..., 0]
    right.plot(np.degrees(np.arccos(np.minimum(cosine, 1))), 1e3 * ports.axis_crossing_m(directions, port=port))
    right.set(title="where a ray meets the port's axis", xlabel="angle in the water to the axis [deg]")
    right.set_ylabel("from the pinhole, towards the water [mm]")
    for panel in (left, middle, right):
        panel.grid(alpha=0.3)
    return figure
