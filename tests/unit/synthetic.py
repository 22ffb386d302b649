"""A small dataset in the project's format for unit tests. Nothing is rendered: every picture is J t + B.

Frames (128 x 96): 000000 and 000001 still, in two waters; 000002 blurred by a straight kernel of known length
and angle; 000003 shows a board of two ArUco markers, drawn by the homography of a known pose.
"""

import math
from pathlib import Path

import numpy as np

from uwsim.camera.sensor import expose
from uwsim.dataset import store
from uwsim.dataset.frame import write_frame
from uwsim.dataset.info import FrameInfo
from uwsim.optics.spectrum import WAVELENGTHS_NM

WIDTH_PX, HEIGHT_PX = 128, 96
K = np.array([[120.0, 0.0, 64.0], [0.0, 120.0, 48.0], [0.0, 0.0, 1.0]])
BLUR_LENGTH_PX, BLUR_ANGLE_DEG = 8.0, 30.0
SENSOR = {
    "electrons_per_radiance": np.array([4e5, 5e5, 4.5e5]), "full_well_e": 1e4, "read_noise_e": 3.0,
    "white_balance": np.array([1.25, 1.0, 1.1]),
}  # fmt: skip
BACKSCATTER = np.array([0.001, 0.0035, 0.003])
ATTENUATIONS_PER_M = {0: (0.45, 0.2, 0.25), 1: (0.9, 0.6, 0.7), 2: (0.45, 0.2, 0.25), 3: (0.45, 0.2, 0.25)}
MARKER_M, GAP_M = 0.2, 0.06
DICTIONARY = "DICT_4X4_50"


def write_dataset(folder: Path, frames: tuple[int, ...] = (0, 1, 2, 3)) -> store.Dataset:
    """Write the dataset (or some of its frames) to `folder` and open it."""
    for frame in frames:
        _write(Path(folder) / "frames" / f"{frame:06d}", frame)
    store.write_manifest(
        Path(folder),
        {
            "format": 1, "name": "synthetic", "complete": True, "seed": 7, "recipe": {"name": "synthetic"},
            "scenes_sha256": "0" * 64,
            "versions": {"uwsim": "0"}, "commit": None, "machine": {}, "files": store.checksums(Path(folder)),
        },
    )  # fmt: skip
    return store.open(Path(folder))


def camera_from_board() -> np.ndarray:
    """Return the true pose of the board in frame 000003, (4, 4); body: x right, y up, z out of the board."""
    tilt = math.radians(20)
    turn = np.array([[math.cos(tilt), 0, math.sin(tilt)], [0, 1, 0], [-math.sin(tilt), 0, math.cos(tilt)]])
    pose = np.eye(4)
    pose[:3, :3] = turn @ np.diag([1.0, -1.0, -1.0])
    pose[:3, 3] = 0.03, -0.02, 0.7
    return pose


def world_from_camera() -> np.ndarray:
    """Return a camera that looks along world y, two metres below the surface."""
    pose = np.eye(4)
    pose[:3, :3] = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
    pose[:3, 3] = 0.5, 0.2, -2.0
    return pose


def marker_corners_m() -> dict[int, np.ndarray]:
    """Return {marker id: corners (4, 3) in the board's frame}: top left, then clockwise from the front."""
    half = MARKER_M / 2
    square = np.array([[-half, half, 0], [half, half, 0], [half, -half, 0], [-half, -half, 0]])
    step = (MARKER_M + GAP_M) / 2
    return {3: square - [step, 0, 0], 5: square + [step, 0, 0]}


def project(points_m: np.ndarray, camera_from_body: np.ndarray) -> np.ndarray:
    """Project points (N, 3) of a body; pixels with centres at integer + 0.5."""
    camera = points_m @ camera_from_body[:3, :3].T + camera_from_body[:3, 3]
    return (camera @ K.T)[:, :2] / camera[:, 2:]


def _albedo(frame: int) -> np.ndarray:
    import cv2

    rng = np.random.default_rng(100 + frame)
    coarse = cv2.resize(rng.random((12, 16, 3)), (WIDTH_PX, HEIGHT_PX), interpolation=cv2.INTER_CUBIC)
    fine = cv2.GaussianBlur(rng.random((HEIGHT_PX, WIDTH_PX, 3)), (0, 0), 0.8)
    albedo = np.clip(0.1 + 0.5 * coarse + 0.5 * (fine - 0.5), 0.05, 0.95)
    if frame == 3:
        board, inside = _board()
        albedo = np.where(inside[..., None] > 0.5, 0.05 + 0.8 * board[..., None], 0.3 * albedo)
    return albedo


