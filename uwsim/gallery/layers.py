"""The buffers of a frame as pictures that can be looked at, each with the words and the scale that belong to it."""

from dataclasses import dataclass, field

import numpy as np

from uwsim.camera import sensor_record
from uwsim.camera.sensor import linear_from_radiance
from uwsim.dataset.frame import Frame
from uwsim.images import srgb_uint8_from_linear
from uwsim.look import EMPTY, false_colour, instance_colours, limits, normal_colours

GREEN = 1
_WHITE_SHARE = 0.8
_DIM = 0.2
_HIGHEST_GAIN = 64


@dataclass(frozen=True, kw_only=True)
class Layer:
    """One picture of the layer switch.

    picture  (H, W, 3) uint8
    exact    whether its colours stand for numbers of their own (kept without loss, never averaged)
    gain     how many times brighter than the camera's picture it is shown
    scale    {low, high, unit} of a false-colour picture; {longest_px} of a displacement; empty: none
    """

    key: str
    title: str
    group: str
    caption: str
    picture: np.ndarray
    exact: bool = False
    gain: int = 1
    scale: dict = field(default_factory=dict)


_PICTURES = {
    "radiance": ("Radiance", "what the camera would store without sensor noise, mosaic and quantisation"),
    "sharp": ("Sharp twin", "a momentary exposure at mid-exposure, in the same water; no sensor noise"),
    "water_free": ("Clear (no water)", "same scene, rays, lamps and exposure without absorption and scattering"),
}
_LIGHT = {
    "direct": ("Direct", "light that came straight from a body"),
    "forward_scatter": ("Forward scatter", "light of the bodies, scattered on its way"),
    "backscatter": ("Backscatter", "light that met no body"),
    "direct_unscattered": ("Direct, unscattered", "of the direct light, what met no particle on its way to the body"),
    "backscatter_single": ("Backscatter, single", "of the backscatter, what met one particle and no other"),
}
_MADE_ELSEWHERE = ("transmission", "standard_error", "range", "z_depth", "normal", "albedo", "instance")
_FLOW = ("flow_start", "flow_end")


def layers_of(frame: Frame) -> list[Layer]:
    """Return all that a frame has to show, in the order of the switch."""
    names = frame.buffer_names
    image = Layer(
        key="image", title="Image", group="Picture", picture=frame.image, caption="what the camera stores: 8-bit sRGB"
    )
    known = {*_PICTURES, *_LIGHT, *_MADE_ELSEWHERE, *_FLOW}
    return [
        image,
        *(_radiance(frame, name, group="Picture") for name in _PICTURES if name in names),
        *(_radiance(frame, name, group="Light") for name in _LIGHT if name in names),
        *_light_maps(frame),
        *_geometry(frame),
        *([_flow(frame)] if set(_FLOW) <= set(names) else []),
        *(_other(frame, name) for name in names if name not in known),
    ]


def linear_picture(frame: Frame, name: str) -> np.ndarray:
    """Return a radiance buffer through the frame's camera, (H, W, 3) float32, 1 = white, noise-free, not clipped."""
    camera = frame.info.camera
    constants = sensor_record.constants(
        frame.info.sensor.model_dump(), K=frame.K, width_px=camera.width_px, height_px=camera.height_px
    )
    return linear_from_radiance(np.maximum(frame.buffer(name), 0), **constants)


def gain_for(linear: np.ndarray) -> int:
    """Return the power of two by which a dim layer is shown brighter; 1 if its bright parts are seen anyway."""
    bright = float(np.percentile(linear.max(axis=-1), 99.5))
    if not 0 < bright < _DIM:
        return 1
    return int(min(_HIGHEST_GAIN, 2.0 ** np.floor(np.log2(_WHITE_SHARE / bright))))


def _radiance(frame: Frame, name: str, *, group: str) -> Layer:
    linear = linear_picture(frame, name)
    gain = 1 if name in _PICTURES else gain_for(linear)
    title, caption = (_PICTURES | _LIGHT)[name]
    return Layer(
        key=name, title=title, group=group, gain=gain, picture=srgb_uint8_from_linear(gain * linear),
        caption=caption + ("" if name in _PICTURES else _share(frame, name)),
    )  # fmt: skip


def _share(frame: Frame, layer: str) -> str:
    total = float(frame.buffer("radiance")[..., GREEN].sum())
    options = frame.info.options
    denoised = f"; denoised, biased: {options.denoiser}" if layer in options.denoised_layers else ""
    if not total:
        return denoised
    return f"; {100 * float(frame.buffer(layer)[..., GREEN].sum()) / total:.2g} % of the light (green){denoised}"


