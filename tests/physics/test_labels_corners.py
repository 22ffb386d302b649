"""Corners of boards are in the picture where frame.json says: found in it by OpenCV, to less than a tenth of a pixel.

Setup: an ArUco, an AprilTag and a ChArUco board, turned, 0.6 m before a camera in water that does nothing, in a lamp's
light: a pinhole, a distorted lens, and a distorted lens behind a flat port. Pictures of 32 samples per pixel.
Expected: what is found is `corners_px` and `point_px`, on average and each one (root mean square). The corners of a
chessboard are refined by cv2.cornerSubPix; those of single markers, which that puts 0.15 px too far inside, as the
crossing of lines through their edges. OpenCV's pixel centres are at integers, ours at integer + 0.5.
Tolerance: model (corners in pixels that average over their area, noise): 0.1 px rms, 0.05 px mean.
Negative control: without the half pixel between the two conventions; without port and distortion in the projection.
"""

from functools import cache

import cv2
import numpy as np
import pytest

from tests.physics import scenes
from uwsim.camera import pinhole, pose
from uwsim.render import film, geometry, transport
from uwsim.render.build import build
from uwsim.scene import truth
from uwsim.scene.models import Scene

PLACE = {"position_m": (0.01, 0.6, -100.02), "towards_m": (0.0, 0.0, -100.0), "rotation_deg": (14.0, -20.0, 7.0)}
BOARDS = {
    "aruco": {"kind": "marker_board", "dictionary": "DICT_4X4_50", "columns": 4, "rows": 3, "marker_size_m": 0.06,
              "gap_m": 0.025},
    "apriltag": {"kind": "marker_board", "dictionary": "DICT_APRILTAG_36h11", "columns": 4, "rows": 3,
                 "marker_size_m": 0.06, "gap_m": 0.025},
    "charuco": {"kind": "charuco_board", "columns": 8, "rows": 6, "square_m": 0.05, "marker_m": 0.036},
}  # fmt: skip
DISTORTION = (-0.12, 0.03, 0.001, -0.002)
PORT = {"kind": "flat", "gap_m": 0.03, "thickness_m": 0.01, "tilt_deg": 3.0}
QUICK = (("aruco", "port"), ("apriltag", "pinhole"), ("charuco", "port"))
CAMERAS = {
    "pinhole": {"horizontal_fov_deg": 50.0},
    "distorted": {"horizontal_fov_deg": 50.0, "distortion": DISTORTION},
    "port": {"horizontal_fov_deg": 68.0, "distortion": DISTORTION, "port": PORT},
}


@pytest.fixture(scope="module", autouse=True)
def _variant(llvm_spectral):
    pass


def scene_of(board: str, camera: str) -> Scene:
    values = scenes.wall(distance_m=1.0, lamp_m=(0.2, -0.15, 0.0)).model_dump()
    values["rig"]["camera"] = {"width_px": 640, "height_px": 480} | CAMERAS[camera]
    values["bodies"] = [{"name": "board"} | BOARDS[board] | PLACE]
    return Scene.model_validate(values)


def picture(scene: Scene) -> np.ndarray:
    """Return the picture (H, W) uint8, grey, **linear** (a gamma moves edges towards the dark), without noise."""
    built = build(scene, water=None, rig_poses=scene.rig.world_from_rig[None])
    light = transport.layers(built, film.view_of(scene), samples_per_pixel=32, batches=2, seed=3)["radiance"]
    return np.uint8(np.clip(np.rint(200 * light[..., 1] / np.percentile(light[..., 1], 97)), 0, 255))