def _board() -> tuple[np.ndarray, np.ndarray]:
    """Return the board's reflectance and its mask, warped into the picture."""
    import cv2

    per_m = 600.0  # pixels of the drawing per metre
    width_m, height_m = 2 * MARKER_M + 3 * GAP_M, MARKER_M + 2 * GAP_M
    drawing = np.full((round(height_m * per_m), round(width_m * per_m)), 255, np.uint8)
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, DICTIONARY))
    size = round(MARKER_M * per_m)
    for identity, corners in marker_corners_m().items():
        left, top = (
            round((corners[0, 0] + width_m / 2) * per_m),
            round((height_m / 2 - corners[0, 1]) * per_m),
        )
        picture = cv2.aruco.generateImageMarker(dictionary, identity, size)
        drawing[top : top + size, left : left + size] = picture
    pose = camera_from_board()
    image_from_board = K @ np.column_stack([pose[:3, 0], pose[:3, 1], pose[:3, 3]])
    # drawing index i has its centre at i + 0.5; the picture's index likewise
    board_from_drawing = np.array(
        [[1 / per_m, 0, 0.5 / per_m - width_m / 2], [0, -1 / per_m, height_m / 2 - 0.5 / per_m], [0, 0, 1]]
    )
    shift = np.array([[1, 0, -0.5], [0, 1, -0.5], [0, 0, 1]])
    # eight times finer, then averaged: a pixel is an area
    fine = np.diag([8.0, 8.0, 1.0])
    homography = shift @ fine @ image_from_board @ board_from_drawing
    size_px = (8 * WIDTH_PX, 8 * HEIGHT_PX)
    layers = [drawing.astype(np.float32) / 255, np.ones(drawing.shape, np.float32)]
    warped = [cv2.warpPerspective(layer, homography, size_px) for layer in layers]
    return tuple(cv2.resize(layer, (WIDTH_PX, HEIGHT_PX), interpolation=cv2.INTER_AREA) for layer in warped)


def smear(image: np.ndarray) -> np.ndarray:
    """Average over a straight, uniform motion of BLUR_LENGTH_PX at BLUR_ANGLE_DEG (y up).

    At the middles of equal parts of the exposure: with both ends among n places the blur is n / (n - 1) too long.
    """
    import cv2

    angle = math.radians(BLUR_ANGLE_DEG)
    steps = ((np.arange(64) + 0.5) / 64 - 0.5) * BLUR_LENGTH_PX
    total = np.zeros_like(image)
    for step in steps:
        shift = np.array([[1.0, 0, step * math.cos(angle)], [0, 1.0, -step * math.sin(angle)]])
        total += cv2.warpAffine(image, shift, (WIDTH_PX, HEIGHT_PX), borderMode=cv2.BORDER_REFLECT)
    return total / len(steps)


def _write(folder: Path, frame: int) -> None:
    attenuation = np.array(ATTENUATIONS_PER_M[frame])
    shape = (HEIGHT_PX, WIDTH_PX)
    z_depth = np.broadcast_to(np.linspace(0.9, 1.6, WIDTH_PX), shape).astype(np.float32).copy()
    y, x = np.mgrid[:HEIGHT_PX, :WIDTH_PX] + 0.5
    ray = np.stack([(x - K[0, 2]) / K[0, 0], (y - K[1, 2]) / K[1, 1], np.ones(shape)], axis=-1)
    range_m = (z_depth * np.linalg.norm(ray, axis=-1)).astype(np.float32)
    albedo = _albedo(frame)
    transmission = np.exp(-2 * attenuation * range_m[..., None])
    water_free = 0.018 * albedo / range_m[..., None] ** 2
    backscatter = BACKSCATTER * (1 - transmission)
    sharp = water_free * transmission + backscatter
    moving = frame == 2
    radiance = smear(sharp) if moving else sharp
    buffers = {
        "radiance": radiance, "direct": radiance - backscatter, "forward_scatter": np.zeros_like(radiance),
        "backscatter": backscatter, "water_free": water_free,
        "transmission": transmission, "standard_error": 0.01 * radiance, "range": range_m,
        "z_depth": z_depth, "albedo": albedo,
        "normal": np.broadcast_to(np.array([0.0, -1.0, 0.0]), (*shape, 3)),
        "instance": np.ones(shape, np.uint32) + (range_m > np.median(range_m)),
    }  # fmt: skip
    if moving:
        angle = math.radians(BLUR_ANGLE_DEG)
        half = BLUR_LENGTH_PX / 2 * np.array([math.cos(angle), -math.sin(angle)])
        buffers |= {
            "sharp": sharp,
            "flow_start": np.tile(-half, (*shape, 1)),
            "flow_end": np.tile(half, (*shape, 1)),
        }
    buffers = {name: np.asarray(v, np.uint32 if name == "instance" else np.float32) for name, v in buffers.items()}
    image = expose(radiance, **SENSOR, rng=np.random.default_rng(frame))
    write_frame(folder, image=image, buffers=buffers, info=FrameInfo.model_validate(_info(frame, attenuation, moving)))


