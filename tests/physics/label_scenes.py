"""A tilted plane and balls before three cameras, and the cameras' rays without the project's lens and port.

The lens by OpenCV, Snell's law by vectors.
"""

import cv2
import numpy as np

from tests.physics import scenes
from uwsim.render import film, geometry
from uwsim.scene.models import Scene

WIDTH_PX, HEIGHT_PX = 640, 480
AT_M = (0.0, 0.0, -100.0)
DISTORTION = (-0.12, 0.03, 0.001, -0.002)
TILT_DEG, GAP_M, GLASS_M, N_GLASS = 5.0, 0.03, 0.01, 1.52
PORT = {"kind": "flat", "gap_m": GAP_M, "thickness_m": GLASS_M, "n_glass": N_GLASS, "tilt_deg": TILT_DEG}
CAMERAS = {
    "pinhole": {"horizontal_fov_deg": 50.0},
    "distorted": {"horizontal_fov_deg": 50.0, "distortion": DISTORTION},
    "port": {"horizontal_fov_deg": 60.0, "port": PORT},
}
PLANE = {"name": "plane", "kind": "rectangle", "width_m": 8.0, "height_m": 8.0, "reflectance": 0.5,
         "position_m": (0.1, 0.9, -100.05), "towards_m": (-0.35, 0.0, -99.8)}  # fmt: skip
RADIUS_M = 0.06
BALLS = {"name": "balls", "kind": "marker_layout", "layout": "pyramid_5", "edge_m": 0.2, "sphere_radius_m": RADIUS_M,
         "position_m": (0.03, 0.75, -100.02), "rotation_deg": (60.0, 10.0, 20.0)}  # fmt: skip


def scene_of(camera: str, *bodies: dict, size_px: tuple[int, int] = (WIDTH_PX, HEIGHT_PX), **rig) -> Scene:
    """Return the bodies before one of the cameras."""
    values = scenes.wall(distance_m=1.0).model_dump()
    values["rig"]["camera"] = {"width_px": size_px[0], "height_px": size_px[1]} | CAMERAS[camera]
    values["rig"] |= rig
    values["bodies"] = bodies
    return Scene.model_validate(values)


def buffers_of(scene: Scene) -> dict[str, np.ndarray]:
    return geometry.geometry(scene, film.view_of(scene))


def refracted(directions: np.ndarray, normal: np.ndarray, ratio: float) -> np.ndarray:
    """Return unit directions (..., 3) beyond a face, normal along the way; `ratio`: index before over that after."""
    along = directions @ normal
    beyond = np.sqrt(1 - ratio**2 * (1 - along**2))
    return ratio * directions + (beyond - ratio * along)[..., None] * normal


def own_rays(scene: Scene, *, shift_px: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Return origins [m] and unit directions (H, W, 3) in the camera's frame of rays through the pixels' centres."""
    camera = scene.rig.camera
    rows, columns = np.mgrid[: camera.height_px, : camera.width_px] + 0.5 + shift_px
    pixels = np.stack([columns, rows], axis=-1).reshape(-1, 1, 2)
    # OpenCV takes K and pixels as they are: with ours at integer + 0.5 they agree
    until = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 100, 1e-12)
    plane = cv2.undistortPoints(pixels, camera.K, np.array(camera.distortion or (0.0,) * 4), criteria=until)
    directions = np.concatenate([plane[:, 0], np.ones((len(plane), 1))], axis=-1)
    directions = (directions / np.linalg.norm(directions, axis=-1, keepdims=True)).reshape(
        camera.height_px, camera.width_px, 3
    )
    if camera.port is None:
        return np.zeros_like(directions), directions
    normal, n_water = port_normal(), scene.water.refractive_index
    inside = directions * (GAP_M / (directions @ normal))[..., None]
    glass = refracted(directions, normal, 1 / N_GLASS)
    outside = inside + glass * (GLASS_M / (glass @ normal))[..., None]
    return outside, refracted(glass, normal, N_GLASS / n_water)


def port_normal() -> np.ndarray:
    return np.array([np.sin(np.radians(TILT_DEG)), 0.0, np.cos(np.radians(TILT_DEG))])


def to_world(camera_m: np.ndarray) -> np.ndarray:
    """Return vectors (..., 3) in the camera's frame in the world: it looks along +y, its right is +x."""
    x, y, z = np.moveaxis(camera_m, -1, 0)
    return np.stack([x, z, -y], axis=-1)