def crossing(grey: np.ndarray, markers: np.ndarray) -> np.ndarray:
    """Return the corners (n, 4, 2) of markers as crossings of their edges, in OpenCV's pixel coordinates.

    Near a corner each edge is a line through the places where the picture is half way from dark to bright.
    """
    along = np.arange(4.0, 20.0, 0.5)
    across = np.arange(-2.5, 2.51, 0.125)
    found = np.empty(markers.shape)
    for marker, result in zip(markers.astype(float), found, strict=True):
        for index in range(4):
            lines = []
            for other in (index - 1, (index + 1) % 4):
                way = (marker[other] - marker[index]) / np.linalg.norm(marker[other] - marker[index])
                aside = np.array([-way[1], way[0]])
                at = marker[index] + along[:, None, None] * way + across[:, None] * aside
                values = cv2.remap(grey, at.astype(np.float32), None, cv2.INTER_LINEAR).astype(float)
                # how much of the profile is dark says where the edge is
                low, high = values[:, :4].mean(axis=1), values[:, -4:].mean(axis=1)
                place = across[0] + (across[-1] - across[0]) * np.mean((values - high[:, None]), axis=1) / (low - high)
                slope, offset = np.polyfit(along, place, 1)
                lines.append((marker[index] + offset * aside, way + slope * aside))
            (a, u), (b, v) = lines
            result[index] = a + u * np.linalg.solve(np.stack([u, -v], axis=-1), b - a)[0]
    return found


def refined(grey: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Return the corners (n, 2) refined, in our pixel coordinates."""
    enough = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 100, 1e-4)
    corners = np.ascontiguousarray(corners.reshape(-1, 1, 2), np.float32)
    return cv2.cornerSubPix(grey, corners, (4, 4), (-1, -1), enough).reshape(-1, 2) + 0.5


@cache
def corners(board: str, camera: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return corners (n, 2) [px] as found in the picture, as in frame.json, and by the pinhole alone."""
    scene = scene_of(board, camera)
    body, grey = scene.bodies[0], picture(scene)
    range_m = geometry.geometry(scene, film.view_of(scene))["range"]
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, body.dictionary))
    if board == "charuco":
        theirs = cv2.aruco.CharucoBoard((body.columns, body.rows), body.square_m, body.marker_m, dictionary)
        found, ids, _, _ = cv2.aruco.CharucoDetector(theirs).detectBoard(grey)
        points = {point["id"]: (point["point_px"], point["point_world_m"]) for point in
                  truth.marker_points(scene, range_m=range_m)}  # fmt: skip
        true = [points[number] for number in ids.ravel()]
    else:
        found, ids, _ = cv2.aruco.ArucoDetector(dictionary).detectMarkers(grey)
        entries = {entry["id"]: entry for entry in truth.marker_corners(scene, range_m=range_m)}
        true = [
            pair for number in ids.ravel()
            for pair in zip(entries[number]["corners_px"], entries[number]["corners_world_m"], strict=True)
        ]  # fmt: skip
    pixels, world = (np.array(values) for values in zip(*true, strict=True))
    alone = pinhole.project(pose.apply(pose.inverse(scene.rig.world_from_rig), world), scene.rig.camera.K)
    if board != "charuco":
        return crossing(grey, np.concatenate(found)).reshape(-1, 2) + 0.5, pixels, alone
    return refined(grey, found), pixels, alone


def off(found: np.ndarray, true: np.ndarray) -> tuple[float, float]:
    """Return root mean square and largest component of the mean of differences (n, 2)."""
    return float(np.sqrt(np.mean((found - true) ** 2))), float(np.abs((found - true).mean(axis=0)).max())


@pytest.mark.parametrize(
    ("board", "camera"),
    [
        pytest.param(board, camera, marks=[] if (board, camera) in QUICK else pytest.mark.slow)
        for board in BOARDS for camera in CAMERAS
    ],
)  # fmt: skip
def test_corners_are_found_where_the_truth_has_them(board, camera):
    found, true, alone = corners(board, camera)
    assert len(found) == {"aruco": 48, "apriltag": 48, "charuco": 35}[board]
    rms, mean = off(found, true)
    print(f"{board} {camera}: rms {rms:.4f} px, mean {mean:.4f} px")
    assert rms < 0.1 and mean < 0.05
    # controls
    assert off(found - 0.5, true)[1] > 0.4
    if camera != "pinhole":
        assert off(found, alone)[0] > 0.7
