"""Refuse scenes in which something is where it cannot be, before any light is rendered.

Camera and lamps are taken at their openings (port or pinhole, front face with LEDs) at times through the exposure, and
the bodies where they are then. Inside a body is where its winding number is 1: the mesh is closed and its faces look
outwards. A mesh that is open, or closed with faces that look inwards, is a room: one may be in it.

Source: winding number of a triangle mesh as the sum of signed solid angles, van Oosterom & Strackee 1983, IEEE Trans.
Biomed. Eng. 30:125, eq. 8.
"""

import numpy as np

from uwsim.camera import pose
from uwsim.render.build import openings, rig_poses
from uwsim.render.film import view_of
from uwsim.render.housing_overlap import cylinders_overlap, inside_cylinder
from uwsim.render.motion import sub_frames
from uwsim.render.shapes import body_triangles
from uwsim.scene.bodies import Generated, MarineSnow, Mesh
from uwsim.scene.models import Scene

LEAST_DISTANCE_M = 1e-3  # of an opening from a surface
_ABOVE_M = 1e-6  # rounding of places at the water surface
_TIMES = 9
_PAIRS = 2_000_000  # of points and triangles looked at at once
_SAME_M = 1e-7  # corners of a mesh that are one, relative to its size


def check(scene: Scene) -> None:
    """Raise ValueError in one line if a scene's parts stand in each other.

    The camera or a lamp inside a closed body or nearer than 1 mm to a surface; camera and lamps in each other's
    housings; with daylight, a body that reaches above the water surface; a body whose streak is too long to render.
    """
    import mitsuba as mi

    _check_housings(scene)
    times_s = scene.shutter.step_times_s(_TIMES) if scene.moves else np.zeros(1)
    opened = _openings_by_name(scene, times_s)
    sub_frames(scene, view_of(scene))  # refuses what moves too fast
    for body in scene.bodies:
        if isinstance(body, MarineSnow):
            _check_below(scene, body, _box(body))
            continue
        triangles = body_triangles(mi, body)
        _check_below(scene, body, triangles.reshape(-1, 3))
        # the body where it is at mid-exposure, the openings as they are to it then
        back = body.world_from_body @ pose.inverse(body.poses_at(times_s))
        for name, points in opened.items():
            _check_apart(name, pose.apply_each(back[:, None], points).reshape(-1, 3), body, triangles)


def _openings_by_name(scene: Scene, times_s: np.ndarray) -> dict[str, np.ndarray]:
    """Return points (times, n, 3) of the camera and of each lamp in the world."""
    poses, rig = rig_poses(scene, times_s), scene.rig
    named = {"camera": scene.model_copy(update={"rig": rig.model_copy(update={"lamps": ()})})}
    found = {name: openings(alone, rig_poses=poses) for name, alone in named.items()}
    first = found["camera"].shape[1]
    for lamp in rig.lamps:
        alone = scene.model_copy(update={"rig": rig.model_copy(update={"lamps": (lamp,)})})
        found[f"lamp {lamp.name}"] = openings(alone, rig_poses=poses)[:, first:]
    return found


def _check_apart(name: str, points: np.ndarray, body, triangles: np.ndarray) -> None:
    low, high = triangles.min(axis=(0, 1)) - LEAST_DISTANCE_M, triangles.max(axis=(0, 1)) + LEAST_DISTANCE_M
    near = points[np.all((points >= low) & (points <= high), axis=-1)]
    if len(near) == 0:
        return
    # asked for what is near only: of fine meshes it takes seconds
    closed = isinstance(body, (Mesh, Generated)) and is_closed(triangles)
    if closed and np.any(winding_number(near, triangles) > 0.5):
        raise ValueError(f"{name}: is inside body {body.name}, allowed: outside of it during the whole exposure")
    apart_m = distance_m(near, triangles).min()
    if apart_m < LEAST_DISTANCE_M:
        raise ValueError(
            f"{name}: is {apart_m:.2g} m from the surface of body {body.name}, "
            f"allowed: at least {LEAST_DISTANCE_M:g} m during the whole exposure"
        )


def _check_below(scene: Scene, body, points: np.ndarray) -> None:
    """Refuse what daylight would have to pass above the water, where nothing is traced."""
    if scene.daylight is None:
        return
    points = pose.apply(pose.inverse(body.world_from_body), points)
    half_s = scene.shutter.span_s / 2
    times_s = np.array([-half_s, 0.0, half_s]) if body.moves else np.zeros(1)
    top_m = max(pose.apply(at, points)[:, 2].max() for at in body.poses_at(times_s))
    if top_m > _ABOVE_M:
        raise ValueError(
            f"body {body.name}: reaches z = {top_m:.4g} m, allowed with daylight: below the water surface (z <= 0), "
            "as nothing is traced above it"
        )


