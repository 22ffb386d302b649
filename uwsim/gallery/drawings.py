"""What is drawn over a picture: axes of the bodies, markers, lamps, and the paths of points through the exposure.

All positions are pixels of the frame's picture, pixel centres at integer + 0.5, through its lens and port.
"""

from collections.abc import Callable

import numpy as np

from uwsim.camera import pose
from uwsim.camera.lens import Lens, lens_from_record
from uwsim.camera.port import Status
from uwsim.camera.shutter import Shutter, see
from uwsim.dataset.frame import Frame
from uwsim.gallery.layers import body_colours

_AXIS_SHARE = 0.1  # of the picture's width
_PHASES = np.linspace(-0.5, 0.5, 17)
_GRID = (7, 9)  # rows and columns of points whose paths are drawn


def drawings_of(frame: Frame) -> dict:
    """Return all that is drawn over a frame as plain numbers: bodies, markers, lamps, paths, kernel."""
    lens = lens_from_record(frame.info.camera.model_dump())
    return {
        "bodies": _bodies(frame, lens),
        "markers": [
            {"id": one.id, "body": one.body, "corners": _rounded(one.corners_px), "visible": list(one.visible)}
            for one in frame.info.markers
            if one.corners_px is not None
        ],
        "lamps": _lamps(frame, lens),
    } | _motion(frame, lens)


def _rounded(points: np.ndarray) -> list:
    return np.round(np.asarray(points, float), 2).tolist()


def _bodies(frame: Frame, lens: Lens) -> list[dict]:
    """Return the bodies of a frame: colour, share of the pixels, pose in the camera's frame, axes where seen."""
    numbers, counts = np.unique(frame.buffer("instance"), return_counts=True)
    shares = dict(zip(numbers.tolist(), (counts / frame.buffer("instance").size).tolist(), strict=True))
    colours = body_colours(frame)
    camera_from_world = pose.inverse(frame.world_from_camera)
    found = []
    for body in frame.info.bodies:
        camera_from_body = camera_from_world @ np.array(body.world_from_body)
        share = shares.get(body.instance, 0.0)
        found.append(
            {
                "name": body.name, "kind": body.kind, "instance": body.instance, "colour": colours[body.instance],
                "share": round(share, 5), "position_m": np.round(camera_from_body[:3, 3], 4).tolist(),
                "moves": body.world_from_body_through_exposure is not None,
                "axes": axes(camera_from_body, lens, frame, body.instance) if share else None,
            }
        )  # fmt: skip
    return found


def axes(camera_from_body: np.ndarray, lens: Lens, frame: Frame, instance: int) -> dict | None:
    """Return origin and ends of a body's axes in pixels, and their length [m]: 1, 2 or 5 times a power of ten.

    `hidden`: another body is seen in front of the origin. None where an end has no pixel or the origin lies outside the
    picture.
    """
    camera = frame.info.camera
    z_depth_m = camera_from_body[2, 3]
    if z_depth_m <= 0:
        return None
    length_m = _round_down(_AXIS_SHARE * camera.width_px * z_depth_m / lens.K[0, 0])
    corners = np.vstack([np.zeros(3), length_m * np.eye(3)])
    pixels, status = lens.project(pose.apply(camera_from_body, corners))
    if np.any(status != Status.SEEN) or not _inside(pixels[0], frame):
        return None
    column, row = np.minimum(pixels[0].astype(int), (camera.width_px - 1, camera.height_px - 1))
    hidden = bool(frame.buffer("instance")[row, column] != instance)
    return {"length_m": length_m, "hidden": hidden, "origin": _rounded(pixels[0]), "ends": _rounded(pixels[1:])}


def _round_down(length: float) -> float:
    power = 10.0 ** np.floor(np.log10(length))
    return float(f"{max(step * power for step in (1, 2, 5) if step * power <= length * (1 + 1e-9)):.3g}")


def _inside(pixel: np.ndarray, frame: Frame) -> bool:
    return bool(np.all((pixel >= 0) & (pixel <= (frame.info.camera.width_px, frame.info.camera.height_px))))