def _map(key: str, title: str, group: str, caption: str, values: np.ndarray, *, unit: str, ends=None) -> Layer:
    low, high = limits(values) if ends is None else ends
    return Layer(
        key=key, title=title, group=group, caption=caption, picture=false_colour(values, low, high),
        scale={"low": f"{low:.3g}", "high": f"{high:.3g}", "unit": unit},
    )  # fmt: skip


def _light_maps(frame: Frame) -> list[Layer]:
    transmission = frame.buffer("transmission")[..., GREEN]
    with np.errstate(divide="ignore", invalid="ignore"):
        error_percent = 100 * frame.buffer("standard_error")[..., GREEN] / frame.buffer("radiance")[..., GREEN]
    return [
        _map(
            "transmission", "Transmission", "Light",
            "share of the lamps' light neither absorbed nor scattered on lamp-body-camera; green band",
            transmission, unit="", ends=limits(transmission, from_zero=True),
        ),
        _map(
            "standard_error", "Standard error", "Light",
            "Monte-Carlo standard error of the radiance, relative to it; green band; grey: no light",
            error_percent, unit="%", ends=limits(error_percent, from_zero=True),
        ),
    ]  # fmt: skip


def _geometry(frame: Frame) -> list[Layer]:
    range_m, z_depth_m = frame.buffer("range"), frame.buffer("z_depth")
    ends = limits(np.concatenate([range_m, z_depth_m]))
    normals = normal_colours(frame.buffer("normal"))
    return [
        _map("z_depth", "Depth", "Geometry", "along the optical axis; grey: no body", z_depth_m, unit="m", ends=ends),
        _map("range", "Range", "Geometry", "along the ray; grey: no body seen", range_m, unit="m", ends=ends),
        Layer(
            key="normal", title="Normals", group="Geometry", picture=normals,
            caption="world axes x, y, z as red, green, blue from -1 to 1; grey: no body seen",
        ),
        Layer(
            key="albedo", title="Albedo", group="Geometry", picture=srgb_uint8_from_linear(frame.buffer("albedo")),
            caption="diffuse reflectance, weighted by the camera response; black: none or no body",
        ),
        Layer(
            key="instance", title="Instances", group="Geometry", picture=_instances(frame), exact=True,
            caption="which body each pixel sees; the colours stand in the table of bodies; grey: none",
        ),
    ]  # fmt: skip


def body_colours(frame: Frame) -> dict[int, list[int]]:
    """Return {instance: [r, g, b]}; a body has the same colour in every frame in which it has the same number."""
    numbers = [body.instance for body in frame.info.bodies]
    colours = instance_colours(max(numbers, default=0))
    return {number: colours[number - 1].tolist() for number in numbers}


def _instances(frame: Frame) -> np.ndarray:
    numbers = frame.buffer("instance")
    colours = body_colours(frame)
    palette = np.full((max([0, *colours, int(numbers.max())]) + 1, 3), EMPTY, np.uint8)
    for number, colour in colours.items():
        palette[number] = colour
    return palette[numbers]


def flow_colours(displacement_px: np.ndarray, longest_px: float) -> np.ndarray:
    """Return displacements (..., 2) [px], x right, y down, as colours (..., 3) uint8.

    Hue is the direction (0 degrees, red: right; counter-clockwise), saturation the length up to `longest_px`.
    """
    from matplotlib.colors import hsv_to_rgb

    x, y = displacement_px[..., 0], -displacement_px[..., 1]
    hue = np.degrees(np.arctan2(y, x)) % 360 / 360
    strength = np.clip(np.hypot(x, y) / longest_px, 0, 1)
    return np.rint(255 * hsv_to_rgb(np.stack([hue, strength, np.ones_like(hue)], axis=-1))).astype(np.uint8)


def _flow(frame: Frame) -> Layer:
    displacement = frame.buffer("flow_end") - frame.buffer("flow_start")
    longest_px = max(float(np.percentile(np.linalg.norm(displacement, axis=-1), 99)), 1e-3)
    return Layer(
        key="flow", title="Flow", group="Motion", picture=flow_colours(displacement, longest_px),
        caption="displacement of the point seen, from start to end of the exposure: direction as hue, length as colour",
        scale={"longest_px": f"{longest_px:.3g}"},
    )  # fmt: skip


def _other(frame: Frame, name: str) -> Layer:
    """Return a buffer that this page has no words for: its values, or the length or the green band of its vectors."""
    values = frame.buffer(name).astype(np.float32)
    words = "values"
    if values.ndim == 3:
        words = "length of the vectors" if values.shape[2] == 2 else "green band"
        values = np.linalg.norm(values, axis=-1) if values.shape[2] == 2 else values[..., GREEN]
    return _map(name, name.replace("_", " "), "More", f"buffer {name}: {words}; see FORMAT.md", values, unit="")
