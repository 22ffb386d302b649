"""Verify a dataset: checksums, files, shapes, finiteness, agreement of the parts."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from uwsim.dataset import store
from uwsim.dataset.check_sequence import check_sequences
from uwsim.dataset.frame import FILES, RAW, Frame, check_buffers, check_options


def check(folder: Path, *, progress: Callable[[int, int], None] | None = None) -> int:
    """Return the number of frames of a sound dataset; ValueError in one line naming the first fault."""
    dataset = store.open(folder)
    _check_files(dataset)
    check_sequences(dataset)
    for done, name in enumerate(dataset.frame_names, start=1):
        check_frame(dataset.frame(name))
        if progress is not None:
            progress(done, len(dataset))
    return len(dataset)


def _check_files(dataset: store.Dataset) -> None:
    listed = dataset.manifest["files"]
    roots = [dataset.folder / part for part in store.FOLDERS]
    below = [path for root in roots for path in root.rglob("*")]
    found = {path.relative_to(dataset.folder).as_posix() for path in below if path.is_file()}
    partial = sorted(name for name in found if ".partial" in name)
    if partial:
        raise ValueError(f"{dataset.folder}: half-written file {partial[0]}")
    folders = {path.relative_to(dataset.folder).as_posix() for path in below if path.is_dir()}
    named = {f"frames/{name}" for name in dataset.frame_names}
    named |= {f"sequences/{name}" for name in dataset.sequence_names}
    if strange := sorted(folders - named):
        raise ValueError(f"{dataset.folder}: folder {strange[0]} is not part of the dataset")
    if missing := sorted(set(listed) - found):
        raise ValueError(f"{dataset.folder}: file {missing[0]} is missing")
    if extra := sorted(found - set(listed)):
        raise ValueError(f"{dataset.folder}: file {extra[0]} is not listed in dataset.json")
    expected = {f"frames/{name}/{file}" for name in dataset.frame_names for file in FILES}
    if absent := sorted(expected - set(listed)):
        raise ValueError(f"{dataset.folder}: {absent[0]} is not part of the dataset")
    for name, checksum in store.checksums(dataset.folder).items():
        if checksum != listed[name]:
            raise ValueError(f"{dataset.folder}: {name} was changed (checksum differs from dataset.json)")


def check_frame(frame: Frame) -> None:
    """Raise ValueError unless a frame's pictures fit its description and each other."""
    camera, where = frame.info.camera, str(frame.folder)
    if frame.folder.name != frame.name:
        raise ValueError(f"{where}: frame.json calls itself {frame.name!r}")
    size = (camera.height_px, camera.width_px)
    if frame.image.shape != (*size, 3):
        raise ValueError(f"{where}: image.png is {frame.image.shape[:2]}, allowed: {size} as in frame.json")
    _check_raw(frame)
    buffers = {name: frame.buffer(name) for name in frame.buffer_names}
    check_buffers(buffers, height=size[0], width=size[1], where=where)
    check_options(buffers, frame.info, where)
    seen = buffers["instance"] > 0
    if np.any(np.isfinite(buffers["range"]) != seen):
        raise ValueError(f"{where}: range and instance disagree about where a body is seen")
    known = {body.instance for body in frame.info.bodies}
    if unknown := set(np.unique(buffers["instance"]).tolist()) - known - {0}:
        raise ValueError(f"{where}: instance {sorted(unknown)} is not among the bodies of frame.json")
    for name in ("radiance", "water_free", "standard_error", "transmission", "albedo"):
        if buffers[name].min() < 0:
            raise ValueError(f"{where}: {name} has negative values, allowed: >= 0")
    for name in ("transmission", "albedo"):
        if buffers[name].max() > 1.001:
            raise ValueError(f"{where}: {name} exceeds 1")
    total = buffers["direct"] + buffers["forward_scatter"] + buffers["backscatter"]
    if not np.allclose(total, buffers["radiance"], rtol=1e-5, atol=0):
        raise ValueError(f"{where}: direct, forward_scatter and backscatter do not sum to radiance")
    _check_orders(frame, buffers)
    _check_geometry(frame, buffers, seen)
    _check_noise(frame, buffers)


