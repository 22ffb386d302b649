"""Truth images as pictures: through the frame's camera, or in false colour with a bar."""

import numpy as np

from uwsim.bench.page.markup import escape, figure, picture
from uwsim.bench.task import through_camera
from uwsim.dataset.frame import Frame
from uwsim.images import srgb_uint8_from_linear
from uwsim.look import EMPTY, colour_map, false_colour, instance_colours, limits, normal_colours

_BAR_STOPS = 9


def bar(low: float, high: float, unit: str) -> str:
    """Return the colour bar: both ends with the unit."""
    stops = colour_map(np.linspace(0, 1, _BAR_STOPS))
    gradient = ", ".join(f"rgb({r} {g} {b})" for r, g, b in stops.tolist())
    suffix = f" {escape(unit)}" if unit else ""
    return (
        f'<div class="bar"><span>{low:.3g}{suffix}</span>'
        f'<i style="background:linear-gradient(90deg, {gradient})"></i><span>{high:.3g}{suffix}</span></div>'
    )


def map_figure(values: np.ndarray, title: str, caption: str, *, unit: str, ends: tuple[float, float], alt: str) -> str:
    """Return a small false-colour figure with its colour bar."""
    image = picture(false_colour(values, *ends), alt, lossless=True)
    return figure(image + bar(*ends, unit), title, escape(caption))


LAYERS = (
    ("direct", "Direct", "light that came straight from a body; same camera and exposure for all layers"),
    ("forward_scatter", "Forward scatter", "light of the bodies, scattered on its way"),
    ("backscatter", "Backscatter", "light that met no body"),
    ("direct_unscattered", "Direct, unscattered", "of the direct light, what met no particle on its way to the body"),
    ("backscatter_single", "Backscatter, single", "of the backscatter, what met one particle and no other"),
)
"""The last two where the frame has them."""


def layer_figures(frame: Frame) -> list[str]:
    """Return the truth of a frame as small multiples with captions and units."""
    range_m, z_depth_m = frame.buffer("range"), frame.buffer("z_depth")
    ends = limits(np.concatenate([range_m, z_depth_m]))
    radiance = frame.buffer("radiance")[..., 1]
    with np.errstate(divide="ignore", invalid="ignore"):
        error_percent = 100 * frame.buffer("standard_error")[..., 1] / radiance
    transmission = frame.buffer("transmission")[..., 1]
    return [
        map_figure(
            range_m, "Range", "along the ray; grey: no body seen", unit="m", ends=ends, alt="Map of the range"
        ),
        map_figure(z_depth_m, "Depth", "along the optical axis", unit="m", ends=ends, alt="Map of the depth"),
        *(
            figure(picture(through_camera(frame, layer), f"The layer {title} alone"), title, _share(frame, layer, text))
            for layer, title, text in LAYERS
            if layer in frame.buffer_names
        ),
        map_figure(
            transmission, "Transmission",
            "share of the lamps' light neither absorbed nor scattered on lamp-body-camera; green band",
            unit="", ends=limits(transmission, from_zero=True), alt="Map of the transmission",
        ),
        map_figure(
            error_percent, "Monte-Carlo standard error", "of the radiance, relative to it; green band",
            unit="%", ends=limits(error_percent, from_zero=True), alt="Map of the relative standard error",
        ),
        figure(
            picture(srgb_uint8_from_linear(frame.buffer("albedo")), "The albedo"), "Albedo",
            "diffuse reflectance, weighted by the camera response; black: none or no body",
        ),
        figure(
            picture(normal_colours(frame.buffer("normal")), "The surface normals as colours", lossless=True), "Normals",
            "world axes x, y, z as red, green, blue from -1 to 1; grey: no body seen",
        ),
        _instances(frame),
    ]  # fmt: skip


def _share(frame: Frame, layer: str, words: str) -> str:
    """Return the caption of a layer: what it is, its share of the radiance, and whether it was denoised."""
    total = float(frame.buffer("radiance")[..., 1].sum())
    share = f"; {100 * float(frame.buffer(layer)[..., 1].sum()) / total:.2g} % of the light (green)" if total else ""
    options = frame.info.options
    denoised = f"; denoised, biased: {options.denoiser}" if layer in options.denoised_layers else ""
    return escape(f"{words}{share}{denoised}")


def _instances(frame: Frame) -> str:
    numbers = frame.buffer("instance")
    present = [int(number) for number in np.unique(numbers) if number]
    colours = instance_colours(len(present))
    image = np.full((*numbers.shape, 3), EMPTY, np.uint8)
    names = {body.instance: body.name for body in frame.info.bodies}
    keys = []
    for colour, number in zip(colours, present, strict=True):
        image[numbers == number] = colour
        r, g, b = colour.tolist()
        keys.append(f'<li><i style="background:rgb({r} {g} {b})"></i>{escape(names.get(number, number))}</li>')
    content = picture(image, "Which body each pixel sees", lossless=True)
    return figure(content, "Bodies", f'<ul class="keys">{"".join(keys)}</ul>')