def _info(frame: int, attenuation: np.ndarray, moving: bool) -> dict:
    pose = world_from_camera()
    # the attenuations are those of red, green and blue
    spectrum = np.interp(WAVELENGTHS_NM, (450, 550, 650), attenuation[::-1])
    bands = {
        "weighting": "synthetic", "absorption_per_m": tuple(0.7 * attenuation),
        "scattering_per_m": tuple(0.3 * attenuation), "attenuation_per_m": tuple(attenuation),
    }  # fmt: skip
    sensor = {key: np.asarray(value).tolist() for key, value in SENSOR.items()}
    world_from_board = pose @ camera_from_board()
    markers = marker_corners_m().items() if frame == 3 else ()
    return {
        "format": 1, "name": f"{frame:06d}", "group": "synthetic", "scene": "synthetic", "seed": 7,
        "frame": frame,
        "samples_per_pixel": 1, "batches": 1,
        "camera": {
            "width_px": WIDTH_PX, "height_px": HEIGHT_PX, "K": K.tolist(), "response": "Nikon 5100 (NPL)",
            "world_from_camera": pose.tolist(), "times_s": (0.0,),
            "world_from_camera_through_exposure": (pose.tolist(),),
        },
        "sensor": {"exposure_time_s": 0.01, "f_number": 2.8, "seed": frame, **sensor},
        "lamps": (
            {
                "name": "left", "position_m": tuple(pose[:3, 3] - [0.3, 0, 0]), "direction": (0.0, 1.0, 0.0),
                "radiant_intensity_w_per_sr": 2.0, "spectrum": "white", "half_angle_deg": None,
                "relative_spectrum_per_nm": (1 / 300,) * 61, "beam_angles_deg": (0.0, 60.0), "beam_values": (1.0, 0.0),
            },
        ),
        "water": {
            "name": "synthetic", "wavelengths_nm": tuple(WAVELENGTHS_NM),
            "absorption_per_m": tuple(0.7 * spectrum), "scattering_per_m": tuple(0.3 * spectrum),
            "phase_function": {"type": "hg_mixture", "g": (0.0,), "weights": ((1.0,) * 61,)}, "bands": bands,
        },
        "bodies": (
            {"name": "wall", "kind": "plane", "instance": 1, "world_from_body": np.eye(4).tolist()},
            {"name": "board", "kind": "board", "instance": 2, "world_from_body": world_from_board.tolist()},
        ),
        "markers": tuple(_marker(*item, world_from_board) for item in markers),
        "blur": {"length_px": BLUR_LENGTH_PX, "angle_deg": BLUR_ANGLE_DEG, "spread_px": 0.0, "uniform": True}
        if moving else None,
    }  # fmt: skip


def _marker(identity: int, corners_m: np.ndarray, world_from_board: np.ndarray) -> dict:
    corners_px = project(corners_m, camera_from_board())
    return {
        "body": "board", "dictionary": DICTIONARY, "id": identity, "corners_body_m": corners_m.tolist(),
        "corners_world_m": (corners_m @ world_from_board[:3, :3].T + world_from_board[:3, 3]).tolist(),
        "corners_px": corners_px.tolist(), "visible": (True,) * 4,
    }  # fmt: skip