def _box(snow: MarineSnow) -> np.ndarray:
    return np.array(np.meshgrid(*zip(snow.low_m, snow.high_m, strict=True))).reshape(3, -1).T


# ---- camera, lamps and their housings ----


def _check_housings(scene: Scene) -> None:
    at_rest = np.eye(4)[None]
    own = scene.model_copy(update={"rig": scene.rig.model_copy(update={"lamps": ()})})
    parts = [("camera", scene.rig.camera, openings(own, rig_poses=at_rest)[0])]
    first = len(parts[0][2])
    for lamp in scene.rig.lamps:
        alone = scene.model_copy(update={"rig": scene.rig.model_copy(update={"lamps": (lamp,)})})
        parts.append((f"lamp {lamp.name}", lamp, openings(alone, rig_poses=at_rest)[0, first:]))
    for name, part, _ in parts:
        if part.housing is None:
            continue
        for other, _, points in parts:
            if other != name and np.any(inside_cylinder(points, part.rig_from_front, part.housing)):
                raise ValueError(f"{other}: is inside the housing of {name}, allowed: outside of it")
    camera = scene.rig.camera
    for name, lamp, _ in parts[1:]:
        if camera.housing is None or lamp.housing is None:
            continue
        if cylinders_overlap((camera.rig_from_front, camera.housing), (lamp.rig_from_front, lamp.housing)):
            raise ValueError(f"{name}: its housing stands in that of the camera, allowed: housings apart")


# ---- meshes ----


def is_closed(triangles: np.ndarray) -> bool:
    """Whether every edge of triangles (n, 3, 3) belongs to two of them that run along it in opposite directions.

    Corners at the same place are the same corner; triangles without area are left out.
    """
    size_m = np.ptp(triangles, axis=(0, 1)).max()
    rounded = np.round(triangles.reshape(-1, 3) / max(_SAME_M * size_m, 1e-300)).astype(np.int64)
    corners = np.unique(rounded, axis=0, return_inverse=True)[1].reshape(-1, 3)
    whole = (corners[:, 0] != corners[:, 1]) & (corners[:, 1] != corners[:, 2]) & (corners[:, 2] != corners[:, 0])
    edges = np.concatenate([corners[whole][:, [0, 1]], corners[whole][:, [1, 2]], corners[whole][:, [2, 0]]])
    key = np.int64(corners.max(initial=0)) + 1
    along, against = np.sort(edges[:, 0] * key + edges[:, 1]), np.sort(edges[:, 1] * key + edges[:, 0])
    return len(edges) > 0 and bool(np.array_equal(along, against))


def winding_number(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Return how often triangles (t, 3, 3) wind around points (n, 3), (n,): 1 inside of outward faces, 0 outside."""
    found = np.zeros(len(points))
    for start in range(0, len(points), step := max(1, _PAIRS // len(triangles))):
        a, b, c = np.moveaxis(triangles[None] - points[start : start + step, None, None], 2, 0)
        la, lb, lc = (np.linalg.norm(edge, axis=-1) for edge in (a, b, c))
        above = np.einsum("...i,...i->...", a, np.cross(b, c))
        below = la * lb * lc + _dot(a, b) * lc + _dot(b, c) * la + _dot(c, a) * lb
        found[start : start + step] = np.arctan2(above, below).sum(axis=-1) / (2 * np.pi)
    return found


def distance_m(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Return the distance of points (n, 3) to the nearest of triangles (t, 3, 3), (n,)."""
    nearest = np.full(len(points), np.inf)
    for start in range(0, len(points), step := max(1, _PAIRS // len(triangles))):
        some = points[start : start + step, None]
        apart = [_to_edge(some, triangles[:, k], triangles[:, (k + 1) % 3]) for k in range(3)]
        nearest[start : start + step] = np.minimum(np.min(apart, axis=0), _to_face(some, triangles)).min(axis=-1)
    return nearest


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.einsum("...i,...i->...", a, b)


def _to_edge(points: np.ndarray, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    along = end - start
    share = _dot(points - start, along) / np.maximum(_dot(along, along), 1e-300)
    return np.linalg.norm(points - start - np.clip(share, 0, 1)[..., None] * along, axis=-1)


def _to_face(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Return the distance to the triangles' planes where a point is above or below the triangle, else infinity."""
    normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    length = np.linalg.norm(normal, axis=-1)
    is_above = np.ones((len(points), len(triangles)), bool) & (length > 0)
    for k in range(3):
        start, end = triangles[:, k], triangles[:, (k + 1) % 3]
        is_above &= _dot(np.cross(normal, end - start), points - start) >= 0
    height = np.abs(_dot(points - triangles[:, 0], normal)) / np.maximum(length, 1e-300)
    return np.where(is_above, height, np.inf)