def _lamps(frame: Frame, lens: Lens) -> list[dict]:
    """Return the lamps that lie within the picture; hidden ones too, for a lamp has no instance."""
    if not frame.info.lamps:
        return []
    points = np.array([lamp.position_m for lamp in frame.info.lamps])
    pixels, status = lens.project(pose.apply(pose.inverse(frame.world_from_camera), points))
    return [
        {"name": lamp.name, "at": _rounded(pixel)}
        for lamp, pixel, one in zip(frame.info.lamps, pixels, status, strict=True)
        if one == Status.SEEN and _inside(pixel, frame)
    ]


def _motion(frame: Frame, lens: Lens) -> dict:
    """Return the paths of a grid of points, and that of the point seen nearest to the centre: the blur kernel there.

    Paths follow camera and bodies through the exposure of the row that sees the point. Frames at rest have neither.
    """
    camera = frame.info.camera
    if len(camera.times_s) < 2 or not np.isfinite(frame.buffer("range")).any():
        return {"paths": [], "kernel": None}
    seen = np.argwhere(np.isfinite(frame.buffer("range")))
    middle = np.array([camera.height_px, camera.width_px]) / 2 - 0.5
    centre = seen[np.argmin(np.linalg.norm(seen - middle, axis=-1))]
    rows, columns = ((np.arange(n) + 0.5) / n for n in _GRID)
    places = np.stack(np.meshgrid(rows * camera.height_px, columns * camera.width_px, indexing="ij"), axis=-1)
    grid = places.reshape(-1, 2).astype(int)
    grid = grid[np.isfinite(frame.buffer("range")[tuple(grid.T)])]
    paths = point_paths(frame, lens, np.vstack([centre, grid]))
    whole = [path for path in paths[1:] if np.isfinite(path).all()]
    kernel = None
    if np.isfinite(paths[0]).all():
        at = paths[0][len(_PHASES) // 2]
        kernel = {"at": _rounded(at), "path": np.round(paths[0] - at, 4).tolist()}
    return {"paths": [_rounded(path) for path in whole], "kernel": kernel}


def point_paths(frame: Frame, lens: Lens, pixels: np.ndarray) -> np.ndarray:
    """Return the way through the picture of the points that pixels (n, 2) (row, column) see, (n, 17, 2) [px].

    At 17 moments from start to end of the exposure, with a rolling shutter of that of the row that sees the point.
    NaN where the camera does not see it then. Raises ValueError if a pixel sees no body.
    """
    camera, pixels = frame.info.camera, np.asarray(pixels)
    range_m, numbers = (frame.buffer(name)[tuple(pixels.T)] for name in ("range", "instance"))
    if not np.isfinite(range_m).all():
        raise ValueError(f"{frame.folder}: got a pixel that sees no body, allowed: pixels of finite range")
    shutter = Shutter(
        height_px=camera.height_px, exposure_s=frame.info.sensor.exposure_time_s, readout_s=camera.readout_s
    )
    origins, directions = lens.rays(pixels[:, ::-1] + 0.5)
    seen_m = origins + range_m[:, None] * directions
    rows_s = shutter.middle_s(pixels[:, 0] + 0.5)
    paths = np.empty((len(pixels), len(_PHASES), 2))
    for number in np.unique(numbers):
        poses_at, mine = _body_from_camera(frame, number), numbers == number
        points = pose.apply_each(poses_at(rows_s[mine]), seen_m[mine])
        for step, phase in enumerate(_PHASES):
            paths[mine, step] = see(points, lens=lens, poses_at=poses_at, shutter=shutter, phase=phase)[0]
    return paths


def _body_from_camera(frame: Frame, number: int) -> Callable[[np.ndarray], np.ndarray]:
    """Return the pose of the camera in the frame of a body (of the world, if it rests) as a function of times [s]."""
    camera = frame.info.camera
    knots, knots_s = np.array(camera.world_from_camera_through_exposure), np.array(camera.times_s)
    body = next(one for one in frame.info.bodies if one.instance == number)
    if body.world_from_body_through_exposure is not None:
        knots = pose.inverse(np.array(body.world_from_body_through_exposure)) @ knots
    # the last knot and the end of the exposure differ by round-off
    return lambda times_s: pose.interpolate(knots, knots_s=knots_s, times_s=np.clip(times_s, knots_s[0], knots_s[-1]))
