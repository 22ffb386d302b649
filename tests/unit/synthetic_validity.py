"""Frames for the validity benchmark by formula, nothing rendered: a plane with bars, one lamp, grey water.

The truth is direct light J exp(-c (range + path from the lamp)) plus an even veil, plus normal noise of the standard
error that the frame states. Frames (96 x 72): 000000 and 000001 a chart in two waters; 000002 a chart whose light
drowns in the camera's noise.
"""

from pathlib import Path

import numpy as np
import synthetic

from uwsim.camera.lens import Lens, pixel_centres
from uwsim.camera.sensor import expose
from uwsim.dataset import store
from uwsim.dataset.frame import write_frame
from uwsim.dataset.info import FrameInfo
from uwsim.formation.bands import band_values
from uwsim.formation.view import view_of_frame
from uwsim.optics.spectrum import WAVELENGTHS_NM

WIDTH_PX, HEIGHT_PX = 96, 72
K = np.array([[110.0, 0.0, 48.0], [0.0, 110.0, 36.0], [0.0, 0.0, 1.0]])
DISTANCE_M = 1.0
ATTENUATION_PER_M = {0: 0.5, 1: 2.0, 2: 6.0}
NOISE = 0.05
VEIL = {0: 0.1, 1: 0.5, 2: 1.0}  # of the mean water-free light
DARK, BRIGHT = 0.05, 0.8
_FINE = 5  # samples of a pixel along a side, odd: one is the centre
_POSE = synthetic.world_from_camera()


def write_dataset(folder: Path, frames: tuple[int, ...] = (0, 1, 2)) -> store.Dataset:
    """Write the dataset (or some of its frames) to `folder` and open it."""
    for frame in frames:
        _write(Path(folder) / "frames" / f"{frame:06d}", frame)
    manifest = {
        "format": 1, "name": "synthetic_validity", "complete": True, "seed": 7, "recipe": {"name": "synthetic"},
        "scenes_sha256": "0" * 64, "versions": {"uwsim": "0"}, "commit": None, "machine": {},
        "files": store.checksums(Path(folder)),
    }  # fmt: skip
    store.write_manifest(Path(folder), manifest)
    return store.open(Path(folder))


def coverage() -> np.ndarray:
    """Return bars of 3 to 9 pixels, upright above and lying below, (5 H, 5 W): 1 bright."""
    y, x = (np.mgrid[: HEIGHT_PX * _FINE, : WIDTH_PX * _FINE] + 0.5) / _FINE
    upright = (np.floor((x + 0.3) / np.where(y < 18, 3.3, 6.1)) % 2) > 0
    lying = (np.floor((y + 0.3) / np.where(x < 48, 4.4, 8.7)) % 2) > 0
    return np.where(y < HEIGHT_PX / 2, upright, lying).astype(float)


def direct(view, attenuation_per_m: float, albedo: np.ndarray) -> np.ndarray:
    """Return the unscattered light (H, W, 3) of a plane of reflectance (H, W) in grey water."""
    light = 0
    for lamp in view.lamps:
        arriving = lamp.arriving(view.points_m)
        cosine = np.maximum(np.sum(arriving.towards * view.normals, axis=-1), 0)
        share = np.exp(-attenuation_per_m * (view.range_m + arriving.path_m))
        received = arriving.irradiance_per_intensity * cosine * view.factor / np.pi * albedo * share
        light = light + received[..., None] * band_values(view, lamp.spectrum)
    return light


def _write(folder: Path, frame: int) -> None:
    info, bars = _info(frame), DARK + (BRIGHT - DARK) * coverage()
    centre = bars[_FINE // 2 :: _FINE, _FINE // 2 :: _FINE]
    mean = bars.reshape(HEIGHT_PX, _FINE, WIDTH_PX, _FINE).mean(axis=(1, 3))
    shape, rays = (HEIGHT_PX, WIDTH_PX), _rays()
    range_m = DISTANCE_M / rays[..., 2]
    buffers = {
        "range": range_m, "z_depth": np.full(shape, DISTANCE_M), "albedo": np.repeat(centre[..., None], 3, axis=-1),
        "normal": np.broadcast_to(-_POSE[:3, 2], (*shape, 3)), "instance": np.ones(shape, np.uint32),
    }  # fmt: skip
    view = view_of_frame(info, buffers)
    buffers["water_free"] = direct(view, 0.0, mean)
    buffers["direct"] = direct(view, ATTENUATION_PER_M[frame], mean)
    buffers["backscatter"] = np.full((*shape, 3), VEIL[frame] * buffers["water_free"].mean())
    buffers["forward_scatter"] = np.zeros((*shape, 3))
    clean = buffers["direct"] + buffers["backscatter"]
    buffers["standard_error"] = NOISE * clean
    noise = 1 + NOISE * np.random.default_rng(frame).standard_normal(clean.shape)
    buffers |= {name: noise * buffers[name] for name in ("direct", "backscatter")} | {"radiance": noise * clean}
    buffers["transmission"] = np.full((*shape, 3), 0.1)
    buffers = {name: np.asarray(v, np.uint32 if name == "instance" else np.float32) for name, v in buffers.items()}
    image = expose(buffers["radiance"], **synthetic.SENSOR, rng=np.random.default_rng(frame))
    write_frame(folder, image=image, buffers=buffers, info=FrameInfo.model_validate(info))


def _rays() -> np.ndarray:
    return Lens(K=K).rays(pixel_centres(width_px=WIDTH_PX, height_px=HEIGHT_PX))[1]


def _info(frame: int) -> dict:
    c, size = ATTENUATION_PER_M[frame], len(WAVELENGTHS_NM)
    info = synthetic._info(0, np.full(3, c), moving=False)
    a, b = (np.full(size, share * c).tolist() for share in (0.7, 0.3))
    spectrum = np.full(size, 1 / 300.0).tolist()
    lamp = {"half_angle_deg": 40.0, "beam_angles_deg": None, "beam_values": None, "relative_spectrum_per_nm": spectrum}
    return info | {
        "name": f"{frame:06d}", "frame": frame, "batches": 8, "samples_per_pixel": 128,
        "camera": info["camera"] | {
            "width_px": WIDTH_PX, "height_px": HEIGHT_PX, "K": K.tolist(), "response": "Nikon 5100 (NPL)",
        },
        "lamps": ({**info["lamps"][0], **lamp},),
        "water": info["water"] | {
            "wavelengths_nm": WAVELENGTHS_NM.tolist(), "absorption_per_m": a, "scattering_per_m": b,
            "phase_function": {"type": "hg_mixture", "g": [0.9], "weights": np.ones((1, size)).tolist()},
        },
        "bodies": ({"name": "chart", "kind": "usaf_1951", "instance": 1, "world_from_body": np.eye(4).tolist()},),
    }  # fmt: skip