def _check_orders(frame: Frame, buffers: dict[str, np.ndarray]) -> None:
    """A share of a layer is not more than the layer, unless the whole layer was denoised."""
    for name, layer in (("direct_unscattered", "direct"), ("backscatter_single", "backscatter")):
        if name not in buffers or (layer == "backscatter" and layer in frame.info.options.denoised_layers):
            continue
        beyond = buffers[name] > buffers[layer] * (1 + 1e-5)
        if buffers[name].min() < 0 or np.any(beyond):
            raise ValueError(f"{frame.folder}: {name} is below 0 or more than {layer} in {np.sum(beyond)} values")


def _check_raw(frame: Frame) -> None:
    """Raw and picture belong together: `raw16.png`, if the frame has one, makes `image.png`."""
    from uwsim.camera import sensor, sensor_record

    camera, entry = frame.info.camera, frame.info.sensor
    if (frame.folder / RAW).is_file() != entry.raw:
        raise ValueError(f"{frame.folder}: {RAW} is {'missing' if entry.raw else 'there, but sensor.raw is false'}")
    if not entry.raw:
        return
    constants = sensor_record.constants(
        entry.model_dump(), K=frame.K, width_px=camera.width_px, height_px=camera.height_px
    )
    size = (camera.height_px, camera.width_px)
    if frame.raw.shape[:2] != size:
        raise ValueError(f"{frame.folder}: {RAW} is {frame.raw.shape[:2]}, allowed: {size} as in frame.json")
    developed = sensor.picture_from_dn(frame.raw, **constants).astype(int)
    # one level: powers of floats differ in the last digit between kinds of CPU
    if np.abs(developed - frame.image).max() > 1:
        raise ValueError(f"{frame.folder}: {RAW} does not make image.png")


def _check_geometry(frame: Frame, buffers: dict[str, np.ndarray], seen: np.ndarray) -> None:
    """The two distances agree with the camera, and normals have unit length (half precision)."""
    from uwsim.camera.lens import lens_from_record, pixel_centres

    lens = lens_from_record(frame.info.camera.model_dump())
    origins, directions = lens.rays(pixel_centres(width_px=seen.shape[1], height_px=seen.shape[0]))
    expected = origins[..., 2][seen] + buffers["range"][seen] * directions[..., 2][seen]
    if not np.allclose(buffers["z_depth"][seen], expected, rtol=1e-4):
        raise ValueError(f"{frame.folder}: z_depth does not agree with range and K")
    if not np.allclose(np.linalg.norm(buffers["normal"], axis=-1)[seen], 1, atol=5e-3):
        raise ValueError(f"{frame.folder}: normals are not of unit length")


def _check_noise(frame: Frame, buffers: dict[str, np.ndarray]) -> None:
    """What frame.json says of the pixels' Monte-Carlo noise follows from `radiance` and `standard_error`."""
    from uwsim.camera import sensor, sensor_record
    from uwsim.render import stopping

    camera, stated = frame.info.camera, frame.info.noise
    if stated is None:
        return
    constants = sensor_record.constants(
        frame.info.sensor.model_dump(), K=frame.K, width_px=camera.width_px, height_px=camera.height_px
    )
    sensor_noise = sensor.noise_std_radiance(buffers["radiance"], **constants)
    share = stopping.share_within(stopping.pixel_ratio(buffers["standard_error"], sensor_noise))
    # a few pixels may lie at the limit, where powers of floats differ in the last digit between kinds of CPU
    if abs(share - stated.pictures["radiance"].pixel_share_within) > 1e-3 + 2 / buffers["range"].size:
        raise ValueError(
            f"{frame.folder}: {share:.4f} of the pixels are within the sensor's noise, frame.json says "
            f"noise.pictures.radiance.pixel_share_within = {stated.pictures['radiance'].pixel_share_within:.4f}"
        )
