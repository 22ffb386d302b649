"""What a dataset shows: one frame beside its water-free twin, its truth in layers, all frames small."""

import numpy as np

from uwsim.bench.page.markup import escape, figure, grid, paragraph, picture, section
from uwsim.bench.page.pictures import layer_figures
from uwsim.bench.page.plots import optical_thickness
from uwsim.bench.task import lens_of, pinhole_K, spread, through_camera
from uwsim.dataset.frame import Frame
from uwsim.dataset.info import FrameInfo
from uwsim.dataset.store import Dataset

THUMBNAILS = 12
_THUMBNAIL_PX = 320


def shown_frame(dataset: Dataset) -> Frame:
    """Return the frame to show: of the still ones (else of all) that of median optical thickness."""
    frames = list(dataset.frames)
    frames = [frame for frame in frames if frame.info.blur is None] or frames
    thickness = [optical_thickness(frame) for frame in frames]
    order = sorted((value if np.isfinite(value) else np.inf, index) for index, value in enumerate(thickness))
    return frames[order[(len(order) - 1) // 2][1]]


def facts(dataset: Dataset) -> str:
    """Return the dataset in a line of numbers."""
    infos = [frame.info for frame in dataset.frames]
    sizes = sorted({f"{info.camera.width_px} × {info.camera.height_px} px" for info in infos})
    samples = sorted({info.samples_per_pixel for info in infos})
    attenuations = [info.water.bands.attenuation_per_m[1] for info in infos]
    low, high = min(attenuations), max(attenuations)
    noise = [info.noise.met for info in infos if info.noise is not None]
    entries = [
        ("dataset", dataset.name),
        ("frames", f"{len(infos)} ({sum(info.blur is not None for info in infos)} in motion)"),
        ("size", ", ".join(sizes)),
        ("samples per pixel", ", ".join(map(str, samples))),
        ("Monte-Carlo noise", f"low enough in {sum(noise)} of {len(noise)} frames" if noise else "not stated"),
        ("camera", ", ".join(sorted({_behind(info) for info in infos}))),
        ("attenuation, green", f"{low:.3g} /m" if low == high else f"{low:.3g} to {high:.3g} /m"),
        ("seed", str(dataset.manifest["seed"])),
    ]
    items = "".join(f"<div><dt>{escape(key)}</dt><dd>{escape(value)}</dd></div>" for key, value in entries)
    return f'<dl class="facts">{items}</dl>'


def _behind(info: FrameInfo) -> str:
    return "pinhole in the water" if info.camera.port is None else f"behind a {info.camera.port.kind} port"


def compare_section(frame: Frame) -> str:
    """Return the picture with water over its water-free twin, and the slider between them."""
    with_water = picture(
        through_camera(frame, "radiance"),
        "The scene seen through water",
        attributes='class="over" draggable="false"',
    )
    without = picture(
        through_camera(frame, "water_free"), "The same scene without water", attributes='draggable="false"'
    )
    stack = (
        f'<div class="stack">{without}{with_water}<span class="rule"></span>'
        '<span class="tag left">water</span><span class="tag right">no water</span></div>'
    )
    slide = (
        '<div class="slide"><label for="split">with water</label>'
        '<input type="range" id="split" min="0" max="100" value="50"><span>without</span></div>'
    )
    bands = frame.info.water.bands.attenuation_per_m
    caption = (
        f"Frame {frame.name}, {frame.info.water.name}: attenuation "
        f"{bands[0]:.2g}, {bands[1]:.2g}, {bands[2]:.2g} /m in red, green, blue; "
        f"median optical thickness {optical_thickness(frame):.2g} one way (green). "
        f"Same scene, rays, lamps and exposure; both without sensor noise. {camera_words(frame)} {noise_words(frame)}"
    )
    return section("twin", "With and without water", figure(stack + slide, "", escape(caption), kind="compare"))


def camera_words(frame: Frame) -> str:
    """Return in a sentence what the camera looks through."""
    camera, lens = frame.info.camera, lens_of(frame)
    port = camera.port
    if port is None:
        return "The camera is a pinhole in the water."
    if port.kind == "flat":
        where = f"the pinhole {1e3 * port.gap_m:.3g} mm behind it"
    else:
        where = f"of {1e3 * port.inner_radius_m:.3g} mm radius"
    return (
        f"The camera looks through a {port.kind} port: glass of {1e3 * port.thickness_m:.3g} mm (index "
        f"{port.n_glass:.4g}, water {port.n_water:.4g}), {where}; {lens.K[0, 0]:.4g} px of focal length in air are "
        f"{pinhole_K(lens)[0, 0]:.4g} px in the water."
    )


def noise_words(frame: Frame) -> str:
    """Return in a sentence how noisy the frame's render is, and whether that is little enough."""
    if frame.info.noise is None:
        return ""
    radiance = frame.info.noise.pictures["radiance"]
    verdict = "met" if frame.info.noise.met else "NOT met: scores on this frame measure the render's noise too"
    return (
        f"Monte-Carlo noise after {radiance.samples_per_pixel} samples per pixel: {radiance.region_error_p95:.2%} in "
        f"regions, {radiance.pixel_share_within:.0%} of the pixels within half of the sensor's noise; rule {verdict}."
    )


def layers_section(frame: Frame) -> str:
    text = f"What frame {frame.name} comes with. Maps belong to the ray through each pixel's centre."
    return section("truth", "The truth behind the picture", paragraph(text), grid(layer_figures(frame)))


def overview_section(dataset: Dataset, gallery: str | None = None) -> str:
    """Return the frames as thumbnails, what the camera stored beside the water-free twin; `gallery`: address of one."""
    names = spread(list(dataset.frame_names), THUMBNAILS)
    figures = [_thumbnail(dataset.frame(name)) for name in names]
    some = "" if len(names) == len(dataset) else f" {len(names)} of {len(dataset)} frames are shown."
    text = f"Left: what the camera stores, with sensor noise. Right: without water.{some}"
    link = f'<p><a href="{escape(gallery)}">Every layer of every frame: the gallery</a></p>' if gallery else ""
    return section("frames", "The dataset at a glance", paragraph(text), link, grid(figures, "thumbs"))


def _thumbnail(frame: Frame) -> str:
    pair = [(frame.image, "as stored"), (through_camera(frame, "water_free"), "without water")]
    images = "".join(picture(_small(image), f"Frame {frame.name} {words}") for image, words in pair)
    blur = f", blur {frame.info.blur.length_px:.3g} px" if frame.info.blur else ""
    caption = f"{frame.info.group}; c = {frame.info.water.bands.attenuation_per_m[1]:.2g} /m{blur}"
    return figure(f'<div class="pair">{images}</div>', frame.name, escape(caption))


def _small(image: np.ndarray) -> np.ndarray:
    import cv2

    height, width = image.shape[:2]
    factor = min(1.0, _THUMBNAIL_PX / width)
    return cv2.resize(image, (round(width * factor), round(height * factor)), interpolation=cv2.INTER_AREA)
