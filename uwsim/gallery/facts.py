"""What a frame is, in words and numbers: its entry in the index, the lines beside its picture, classes to filter by."""

import numpy as np

from uwsim.camera import pose
from uwsim.dataset.frame import Frame
from uwsim.dataset.info import FrameInfo

GREEN = 1
_MOST_VALUES = 8
_EDGES_PER_M = (0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0)


def entry_of(frame: Frame) -> dict:
    """Return what the index knows of a frame; it must stay small."""
    info, range_m = frame.info, frame.buffer("range")
    seen = range_m[np.isfinite(range_m)]
    return {
        "name": frame.folder.name,
        "group": info.group,
        "scene": info.scene,
        "sequence": info.sequence,
        "camera": None if info.rig is None else info.rig.camera,
        "water": info.water.name.partition(" x ")[0],
        "attenuation": float(f"{info.water.bands.attenuation_per_m[GREEN]:.3g}"),
        "range": float(f"{np.median(seen):.3g}") if seen.size else None,
        "blur": None if info.blur is None else round(info.blur.length_px, 2),
        "moves": len(info.camera.times_s) > 1,
        "markers": sum(all(marker.visible) for marker in info.markers),
        "noise": None if info.noise is None else info.noise.met,
        "width": info.camera.width_px,
        "height": info.camera.height_px,
    }


def turbidity_classes(attenuations_per_m: list[float]) -> tuple[list[str], list[int]]:
    """Return the names of the classes of turbidity, clearest first, and the class of each attenuation.

    One class per value where there are at most 8, else decades halved at 3. Only classes that hold something.
    """
    values = sorted(set(attenuations_per_m))
    if len(values) <= _MOST_VALUES:
        return [f"{value:.3g} /m" for value in values], [values.index(value) for value in attenuations_per_m]
    bins = np.searchsorted(_EDGES_PER_M, attenuations_per_m, side="right")
    used = sorted(set(bins.tolist()))
    return [_bin_name(one) for one in used], [used.index(one) for one in bins.tolist()]


def _bin_name(index: int) -> str:
    if index == 0:
        return f"below {_EDGES_PER_M[0]:g} /m"
    if index == len(_EDGES_PER_M):
        return f"{_EDGES_PER_M[-1]:g} /m and more"
    return f"{_EDGES_PER_M[index - 1]:g} to {_EDGES_PER_M[index]:g} /m"


def facts_of(frame: Frame) -> list[list[str]]:
    """Return the lines (name, text) beside the picture of a frame."""
    info = frame.info
    bands = info.water.bands
    pairs = [
        ("group", info.group),
        ("scene", info.scene),
        ("sequence", _sequence(info)),
        ("water", _water(info)),
        ("absorption a, red, green, blue", _three(bands.absorption_per_m, "/m")),
        ("scattering b", _three(bands.scattering_per_m, "/m")),
        ("attenuation c", _three(bands.attenuation_per_m, "/m")),
        ("distance", _distance(frame)),
        ("camera", _camera(info)),
        ("camera at", _position(info)),
        ("exposure", f"{1e3 * info.sensor.exposure_time_s:.3g} ms at f/{info.sensor.f_number:g}"),
        ("light", _light(info)),
        ("motion", _blur(info)),
        ("Monte-Carlo noise", _noise(info)),
        ("seed", f"{info.seed}, frame {info.frame}"),
    ]
    return [[name, text] for name, text in pairs if text]


def _three(values: tuple[float, ...], unit: str) -> str:
    return f"{', '.join(f'{value:.3g}' for value in values)} {unit}"


def _water(info: FrameInfo) -> str:
    added = len(info.added_water)
    return info.water.name + (f", and {added} added (layers, plumes, grids)" if added else "")


def _sequence(info: FrameInfo) -> str:
    camera = "" if info.rig is None else f"camera {info.rig.camera}, moment {info.rig.moment}"
    if info.sequence is None:
        return camera
    return f"{info.sequence}, {1e-9 * info.time_ns:.4f} s, {camera}"


def _distance(frame: Frame) -> str:
    range_m = frame.buffer("range")
    seen = range_m[np.isfinite(range_m)]
    if not seen.size:
        return "no body is seen"
    median = float(np.median(seen))
    thickness = median * frame.info.water.bands.attenuation_per_m[GREEN]
    return (
        f"{seen.min():.3g} to {seen.max():.3g} m, median {median:.3g} m = {thickness:.2g} attenuation lengths (green)"
    )


def _camera(info: FrameInfo) -> str:
    camera = info.camera
    behind = "pinhole in the water" if camera.port is None else f"behind a {camera.port.kind} port"
    rolling = f", rolling shutter of {1e3 * camera.readout_s:.3g} ms" if camera.readout_s else ""
    return f"{camera.width_px} × {camera.height_px} px, {behind}, focal length {camera.K[0][0]:.4g} px{rolling}"


def _position(info: FrameInfo) -> str:
    world_from_camera = np.array(info.camera.world_from_camera)
    x, y, z = world_from_camera[:3, 3]
    axis = pose.apply(world_from_camera, np.array([0.0, 0.0, 1.0])) - world_from_camera[:3, 3]
    # + 0.0: no negative zeros
    return f"({x:.3g}, {y:.3g}, {z:.3g}) m, looks along ({', '.join(f'{round(one, 2) + 0.0:.2g}' for one in axis)})"


def _light(info: FrameInfo) -> str:
    lamps = [f"{lamp.name} {lamp.radiant_intensity_w_per_sr:.3g} W/sr" for lamp in info.lamps]
    if info.daylight is not None:
        lamps.append(f"sun and sky, sun at {info.daylight.sun_zenith_deg:g}° from the zenith")
    return ", ".join(lamps)


def _blur(info: FrameInfo) -> str:
    if info.blur is None:
        return "at rest" if len(info.camera.times_s) < 2 else "moves, no body is seen"
    kind = "the whole picture alike" if info.blur.uniform else f"not uniform, spread {info.blur.spread_px:.2g} px"
    return f"{info.blur.length_px:.3g} px at {info.blur.angle_deg:.3g}° in the median; {kind}"


def _noise(info: FrameInfo) -> str:
    if info.noise is None:
        return "not stated"
    radiance = info.noise.pictures["radiance"]
    return (
        f"rule {'met' if info.noise.met else 'NOT met'}: {radiance.samples_per_pixel} samples per pixel, "
        f"{radiance.region_error_p95:.2%} in regions, {radiance.pixel_share_within:.0%} of the pixels within half of "
        f"the sensor's noise"
    )
